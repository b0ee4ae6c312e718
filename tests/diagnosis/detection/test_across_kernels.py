"""Directions that a surface does not move, a kernel at a time, against the same in matrices."""

import numpy as np
import pytest
from kernels import DT, fill, new_fdi

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis.detection import parity, tones
from beaver_ftc.diagnosis.detection.parity_design import configure_parity_views

AILERON, ELEVATOR, RUDDER = range(3)
PITCH_AXIS, ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER = range(5)
V = 45.0
FLOW = np.array([0.05, 0.0, V, 1200.0, 0.1])  # alpha, beta, airspeed, pressure, dpt


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def fdi(rng):
    """A diagnosis with its views, something in every place that the kernels look at, and air that moves."""
    fdi = new_fdi()
    statistical = fdi["statistical"]
    statistical["test"]["forget"], statistical["noise"]["q"] = 0.9, 2.0
    for block, n, regressors in zip(statistical["block"], (1, 2, 2), (3, 4, 4), strict=True):
        block["n_Z"], block["alarm_level"] = regressors, 5.0
        block["R_y"][:n] = rng.uniform(1e-8, 1e-7, n)
        block["columns"][:regressors] = range(regressors)
    rows = statistical["rows"]
    rows["Z"][:4, :3], rows["tol"][:4] = rng.normal(size=(4, 3)), rng.uniform(0.1, 0.2, 4)
    rows["std"], rows["eta"][:, :3] = 0.002, (0.02, 0.03, 0.05)
    configure_parity_views(statistical, load())
    tones.configure_tones(statistical["tone_test_config"], 1e-8, V, 15.0, DT)
    air = statistical["gust"]
    fill(air, gusty=1, L_roll=34.0, Q=rng.uniform(1e-5, 1e-4, 3))
    fill(air, **{name: rng.normal(size=(3, 3)) for name in ("rate_damping", "C", "C_dot", "var_turn")})
    air["output"]["var_turn"] = air["output"]["var_turn"] @ air["output"]["var_turn"].T
    rows["e_G"][:4, :3] = rng.uniform(0.1, 0.4, (4, 3))
    return fdi


def observe(fdi, innovation, G, frame):
    """Show the views a frame: innovation (3,), G (3, n)."""
    statistical = fdi["statistical"]
    rows = statistical["rows"]
    rows["nu"][:, :3], rows["G"][:4, :3], rows["Gu"][:4, :3] = innovation, G.T, 0.05 * G.T
    parity.update_views(statistical, statistical["gust"], FLOW, DT, frame, False)


@pytest.mark.parametrize(("size", "errs"), [(2.0, 1.0), (2.0, 0.0), (0.3, 1.0)])
def test_of_what_goes_along_a_column_that_may_be_turned_a_share_shows_across(fdi, size, errs):
    """The column g + e, |e| up to the tolerance of either axis: the most, by its corners, of e across over
    what is left of g + e along; where little is left, a tenth of the column is."""
    statistical = fdi["statistical"]
    view, G, innovation = statistical["views"][PAST_AILERON], np.zeros((3, 4)), np.array([0.7, 5.0, -0.4])
    G[0, AILERON], G[2, AILERON] = 0.8 * size, 0.6 * size
    statistical["rows"]["e_G"] *= errs
    observe(fdi, innovation, G, 0)
    m = view["block"]["m"][0, [0, 2]]
    along = np.array([m[1], -m[0]])
    e = statistical["rows"]["e_G"][AILERON, [0, 2]]
    corners = [e * (s, t) for s in (-1, 1) for t in (-1, 1)]
    most = max(abs(m @ c) for c in corners)
    least = max(size - max(abs(along @ c) for c in corners), parity.MIN_NORM_SHARE * size)
    shown = most / least * (along @ innovation[[0, 2]])
    assert m @ G[[0, 2], AILERON] == pytest.approx(0.0)
    assert view["block"]["regressor"][view["block"]["n_Z"] - 1, 0] == pytest.approx(shown)
    seen = statistical["rows"]["Z"][:4, [0, 2]] @ m
    assert view["block"]["regressor"][:4, 0] == pytest.approx(seen)


@pytest.mark.parametrize(
    ("surface", "blind"),
    [(AILERON, (PITCH_AXIS, PAST_AILERON)), (RUDDER, (PITCH_AXIS, PAST_RUDDER)),
     (ELEVATOR, (ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER))],
)  # fmt: skip
def test_a_fault_of_any_course_shows_nothing_where_its_surface_moves_nothing(fdi, surface, blind):
    G = np.array([[-9.0, 0.0, 1.2, 0.0], [0.0, -8.0, 0.0, -1.5], [-0.4, 0.0, -3.0, 0.0]])
    statistical, course = fdi["statistical"], np.cumsum(np.random.default_rng(surface).normal(size=20))
    statistical["n_views"], statistical["views"]["block"]["n_Z"] = 5, 0
    for k in range(20):
        observe(fdi, course[k] * G[:, surface], G, k)
    for v, view in enumerate(statistical["views"][:5]):
        felt = parity.changes_view(view, statistical["forces"], surface, G[:, surface])
        assert felt == (v not in blind)
        assert (np.abs(view["block"]["tests"]["N"]).max() > 1e-6) == felt


def test_before_a_column_is_known_a_fault_shows_where_its_surface_moves_something(fdi):
    """In the first frame a view is not turned yet; what it sees then refutes no surface that moves it."""
    statistical, G = fdi["statistical"], np.array([-9.0, 0.0, 1.2])
    views = statistical["views"]
    felt = [parity.changes_view(views[v], statistical["forces"], AILERON, G) for v in (ROLL_AXIS, PITCH_AXIS)]
    assert not statistical["rows"]["G"][AILERON].any()
    assert felt == [True, False]
