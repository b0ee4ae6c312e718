"""Air, error map, thresholds, the detector's noise of the moment and the scheme, a kernel at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import DT, fill, new_fdi
from scipy.spatial.transform import Rotation
from statistics_of import Statistical, put

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.design.model import design_record, fill_table, regressors, response
from beaver_ftc.diagnosis import bounds, gusts, model_prediction
from beaver_ftc.diagnosis.bounds import map_dtype
from beaver_ftc.diagnosis.detection import filters
from beaver_ftc.diagnosis.gusts import GUST_RECORD
from beaver_ftc.diagnosis.model_prediction import prediction_dtype

AIRCRAFT = load()
SPAN, V = 14.63, 45.0
X, U = np.array([0.1, -0.05, 0.07]), np.array([0.1, -0.15, 0.05, 0.2])
Y = np.array([0.1, 0.03, V, 1036.0, 0.3, 0.0, 0.0, 0.0])


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


def test_the_bound_of_a_true_estimator_covers_every_course_of_its_parameter():
    """By corners: theta at either end at each instant, by the sign of what it multiplies."""
    low, high = filters.residual_interval(-0.9, 0.2, 0.5, -0.3, 0.2, -0.4, 0.05)
    assert low == pytest.approx(-0.9 * 0.5 + 0.2 * -0.3 + 0.08 - 0.05)
    assert high == pytest.approx(0.2 * 0.5 + -0.9 * -0.3 + 0.08 + 0.05)
    assert filters.published_interval(-1.0, 0.0, -0.2, -0.3, 0.05) == pytest.approx((-0.19, 0.19))
    assert filters.published_interval(-1.0, 0.0, 0.2, -0.8, 0.05) == pytest.approx((-0.21, 0.21))


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
