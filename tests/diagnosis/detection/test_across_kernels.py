"""Directions that a surface does not move, a kernel at a time, against the same in matrices."""

import numpy as np
import pytest
from kernels import DT, holder, new_fdi
from statistics_of import Across

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis.detection import parity
from beaver_ftc.diagnosis.detection.parity import configure_parity_views

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
