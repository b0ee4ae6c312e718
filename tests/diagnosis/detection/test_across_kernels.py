"""Directions that a surface does not move, a kernel at a time, against the same in matrices."""

import numpy as np
import pytest
from innovations import by_onset, onset_tests_of
from kernels import DT, holder, new_fdi
from statistics_of import Across

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis.detection import likelihood, parity
from beaver_ftc.diagnosis.detection.likelihood import MIN_ETA_RAD_S2, STEP_FAULT
from beaver_ftc.diagnosis.detection.parity import AXIS_VIEW, USUAL_SIZE, configure_parity_views
from beaver_ftc.diagnosis.schemes.adaptive_estimators import parity_excludes
from beaver_ftc.diagnosis.state import LOSS, POSITION_HYPOTHESIS

AILERON, ELEVATOR, RUDDER, FLAP = range(4)
PITCH_AXIS, ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER = range(5)
V = 45.0
FLOW = np.array([0.05, 0.0, V, 1200.0, 0.1])  # alpha, beta, airspeed, pressure, dpt
NAMES = (
    "n",
    "n_h",
    "n_Z",
    "R_y",
    "Q_x",
    "Q_d",
    "P_dd",
    "regressor",
    "nu",
)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def fdi(rng):
    """A diagnosis with its views, something in every place that the kernels look at, and air that moves."""
    fdi = new_fdi()
    statistical = fdi["statistical"]
    (
        statistical["test"]["forget"],
        statistical["noise"]["q"],
    ) = (
        0.9,
        2.0,
    )
    (
        statistical["noise"]["Q"],
        statistical["noise"]["eta"],
    ) = (
        (1e-6, 4e-6, 9e-6),
        (0.02, 0.03, 0.05),
    )
    for block, n, regressors in zip(statistical["block"], (1, 2, 2), (3, 4, 4), strict=True):
        block["n_Z"], block["alarm_level"] = regressors, 5.0
        block["R_y"][:n] = rng.uniform(1e-8, 1e-7, n)
        block["regressor"] = rng.normal(size=block["regressor"].shape)
        block["tol"][:regressors] = rng.uniform(0.1, 0.2, regressors)
    configure_parity_views(statistical, load())
    parity.configure_tones(statistical["tone_test_config"], 1e-8, V, 15.0, DT)
    air = statistical["gust"]
    (
        air["output"]["gusty"],
        air["config"]["L_roll"],
        air["memory"]["Q"],
    ) = (
        1,
        34.0,
        rng.uniform(1e-5, 1e-4, 3),
    )
    for name in ("rate_damping", "C", "C_dot", "var_turn"):
        holder(air, name)[name] = rng.normal(size=(3, 3))
    air["output"]["var_turn"] = air["output"]["var_turn"] @ air["output"]["var_turn"].T
    fdi["bound"]["eG"], fdi["bound"]["has_eG"] = (
        rng.uniform(0.1, 0.4, (3, 4)),
        1,
    )
    return fdi


def column(rng):
    G = rng.normal(0.0, 3.0, (3, 4))
    return G, np.array([G[0, AILERON], 0.0, G[2, AILERON]])


def test_across_a_column_is_square_to_it_of_length_one_and_to_the_left(fdi, rng):
    view = fdi["statistical"]["views"][PAST_AILERON]
    G, of_it = column(rng)
    Across.turn(fdi, view, G)
    assert view["direction"][:3] @ of_it == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(view["direction"]) == pytest.approx(1.0)
    assert np.cross(of_it, view["direction"][:3])[1] < 0.0  # from roll over yaw, as (-g_r, g_p)


def test_a_surface_that_moves_neither_leaves_the_direction_as_it_was(fdi):
    view = fdi["statistical"]["views"][PAST_RUDDER]
    view["direction"][:3] = 0.6, 0.0, 0.8
    assert Across.turn(fdi, view, np.zeros((3, 4))) == 0.0
    assert view["direction"].tolist() == [0.6, 0.0, 0.8, 0.0, 0.0]


def declared_along(statistical, m):
    """Noise, jitter, bound, drift of the air and its leap along a direction, by quadratic forms."""
    air, pitch, lateral = statistical["gust"], *statistical["block"][:2]
    noise = np.array(
        [
            lateral["R_y"][0],
            pitch["R_y"][0],
            lateral["R_y"][1],
        ]
    )
    bound = np.abs(m) @ statistical["noise"]["eta"]
    gusts = air["output"]["rate_damping"] @ air["output"]["C"]
    walk = gusts @ np.diag(air["memory"]["Q"]) @ gusts.T
    if air["memory"]["turns_fast"]:
        turned = air["output"]["rate_damping"] @ air["memory"]["C_dot"]
        longest_s = air["config"]["L_roll"] / V
        walk += 0.5 * longest_s**2 * turned @ np.diag(air["memory"]["Q"]) @ turned.T
    moves = float(air["output"]["gusty"])
    size = max(bound, MIN_ETA_RAD_S2)
    drift = statistical["noise"]["q"] * size**2 + moves * V * m @ walk @ m
    jitter = (np.abs(m) @ np.sqrt(statistical["noise"]["Q"])) ** 2
    return (
        m**2 @ noise,
        jitter,
        bound,
        drift,
        moves * m @ air["output"]["var_turn"] @ m,
    )


@pytest.mark.parametrize(
    ("changes", "swings"),
    [({}, 0), ({}, 1), ({"gusty": 0}, 1)],
)
@pytest.mark.parametrize("mix", [(0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (-0.6, 0.0, 0.8)])
def test_what_is_declared_of_the_axes_is_seen_along_a_direction(fdi, mix, changes, swings):
    statistical, view = fdi["statistical"], fdi["statistical"]["views"][PAST_AILERON]
    (
        view["direction"][:3],
        statistical["gust"]["memory"]["turns_fast"],
        view["block"]["P_dd"][0, 0],
    ) = (
        mix,
        swings,
        0.7,
    )
    for name, value in changes.items():
        holder(statistical["gust"], name)[name] = value
    Across.blur(view, statistical, V)
    noise, jitter, bound, drift, leap = declared_along(statistical, np.array(mix))
    block = view["block"]
    assert block["R_y"][0] == pytest.approx(noise)
    assert block["Q_x"][0] == pytest.approx(jitter)
    assert view["eta"][0] == pytest.approx(bound)
    assert block["Q_d"][0, 0] == pytest.approx(drift)
    assert block["P_dd"][0, 0] == pytest.approx(0.7 + leap)


def test_where_no_uncertainty_is_declared_the_least_is_reckoned_with(fdi):
    statistical, view = fdi["statistical"], fdi["statistical"]["views"][ROLL_AXIS]
    statistical["noise"]["eta"], statistical["gust"]["output"]["gusty"] = 0.0, 0
    Across.blur(view, statistical, V)
    assert view["eta"][0] == 0.0
    assert view["block"]["Q_d"][0, 0] == pytest.approx(2.0 * MIN_ETA_RAD_S2**2)


def test_what_constants_multiply_is_that_of_the_axes_along_the_direction(fdi):
    pitch, lateral = fdi["statistical"]["block"][:2]
    (pitch["n"], lateral["n"]), (pitch["axes"][0], lateral["axes"]) = (1, 2), (1, (0, 2))
    views = fdi["statistical"]["views"]
    before = views[PAST_AILERON]["block"]["regressor"][5:].copy()
    for v, expected in (
        (PITCH_AXIS, pitch["regressor"][:3, 0]),
        (ROLL_AXIS, lateral["regressor"][:4, 0]),
        (YAW_AXIS, lateral["regressor"][:4, 1]),
        (PAST_AILERON, lateral["regressor"][:4] @ [-0.6, 0.8]),
    ):
        views[v]["block"]["regressor"][:], views[v]["block"]["n_Z"] = 9.0, 0
        if v == PAST_AILERON:
            views[v]["direction"][:3], views[v]["nulled"] = (-0.6, 0.0, 0.8), AXIS_VIEW
        Across.regress(fdi, views[v], np.ones(3), 0.0)
        found = views[v]["block"]["regressor"][:, 0]
        assert found[: len(expected)] == pytest.approx(expected)
        assert (found[len(expected) :] == 9.0).all(), "of no column nothing more"
    assert not before.any()


@pytest.mark.parametrize(("size", "has_eG"), [(2.0, 1), (2.0, 0), (0.3, 1)])
def test_of_what_goes_along_a_column_that_may_be_turned_a_share_shows_across(fdi, size, has_eG):
    """The column g + e, |e| up to the tolerance of either axis: the most, by its corners, of e across over
    what is left of g + e along; where little is left, a tenth of the column is."""
    view = fdi["statistical"]["views"][PAST_AILERON]
    G, innovation = np.zeros((3, 4)), np.array([0.7, 5.0, -0.4])
    G[0, AILERON], G[2, AILERON], fdi["bound"]["has_eG"] = (
        0.8 * size,
        0.6 * size,
        has_eG,
    )
    Across.regress(fdi, view, innovation, Across.turn(fdi, view, G))
    m = view["direction"][[0, 2]]
    along = np.array([m[1], -m[0]])
    e = fdi["bound"]["eG"][[0, 2], AILERON]
    corners = [e * (s, t) for s in (-1, 1) for t in (-1, 1)]
    most = max(abs(m @ c) for c in corners)
    least = max(size - max(abs(along @ c) for c in corners), parity.MIN_NORM_SHARE * size)
    shown = has_eG * most / least * (along @ innovation[[0, 2]])
    n = int(fdi["statistical"]["block"][1]["n_Z"])
    assert view["block"]["regressor"][n, 0] == pytest.approx(shown)


def test_a_step_signs_as_one_and_a_loss_as_what_its_surface_gives_along_the_direction(fdi, rng):
    view, Gu = fdi["statistical"]["views"][PAST_RUDDER], rng.normal(size=(3, 4))
    view["direction"][:3] = 0.5, 0.3, -0.7
    hypotheses = view["block"]["hypothesis"]
    view["block"]["n_h"], hypotheses["signature"] = 3, 9.0
    hypotheses["kind"][:3], hypotheses["surface"][:3] = (LOSS, STEP_FAULT, LOSS), (FLAP, -1, AILERON)
    Across.sign(fdi, view, Gu)
    m = view["direction"][:3]
    assert hypotheses["signature"][:3, 0] == pytest.approx([m @ Gu[:, FLAP], 1.0, m @ Gu[:, AILERON]])
    assert (hypotheses["signature"][:, 1] == 9.0).all()
    assert (hypotheses["signature"][3:] == 9.0).all()


@pytest.mark.parametrize("axis", range(3))
def test_a_fault_shows_along_every_axis_that_its_column_moves(fdi, axis):
    view = fdi["statistical"]["views"][PAST_RUDDER]
    moved = np.eye(3)[axis]
    view["direction"][:3] = moved
    assert Across.changes_view(fdi, view, AILERON, 1e-6 * moved)
    assert not Across.changes_view(fdi, view, AILERON, 1.0 - moved)
    assert not Across.changes_view(fdi, view, RUDDER, moved), "across its own column it shows nothing"


@pytest.mark.parametrize(
    ("surface", "blind"),
    [(AILERON, (PITCH_AXIS, PAST_AILERON)), (RUDDER, (PITCH_AXIS, PAST_RUDDER)),
     (ELEVATOR, (ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER))],
)  # fmt: skip
def test_a_fault_of_any_course_shows_nothing_where_its_surface_moves_nothing(fdi, surface, blind):
    G = np.array([[-9.0, 0.0, 1.2, 0.0], [0.0, -8.0, 0.0, -1.5], [-0.4, 0.0, -3.0, 0.0]])
    statistical, course = fdi["statistical"], np.cumsum(np.random.default_rng(surface).normal(size=20))
    statistical["n_views"], statistical["test"]["regress"] = 5, 0
    for k in range(20):
        Across.observe(fdi, course[k] * G[:, surface], G, 0.05 * G, FLOW, k, False)
    for v, view in enumerate(statistical["views"][:5]):
        felt = Across.changes_view(fdi, view, surface, G[:, surface])
        assert felt == (v not in blind)
        assert (np.abs(view["block"]["tests"]["correlation"]).max() > 1e-6) == felt


@pytest.mark.parametrize(("latched", "regress", "frame"), [(False, 1, 6), (True, 1, 6), (False, 0, 7)])
def test_a_frame_is_seen_along_every_direction(fdi, rng, latched, regress, frame):
    """Each view as a block of its own that is given what matrices say of the frame."""
    statistical = fdi["statistical"]
    statistical["test"]["regress"], G, Gu = regress, *rng.normal(0.0, 3.0, (2, 3, 4))
    innovation = rng.normal(size=3)
    alone, statistical["n_views"] = [], 2  # enough: the first, and one across a column
    statistical["views"][1] = statistical["views"][PAST_AILERON].copy()
    for view in statistical["views"][:2]:
        onset_tests, overlap = view["block"]["tests"], view["block"]["R"]
        for name in ("correlation", "information", "x_s"):
            onset_tests[name] = rng.uniform(1.0, 2.0, onset_tests[name].shape)
        overlap[:] = rng.uniform(1.0, 2.0, overlap.shape)
        alone.append(view.copy().view(np.recarray))
    Across.observe(fdi, innovation, G, Gu, FLOW, frame, latched)
    for view, own in zip(statistical["views"], alone, strict=False):
        share = Across.turn(fdi, own, G) if own["nulled"] >= 0 else 0.0
        block = own["block"]
        Across.blur(own, statistical, V)
        if regress:
            Across.regress(fdi, own, innovation, share)
        Across.sign(fdi, own, Gu)
        block["nu"][0] = own["direction"][:3] @ innovation
        if not latched:
            likelihood.reset_slot(block, likelihood.restarting_slot(frame))
        likelihood.update_block(block, own["eta"], regress, DT, 0.9 if latched else 1.0)
        for name in NAMES:
            assert view["block"][name] == pytest.approx(block[name], rel=1e-12), name
        for name in (
            "correlation",
            "information",
            "R",
            "e_R",
            "score",
        ):
            assert onset_tests_of(view["block"], name) == pytest.approx(
                onset_tests_of(block, name), rel=1e-12
            ), name


def test_views_that_are_not_there_are_not_asked(fdi, rng):
    fdi["statistical"]["n_views"] = 1
    before = [view.tobytes() for view in fdi["statistical"]["views"]]
    Across.observe(fdi, rng.normal(size=3), np.ones((3, 4)), np.ones((3, 4)), FLOW, 3, False)
    after = [view.tobytes() for view in fdi["statistical"]["views"]]
    changed = [now != then for now, then in zip(after, before, strict=True)]
    assert changed == [True] + [False] * (USUAL_SIZE.n_views - 1)


def test_any_hypothesis_beyond_the_level_excludes_whom_it_is_not_felt_of(fdi):
    statistical = fdi["statistical"]
    statistical["test"]["alarm_level"], fdi["layout"]["position"] = 5.0, range(4)
    statistical["test"]["enabled"] = fdi["config"]["diagnoses_all_types"] = 1
    for s, fie in enumerate(fdi["isolation"]["estimator"][:4]):
        fie["hypothesis_kind"], fie["surface"], fie["effect"]["regressor"] = (
            POSITION_HYPOTHESIS,
            s,
            np.eye(3, 4)[:, s],
        )
    view = statistical["views"][ROLL_AXIS]
    tried = int(view["block"]["n_h"])
    room = len(view["block"]["hypothesis"])
    for h in range(room):
        view["block"]["hypothesis"]["score"] = np.where(np.arange(room) == h, 5.1, 4.9)
        assert Across.excludes(fdi, ELEVATOR) == (h < tried)
        assert not Across.excludes(fdi, AILERON)
        assert parity_excludes(fdi, fdi["isolation"]["estimator"][ELEVATOR]) == (h < tried)
    view["block"]["hypothesis"]["score"] = 5.0
    assert not Across.excludes(fdi, ELEVATOR), "the level is what chance may reach"


def test_a_view_has_levels_and_tolerances_of_the_axes_it_looks_at(fdi):
    """And across a column one tolerance more, which is of the column itself."""
    statistical = fdi["statistical"]
    pitch, lateral = statistical["block"][:2]
    statistical["gust"]["output"]["gusty"] = 0  # else no view of pitch tries what answers the gusts
    for b, block in enumerate((pitch, lateral)):
        (
            block["alarm_level"],
            block["noise_share"],
            block["eta_rate"],
        ) = (
            5.0 + b,
            0.5 + b,
            0.01 + b,
        )
    configure_parity_views(statistical, load())
    for v, view in enumerate(statistical["views"][:5]):
        axes, column = pitch if v == PITCH_AXIS else lateral, v in (PAST_AILERON, PAST_RUDDER)
        block, n = view["block"], int(axes["n_Z"])
        for name in ("alarm_level", "noise_share", "eta_rate"):
            assert block[name] == axes[name]
        assert (block["n"], block["a"]) == (1, 1.0)
        assert block["n_Z"] == n + column
        assert block["tol"][:n].tolist() == axes["tol"][:n].tolist()
        assert block["tol"][n] == float(column)
        assert block["P_xx"][0, 0] == axes["R_y"].max()
        assert block["P_dd"][0, 0] == 1.0
        tried = block["hypothesis"][: block["n_h"]]
        losses = {PITCH_AXIS: [ELEVATOR, FLAP], PAST_AILERON: [RUDDER], PAST_RUDDER: [AILERON]}
        assert tried["surface"].tolist() == [-1, *losses.get(v, [AILERON, RUDDER])]
        assert tried["kind"].tolist() == [STEP_FAULT] + [LOSS] * (len(tried) - 1)
        sense = by_onset(block, "supporting_correlation_sign")
        assert (sense[:, : len(tried)] == -1.0 * (tried["kind"] == LOSS)).all()
        assert (sense[:, len(tried) :] == 0.0).all()
