"""Air, error map, thresholds, the detector's noise of the moment and the scheme, a kernel at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import DT, estimator, fill, new_fdi, on
from scipy.spatial.transform import Rotation
from statistics_of import Statistical, put

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.design.model import design_record, fill_table, regressors, response
from beaver_ftc.diagnosis import bounds, conclusion, gusts, isolation, model_prediction, schemes
from beaver_ftc.diagnosis.bounds import map_dtype
from beaver_ftc.diagnosis.detection import filters, statistical
from beaver_ftc.diagnosis.detection.likelihood import block_dtype
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE
from beaver_ftc.diagnosis.gusts import GUST_RECORD
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.diagnosis.state import (
    LOSS,
    NOT_ISOLATED,
    POSITION_HYPOTHESIS,
    STATISTICAL_DETECTOR,
    WORST_CASE_DETECTOR,
    plugin_verdict_dtype,
)
from beaver_ftc.diagnosis.types import WAIT_FOR_SURFACE
from beaver_ftc.loop import frame

AIRCRAFT = load()
SPAN, V = 14.63, 45.0
X, U = np.array([0.1, -0.05, 0.07]), np.array([0.1, -0.15, 0.05, 0.2])
Y = np.array([0.1, 0.03, V, 1036.0, 0.3, 0.0, 0.0, 0.0])
EITHER = 0


def new_air(**fields):
    record = np.zeros(1, GUST_RECORD).view(np.recarray)[0]
    fill(record, span=SPAN, gravity=9.8, gusty=1, measured=1)
    return fill(record, **fields)


def through_air(y, attitude, heading=None):
    """Velocity through the air in level axes that turn with the heading: by rotations."""
    body = y[2] * np.array([np.cos(y[0]) * np.cos(y[1]), np.sin(y[1]), np.sin(y[0]) * np.cos(y[1])])
    return Rotation.from_euler("ZYX", [heading or 0.0, attitude[1], attitude[0]]).apply(body)


@pytest.mark.parametrize("seed", range(3))
def test_a_gust_is_what_forces_and_gravity_do_not_explain(seed):
    """Level axes of now; the vertical and lateral change of the gust through its lags."""
    rng = np.random.default_rng(seed)
    record, dt = new_air(), 0.02
    then, now = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3)
    y_then, y_now = Y.copy(), Y.copy()
    y_then[:2], y_now[:2] = rng.uniform(-0.1, 0.2, (2, 2))
    y_now[2] = 47.0
    gusts.start_gust(record, y_then, then)
    assert record["memory"]["v"] == pytest.approx(through_air(y_then, then))
    assert record["memory"]["heading"] == then[2]
    assert not record["memory"]["w"].any()
    record["memory"]["w"], record["memory"]["f"] = (
        (0.0, 0.02, -0.03),
        rng.normal(size=3),
    )
    level = Rotation.from_euler("ZYX", [0.0, then[1], then[0]])
    expected = through_air(y_then, then) + dt * (
        level.apply(record["memory"]["f"]) + np.array([0.0, 0.0, 9.8])
    )
    expected = Rotation.from_euler("z", then[2] - now[2]).apply(expected)
    gusts.advance_gust(record, y_now, now, dt)
    change = expected - through_air(y_now, now)
    tau_q, tau_r = 4.0 * SPAN / (np.pi * 47.0), 3.0 * SPAN / (np.pi * 47.0)
    pitching = 0.02 * np.exp(-dt / tau_q) + change[2] / (47.0 * tau_q)
    yawing = -0.03 * np.exp(-dt / tau_r) + change[1] / (47.0 * tau_r)
    assert record["memory"]["w"] == pytest.approx([0.0, pitching, yawing])
    assert record["memory"]["v"] == pytest.approx(through_air(y_now, now))


def test_the_specific_force_is_that_of_the_terms():
    record, out = new_air(S_m=0.01), np.zeros(3)
    fill_table(record["memory"]["table"], AIRCRAFT, AIRCRAFT.measurable_forces, FORCES)
    gusts.fill_force(record, X, Y, U, out)
    of = {
        "alpha": Y[0], "beta": Y[1], "ph": X[0] * SPAN / (2 * V), "rh": X[2] * SPAN / (2 * V), "dpt": Y[4],
        "qh": X[1] * AIRCRAFT.geometry.chord_m / V, **dict(zip(AIRCRAFT.surfaces, U, strict=True)),
    }  # fmt: skip
    expected = dict.fromkeys(FORCES, 0.0)
    for term in AIRCRAFT.measurable_forces:
        size = term.value * np.prod([of[name] ** power for name, power in term.of])
        expected[term.coefficient] += size * (of[term.surface] if term.surface else 1.0)
    assert out == pytest.approx(1036.0 * 0.01 * np.array(list(expected.values())), rel=1e-3)


def test_the_gusts_of_a_frame_are_summed_over_its_instants():
    record, design = new_air(S_m=0.01), design_record().view(np.recarray)[0]
    gusts.start_gust(record, Y, np.zeros(3))
    record["memory"]["w"] = 0.0, 0.02, -0.03
    gusts.fill_gust_effect(record, design, X, Y, U)
    first = record["output"]["acc"].copy()
    gusts.begin_gust_sums(record, V, 0.01)
    gusts.update_gust(record, design, X, Y, U, np.zeros(3), 0.01)
    assert record["memory"]["acc_sum"] == pytest.approx(first + record["output"]["acc"])
    assert np.abs(record["output"]["acc"] - first).max() > 1e-5


@pytest.mark.parametrize("swings", [0, 1])
def test_axes_that_turn_move_what_is_not_seen_besides(swings):
    """A gust that keeps its size changes in the body as its axis turns: over its lag, half that squared.

    It is reckoned with in the frame in which they turn and in the next, whatever the instants of either.
    """
    rng = np.random.default_rng(7)
    record = new_air(
        turns_fast=swings,
        turn_past=0.4,
        L_roll=30.0,
    )
    (
        record["output"]["rate_damping"],
        record["output"]["C"],
        record["memory"]["C_dot"],
    ) = rng.normal(size=(3, 3, 3))
    (
        record["memory"]["share"],
        record["memory"]["Q"],
    ) = (
        (1.0, 0.2, 0.7),
        (1e-3, 2e-3, 3e-3),
    )
    axes, swing = (
        record["output"]["rate_damping"] @ record["output"]["C"],
        record["output"]["rate_damping"] @ record["memory"]["C_dot"],
    )
    expected = axes @ np.diag([1e-3, 4e-4, 3e-3]) @ axes.T  # of the yawing one no more than all of it
    lags = 30.0 / V, 0.0, 3.0 * SPAN / (np.pi * V)
    turned = 0.5 * np.square(lags) * [1e-3, 0.0, 0.4 * 3e-3]
    found = [[gusts.unmeasured_drift(record, V, i, j) for j in range(3)] for i in range(3)]
    assert np.array(found) == pytest.approx(V * expected, rel=1e-12)
    once = swings * DT * V * swing @ np.diag(turned) @ swing.T
    for instants, leap in ((2, 2), (0, 2), (1, 1), (0, 1), (0, 0), (0, 0)):
        for _ in range(instants):
            gusts.add_turn_variance(record, V, DT)
        gusts.finish_gust(record, 1.0)
        assert record["output"]["var_turn"] == pytest.approx(leap * once, rel=1e-12)


def test_a_turning_heading_hides_a_yawing_gust():
    """(rate sigma)^2 lag over the walk's 3 sigma^2 V / scale, lag 3 span / pi V."""
    record, rate = new_air(L_gust=500.0), 0.3
    lag = 3.0 * SPAN / (np.pi * V)
    assert gusts.yaw_turn_share(record, V, rate) == pytest.approx(rate**2 * lag / (3.0 * V / 500.0))


def test_the_bound_of_a_true_estimator_covers_every_course_of_its_parameter():
    """By corners: theta at either end at each instant, by the sign of what it multiplies."""
    low, high = filters.residual_interval(-0.9, 0.2, 0.5, -0.3, 0.2, -0.4, 0.05)
    assert low == pytest.approx(-0.9 * 0.5 + 0.2 * -0.3 + 0.08 - 0.05)
    assert high == pytest.approx(0.2 * 0.5 + -0.9 * -0.3 + 0.08 + 0.05)
    assert filters.published_interval(-1.0, 0.0, -0.2, -0.3, 0.05) == pytest.approx((-0.19, 0.19))
    assert filters.published_interval(-1.0, 0.0, 0.2, -0.8, 0.05) == pytest.approx((-0.21, 0.21))


def test_the_published_bound_and_the_turning_earth():
    design, out = design_record().view(np.recarray)[0], np.array([0.1, 0.2, 0.3])
    inertia, constant, earth = np.array([0.25, 0.2, 0.15]), np.array([0.02, 0.03, 0.04]), 7e-5
    bounds.add_published_bound(X, design, inertia, constant, earth, out)
    p, q, r = X
    coupling = np.abs([design["Pqr"] * q * r, design["Qpr"] * p * r, design["Rpq"] * p * q])
    turning = earth * (2.0 * np.abs(X).sum() + earth)
    rounding = bounds.ROUNDING_RAD_S2
    assert out == pytest.approx(
        [0.1, 0.2, 0.3] + inertia * coupling + constant + turning + rounding, rel=1e-12
    )


COUPLINGS = ("Ppq", "Pqr", "Qpp", "Qpr", "Qrr", "Rpq", "Rqr")
COMPONENT = st.floats(-1.0, 1.0)


@given(
    constants=st.lists(st.floats(-4.0, 4.0), min_size=7, max_size=7),
    x=st.tuples(COMPONENT, COMPONENT, COMPONENT),
    axis=st.tuples(COMPONENT, COMPONENT, COMPONENT).filter(lambda a: np.hypot(np.hypot(*a[:2]), a[2]) > 0.1),
)
def test_the_turning_earth_moves_no_aircraft_more_whatever_its_inertia(constants, x, axis):
    """The coupling is quadratic: of x + e it is that of x, and what both make together; e turns with x."""
    design, out, earth = design_record().view(np.recarray)[0], np.zeros(3), 7e-5
    for name, value in zip(COUPLINGS, constants, strict=True):
        design[name] = value
    Ppq, Pqr, Qpp, Qpr, Qrr, Rpq, Rqr = constants

    def coupling(p, q, r):
        return np.array(
            [Ppq * p * q + Pqr * q * r, Qpp * p * p + Qpr * p * r + Qrr * r * r, Rpq * p * q + Rqr * q * r]
        )

    e = earth * np.array(axis) / np.linalg.norm(axis)
    moved = coupling(*(np.array(x) + e)) - coupling(*x) + np.cross(e, x)
    bounds.add_published_bound(np.array(x), design, np.zeros(3), np.zeros(3), earth, out)
    assert (np.abs(moved) <= out).all()


def test_filters_of_bounds_are_those_of_residuals():
    assert filters.advance_bound(0.3, 0.2, 0.9, 0.1) == pytest.approx(0.27 + 0.02)
    assert filters.advance_gyro(0.3, 0.2, 0.9) == pytest.approx(0.27 + 0.02)


def new_map(**fields):
    record = np.zeros(1, map_dtype(4)).view(np.recarray)[0]
    record["n_boxes"], record["n_levels"], record["n_rows"] = 2, 3, 2
    record["outside"] = 7
    record["lo"], record["hi"] = -1e6, 1e6
    record["lo"][0, 0], record["hi"][0, 0] = -0.1, 0.1  # the inner box by roll rate
    record["lo"][1, 5], record["hi"][1, 5] = 30.0, 60.0  # the outer one by airspeed
    record["share"][:3], record["until_s"][:2] = (0.25, 0.5, 1.0), (10.0, 60.0)
    record["stop_lo"], record["stop_hi"] = (-0.4, -0.4, -0.2, -0.1), (0.2, 0.4, 0.4, 1.0)
    record["e"] = np.arange(record["e"].size).reshape(record["e"].shape) / 1000.0
    return fill(record, **fields)


@pytest.mark.parametrize(
    ("u", "level"),
    [
        ((0.0, 0, 0, 0), 0), ((0.05, 0, 0, 0), 0), ((0.0501, 0, 0, 0), 1), ((-0.1, 0, 0, 0), 0),
        ((-0.11, 0, 0, 0), 1), ((0, 0.2, 0, 0), 1), ((0, 0.21, 0, 0), 2), ((0, 0, -0.06, 0), 1),
        ((0, 0, 0, 0.25), 0), ((0, 0, 0, -0.1), 2),
    ],
)  # fmt: skip
def test_the_level_is_the_first_share_of_the_travel_that_covers_the_surfaces(u, level):
    assert bounds.level_of_positions(new_map(), np.array(u)) == level
    assert bounds.level_of_positions(new_map(two_free=1), np.array(u)) == 2


def test_a_surface_beyond_a_travel_that_ends_at_neutral_uses_all_of_it():
    up_only = new_map(stop_lo=(-0.4, -0.4, -0.2, 0.0))
    assert bounds.level_of_positions(up_only, np.array([0, 0, 0, -0.01])) == 2
    assert bounds.level_of_positions(up_only, np.array([0, 0, 0, 0.25])) == 0
    assert bounds.level_of_positions(up_only, np.array([0, 0, 0, 0.0])) == 0  # at rest at an end it uses none


SHARE, ERROR = (0.3, 0.6, 1.0), np.array([[0.02, 0.03, 0.02], [0.2, 0.3, 0.1], [2.0, 3.0, 1.0]])


@pytest.mark.parametrize(
    ("where", "before", "instants", "share"),
    [
        ((-0.1, 0.1), 0.9, 1, 0.5), ((-0.05, 0.1), 0.9, 1, 0.25), ((0.1, 0.2), 0.0, 1, 0.5),
        ((-9.0, 0.0), 0.0, 1, 1.0), ((-0.1, 0.1), 0.5, 2, 1.0), ((-0.02, 0.02), 0.5, 11, 0.5),
        ((0.0, 0.1), 0.0, 11, 0.275), ((-0.1, 0.1), 0.0, 3, 0.75),
    ],
)  # fmt: skip
def test_the_share_of_its_travel_is_the_furthest_at_any_instant(where, before, instants, share):
    """Of n instants the first may be as before, p0; the others make up the mean: (n p - p0) / (n - 1)."""
    error_map = new_fdi()["bound"]["error_map"]
    error_map["stop_lo"][1], error_map["stop_hi"][1] = -0.2, 0.4
    assert bounds.share_used(error_map, 1, where, before, instants) == pytest.approx(share)
    error_map["stop_lo"][1], error_map["stop_hi"][1] = 0.0, 0.0  # a travel that ends at neutral
    beyond = float(where[0] < 0.0 or where[1] > 0.0)
    assert bounds.share_used(error_map, 1, where, 0.0, 1) == beyond


def test_the_room_of_a_position_is_that_of_where_it_can_have_been():
    fdi = new_fdi()
    fie, bound = estimator(fdi, POSITION_HYPOTHESIS, surface=1, low=-0.5, high=0.5), fdi["bound"]
    (
        bound["error_map"]["one_free"],
        bound["error_map"]["n_levels"],
        bound["error_map"]["share"][:3],
    ) = (
        1,
        3,
        SHARE,
    )
    bound["error_map"]["stop_lo"], bound["error_map"]["stop_hi"] = (
        -0.5,
        0.5,
    )
    (
        bound["extra"][:3],
        bound["nu_max"],
        fdi["bank"]["output"]["innovation"],
    ) = (
        ERROR,
        0.1,
        (0.0, 1.0, 0.0),
    )
    fie["effect"]["regressor"], fdi["config"]["n_substeps"] = (0.0, 20.0, 0.0), 1
    # 1.0 +- 0.1 +- 3.0 over 20: within 0.205 of 0.5 rad, the second level; then 1.4 / 20, the first
    on(isolation.widen_error, fdi, fie)
    assert fie["effect"]["e"] == pytest.approx(ERROR[0])
    assert fie["share_far"] == pytest.approx(1.13 / 20 / 0.5)


def test_a_surface_further_out_adds_what_the_map_has_there_beyond_the_error_of_now():
    error_map = new_map(outside=0, row=1, box=1)
    error_map["e_now"] = error_map["e"][1, 1, 1]
    added = [bounds.extra_bound(error_map, 2, i) for i in range(3)]
    assert added == pytest.approx(error_map["e"][1, 1, 2] - error_map["e"][1, 1, 1])
    assert min(added) > 0.0
    assert bounds.extra_bound(error_map, 0, 1) == 0.0
    error_map["outside"] = 1
    assert bounds.extra_bound(error_map, 2, 1) == 0.0


@pytest.mark.parametrize(("time_s", "age"), [(0.0, 0), (10.0, 0), (10.1, 1), (60.0, 1), (60.1, -1)])
def test_the_row_is_that_of_a_flight_so_old(time_s, age):
    assert bounds.map_row(new_map(time_s=time_s)) == age


@pytest.mark.parametrize(
    ("roll", "airspeed", "time_s", "box"),
    [
        (0.1, 45.0, 5.0, 0),
        (0.11, 45.0, 20.0, 1),
        (-0.1, 90.0, 5.0, 0),
        (0.11, 61.0, 5.0, None),
        (0.0, 45.0, 61.0, None),
    ],
)
def test_the_error_is_that_of_the_innermost_box_or_unknown(roll, airspeed, time_s, box):
    record = new_map(time_s=time_s)
    y = Y.copy()
    y[2] = airspeed
    bounds.look_up_map(record, np.array([roll, 0.0, 0.0]), y, np.array([0.1, 0, 0, 0]))
    age = 0 if time_s <= 10.0 else 1
    expected = record["e"][age, box, 1] if box is not None else bounds.UNMAPPED_ERROR_RAD_S2
    assert record["e_now"] == pytest.approx(np.full(3, expected))
    assert record["outside"] == (box is None)
    assert record["coordinates"][:7] == pytest.approx(
        [roll, 0, 0, 0.1, 0.03, airspeed, 2.0 * 1036.0 / airspeed**2]
    )


def test_the_unknown_is_larger_than_what_terms_give_far_from_where_they_were_fitted():
    """Those of wrightFlyer1903 are 2000 rad/s2 off at an angle of attack of -0.5 rad: a bound of half as much
    excluded the true fault there."""
    assert bounds.UNMAPPED_ERROR_RAD_S2 > 100.0 * 2000.0


def new_detector(**fields):
    fdi = new_fdi()
    record = fdi["statistical"]
    (
        record["test"]["w"],
        record["noise"]["q"],
    ) = 0.25, 2.0
    (
        record["noise"]["Q"],
        record["noise"]["eta_u"],
    ) = (
        (0.1, 0.2, 0.3),
        (0.01, 0.02, 0.03),
    )
    for block, axes in zip(record["block"], ((1,), (0, 2), (0, 2)), strict=True):
        block["n"], block["axes"][: len(axes)], block["Q_scale"] = (
            len(axes),
            axes,
            1.0,
        )
    record["block"][2]["Q_scale"], record["block"][2]["drift_correlation_length_m"] = (
        4.0,
        90.0,
    )
    put(record, **fields)
    return fdi, record, design_record().view(np.recarray)[0]


@pytest.mark.parametrize("moving", [0, 1])
def test_the_drift_is_of_what_is_bounded_and_of_the_air_not_seen(moving):
    fdi, record, design = new_detector()
    rng = np.random.default_rng(1)
    record["gust"]["output"]["gusty"] = moving
    record["gust"]["output"]["rate_damping"], record["gust"]["output"]["C"] = rng.normal(size=(2, 3, 3))
    (
        record["gust"]["memory"]["share"],
        record["gust"]["memory"]["Q"],
    ) = (
        (1.0, 0.2, 0.3),
        (1e-3, 2e-3, 3e-3),
    )
    (
        record["gust"]["config"]["coarse_only"],
        record["gust"]["config"]["L_roll"],
        record["gust"]["config"]["span"],
    ) = moving, 20.0, 5.0 * np.pi
    fdi["bound"]["const"], fdi["bound"]["inertia_coupling_error_share"] = (
        (0.02, 0.0, 0.04),
        0.1,
    )
    Statistical.drifts(record, fdi, design, X, Y)
    bounded = np.zeros(3)
    bounds.add_published_bound(X, design, np.full(3, 0.1), np.array([0.02, 0.0, 0.04]), 0.0, bounded)
    bounded += [0.01, 0.02, 0.03]
    assert record["noise"]["eta"] == pytest.approx(bounded)
    turned = record["gust"]["output"]["rate_damping"] @ record["gust"]["output"]["C"]
    usual, slow = (1e-3, 4e-4, 9e-4), (4e-3, 16e-4, 36e-4 * 0.75**2)  # stronger; 20, 20 and 15 m
    for block, intensity in zip(record["block"], (usual, usual, slow), strict=True):
        axes = block["axes"][: block["n"]]
        unseen = moving * V * turned @ np.diag(intensity) @ turned.T
        drift = unseen[np.ix_(axes, axes)] + 2.0 * np.diag(bounded[axes] ** 2)
        assert block["Q_d"][: len(axes), : len(axes)] == pytest.approx(drift)
        assert block["Q_x"][: len(axes)] == pytest.approx(np.array([0.1, 0.2, 0.3])[axes])
    assert record["block"]["a"] == pytest.approx([1.0, 1.0, np.exp(-DT * V / 90.0)])


def test_where_nothing_is_bounded_a_little_is_reckoned_with():
    fdi, record, design = new_detector(eta_u=0.0)
    Statistical.drifts(record, fdi, design, np.zeros(3), Y)
    assert record["block"][0]["Q_d"][0, 0] == pytest.approx(2.0 * 1e-6)


def test_regressors_are_what_each_coefficient_multiplies():
    """Coefficients times regressors give f + G u without its inertia coupling, here at no rates."""
    fdi, record, design = new_detector(w=1.0, regress=1)
    record["block"]["regressor"] = 9.0
    x = np.zeros(3)
    Statistical.prepare(record, fdi, design, x, Y, U)
    value = design["moments"]["value"][: len(AIRCRAFT.moments)]
    axis = np.array([("Cl", "Cm", "Cn").index(term.coefficient) for term in AIRCRAFT.moments])
    f, G = np.zeros(3), np.zeros((3, 4))
    response(design, x, Y, f, G)
    total = f + G @ U
    for block, axes in zip(record["block"], ((1,), (0, 2), (0, 2)), strict=True):
        of_it = value[np.isin(axis, axes)]
        assert of_it @ block["regressor"][: of_it.size, : len(axes)] == pytest.approx(total[list(axes)])
    terms = np.zeros_like(record["noise"]["zC"])
    regressors(design["moments"], design["moments"]["power"], U, terms)
    assert record["noise"]["zC"] == pytest.approx(terms)


def test_instants_inside_a_frame_add_to_the_mean():
    fdi, record, design = new_detector(regress=1)
    Statistical.prepare(record, fdi, design, X, Y, U)
    once = record["block"]["regressor"].copy()
    for _ in range(3):
        Statistical.look(record, fdi, design, X, Y, U, np.zeros(3), DT)
    assert record["block"]["regressor"] == pytest.approx(4.0 * once)
    Statistical.prepare(record, fdi, design, X, Y, U)
    assert record["block"]["regressor"] == pytest.approx(once)


@pytest.mark.parametrize("offsets_count", [0, 1])
def test_what_is_known_of_a_fault_is_expected(offsets_count):
    rng = np.random.default_rng(2)
    prediction = np.zeros(1, prediction_dtype(4)).view(np.recarray)[0]
    mean = prediction["means"]
    mean["G"], mean["Gu"] = rng.normal(size=(2, 3, 4))
    mean["F"] = rng.normal(size=3)
    effectiveness, offset = np.array([0.4, 1.0, 0.0, 1.0]), np.array([0.1, 0, -0.2, 0])
    model_prediction.predict_known(prediction, 0, effectiveness, offset, offsets_count)
    assert (prediction["F_known"] == mean["F"]).all()
    model_prediction.predict_known(prediction, 1, effectiveness, offset, offsets_count)
    off = mean["G"] @ offset if offsets_count else 0.0
    expected = mean["F"] + mean["Gu"] @ (effectiveness - 1.0) + off
    assert prediction["F_known"] == pytest.approx(expected)
    prediction["x_before"], x = (0.1, 0.2, 0.3), np.array([0.3, 0.1, 0.3])
    model_prediction.innovation_known(prediction, x, 0.5)
    innovation = np.array([0.4, -0.2, 0.0]) - expected
    assert prediction["nu_known"] == pytest.approx(innovation)


def take(fdi, given, t):
    """A frame's verdict of a plug-in, as the frame of the loop takes it."""
    on(conclusion.record_plugin_verdict, fdi, given, t)
    if fdi["verdict"]["isolated_estimator"] >= 0:
        fdi["isolation"]["estimator"]["theta"][fdi["verdict"]["isolated_estimator"]] = given["theta"]


def test_a_plug_ins_verdict_takes_the_place_of_the_built_in_one():
    fdi, given = new_fdi(), np.zeros(1, plugin_verdict_dtype(4)).view(np.recarray)[0]
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    given["isolated"], given["axis"], given["theta"], given["has_effectiveness"] = 2, 1, -0.3, 1
    given["effectiveness"] = 0.5
    take(fdi, given, 3.0)
    assert (fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"]) == (0, NOT_ISOLATED)
    given["detected"] = 1
    take(fdi, given, 4.0)
    found = fdi["verdict"]
    assert (found["detected"], found["detected_at_s"], found["axis"]) == (1, 4.0, 1)
    assert (found["isolated_estimator"], found["isolated_at_s"], found["has_effectiveness"]) == (2, 4.0, 1)
    assert fdi["isolation"]["estimator"]["theta"][2] == pytest.approx([-0.3] * 3)
    assert found["effectiveness"] == pytest.approx([0.5] * 4)
    take(fdi, given, 5.0)
    assert (found["detected_at_s"], found["isolated_at_s"]) == (4.0, 4.0)
    given["isolated"] = NOT_ISOLATED
    take(fdi, given, 6.0)
    assert (found["isolated_estimator"], found["isolated_at_s"]) == (NOT_ISOLATED, 6.0)
    given["isolated"], given["theta"] = 0, -0.7  # the first is as good as any
    take(fdi, given, 7.0)
    assert fdi["isolation"]["estimator"]["theta"][0] == pytest.approx([-0.7] * 3)


@pytest.mark.parametrize(
    ("enabled", "authority", "score", "share", "statistic"),
    [
        (0, WORST_CASE_DETECTOR, 2.0, 0.7, 0.7), (1, WORST_CASE_DETECTOR, 2.0, 0.7, 0.7),
        (1, STATISTICAL_DETECTOR, 2.0, 3.0, 2.0),
        (1, EITHER, 0.6, 0.9, 0.6), (1, EITHER, 0.6, 1.1, 1.1), (1, EITHER, 2.0, 1.1, 2.0),
        (0, STATISTICAL_DETECTOR, 2.0, 0.7, 0.0),
    ],
)  # fmt: skip
def test_the_built_in_statistic(enabled, authority, score, share, statistic):
    fdi = new_fdi()
    (
        fdi["statistical"]["test"]["enabled"],
        fdi["config"]["authority"],
        fdi["statistical"]["alarm"]["ratio"],
    ) = (
        enabled,
        authority,
        score,
    )
    fdi["bank"]["output"]["threshold"][0], fdi["bank"]["output"]["residual"][0, 1] = 0.5, 0.5 * share
    likely = conclusion.weighs_statistics(fdi["statistical"]["test"], authority)
    alarm = fdi["statistical"]["alarm"]
    found = schemes.detection_share(fdi["bank"], alarm, authority, likely)
    assert found == pytest.approx(statistic)
    assert bool(likely) == (enabled == 1 and authority != WORST_CASE_DETECTOR)


def unknown_acceleration(fdi):
    """What the assessment explains by no known fault, rad/s2."""
    assessed = np.zeros(1, conclusion.assessment_dtype(4)).view(np.recarray)[0]
    stages = (fdi[name] for name in ("config", "verdict", "types", "layout", "statistical", "fdae", "bound"))
    conclusion.assess_unknown(assessed, *stages)
    return assessed["unknown_acceleration"].tolist()


def test_the_estimate_is_that_of_whoever_counts():
    fdi = new_fdi()
    (
        fdi["verdict"]["isolated_estimator"],
        fdi["isolation"]["estimator"]["surface"][5],
        fdi["layout"]["dominant_axis"][2],
    ) = 5, 2, 1
    fdi["isolation"]["estimator"]["theta"][5] = -0.1, -0.2, -0.3
    block = fdi["statistical"]["block"][0]
    block["n_h"], block["n"], block["axes"][0] = 1, 1, 1
    hypothesis = block["hypothesis"][0]
    (
        hypothesis["kind"],
        hypothesis["surface"],
        hypothesis["th"],
        hypothesis["D"],
    ) = (
        LOSS,
        2,
        -0.6,
        1.0,
    )
    assert on(conclusion.isolated_surface, fdi) == 2
    assert frame.isolated_theta(fdi, 2) == -0.2
    fdi["fdae"]["network"]["output"], block["x_known"] = 0.3, (0, 0, 0.7, 0)
    assert unknown_acceleration(fdi) == [0.0] * 3
    fdi["verdict"]["detected"] = 1
    assert unknown_acceleration(fdi) == pytest.approx([0.3] * 3)
    fdi["statistical"]["test"]["enabled"] = 1
    assert frame.isolated_theta(fdi, 2) == -0.6
    assert unknown_acceleration(fdi)[1] == 0.7
    fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"] = 2, WAIT_FOR_SURFACE
    assert unknown_acceleration(fdi) == [0.0] * 3
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    assert on(conclusion.isolated_surface, fdi) == -1


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_the_gusts_mean_is_a_share_of_what_was_summed(share):
    record = new_air(acc_sum=(0.4, -0.8, 1.2))
    gusts.finish_gust(record, share)
    assert record["output"]["acc_mean"] == pytest.approx(share * np.array([0.4, -0.8, 1.2]))


def test_a_leap_of_the_air_widens_what_a_drift_may_be():
    """By the axes of the block, so much stronger as the gusts are taken to be."""
    block = np.zeros(1, block_dtype(USUAL_SIZE.rate_size)).view(np.recarray)[0]
    record, rng = new_air(), np.random.default_rng(2)
    (
        record["output"]["var_turn"],
        block["Q_scale"],
        block["P_dd"],
    ) = (
        rng.normal(size=(3, 3)),
        1.7,
        0.3,
    )
    block["n"], block["axes"] = 2, (0, 2)
    statistical.add_axes_turn(record, block)
    assert block["P_dd"] == pytest.approx(0.3 + 1.7 * record["output"]["var_turn"][np.ix_((0, 2), (0, 2))])
