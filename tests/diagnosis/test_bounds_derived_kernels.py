"""The derived bound term by term: products of factors, each as large as its error allows, in plain Python."""

from math import prod

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import DPT_0, KW_TO_DPT, SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.diagnosis import bounds
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.scenario.schema import Scenario

AIRCRAFT = load()
TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
X, U = np.array([0.2, -0.15, 0.1]), np.array([0.1, -0.2, 0.15, 0.05])
Y = np.array([0.12, -0.06, 44.0, 1050.0, 0.4, 0.0, 0.0, 0.0])
LENGTHS = {
    "ph": AIRCRAFT.geometry.span_m / 2,
    "qh": AIRCRAFT.geometry.chord_m,
    "rh": AIRCRAFT.geometry.span_m / 2,
}


def records(seed=0, gust=0.02, deflection=0.004):
    """(admitted, design) with every error declared, at random."""
    rng = np.random.default_rng(seed)
    frame = configure_design(Scenario.model_validate({"name": "x"}), TRAVEL_RAD).view(np.recarray)[0]
    declared_errors, design = frame["fdi"]["bound"]["declared_errors"], frame["prediction"]["design"]
    declared_errors["dC"][: len(AIRCRAFT.moments)] = rng.uniform(0.001, 0.05, len(AIRCRAFT.moments))
    declared_errors["dI"] = rng.uniform(0.001, 0.1, 12)
    declared_errors["e0"] = rng.uniform(0.001, 0.01, 7) * [1, 1, 1, 1, 1, 100, 2000]
    declared_errors["e1"] = rng.uniform(0.001, 0.02, 7)
    declared_errors["wg"], declared_errors["du"] = gust, deflection
    return declared_errors, design


def furthest(declared_errors, i, reading):
    """The largest truth that reads so: |reading - truth| <= offset + slope |truth|."""
    return (abs(reading) + declared_errors["e0"][i]) / (1.0 - declared_errors["e1"][i])


def by_terms(declared_errors, design, u):
    """(bound (3,), slope per rad of surface (3, 4)) from lists of factors."""
    coupling = ("Ppq", "Pqr", "Pl", "Pn", "Qpp", "Qpr", "Qrr", "Qm", "Rpq", "Rqr", "Rl", "Rn")
    order = dict(zip(coupling, (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11), strict=True))
    largest_x = np.array([furthest(declared_errors, i, X[i]) for i in range(3)])
    far = {
        "alpha": furthest(declared_errors, 3, Y[0]),
        "beta": furthest(declared_errors, 4, Y[1]),
        "dpt": Y[4],
    }
    near = {"alpha": abs(Y[0]), "beta": abs(Y[1]), "dpt": Y[4]}
    slowest = 2.0 * Y[2] - furthest(declared_errors, 5, Y[2])
    for i, name in enumerate(("ph", "qh", "rh")):
        near[name] = LENGTHS[name] * abs(X[i]) / Y[2]
        far[name] = LENGTHS[name] * (largest_x[i] + declared_errors["wg"][i]) / slowest
    pressure, far_pressure = Y[3], furthest(declared_errors, 6, Y[3])
    moments = {"Cl": [0.0, 0.0], "Cm": [0.0, 0.0], "Cn": [0.0, 0.0]}
    per_rad = {name: np.zeros((4, 2)) for name in moments}
    for k, term in enumerate(AIRCRAFT.moments):
        arm = AIRCRAFT.geometry.wing_area_m2 * (
            AIRCRAFT.geometry.chord_m if term.coefficient == "Cm" else AIRCRAFT.geometry.span_m
        )
        size = pressure * arm * abs(term.value) * prod(near[s] ** p for s, p in term.of)
        larger = far_pressure * arm * (abs(term.value) + declared_errors["dC"][k])
        larger *= prod(far[s] ** p for s, p in term.of)
        if term.surface is not None:
            s = AIRCRAFT.surfaces.index(term.surface)
            per_rad[term.coefficient][s] += size, larger
            size, larger = size * abs(u[s]), larger * (abs(u[s]) + declared_errors["du"])
        moments[term.coefficient][0] += size
        moments[term.coefficient][1] += larger

    def slack(name, near, far):
        value = abs(design[name])
        return (value + declared_errors["dI"][order[name]]) * far - value * near

    def rates(name, i, j):
        return slack(name, abs(X[i] * X[j]), largest_x[i] * largest_x[j])

    bound = [
        slack("Pl", *moments["Cl"]) + slack("Pn", *moments["Cn"]) + rates("Ppq", 0, 1) + rates("Pqr", 1, 2),
        slack("Qm", *moments["Cm"]) + rates("Qpp", 0, 0) + rates("Qpr", 0, 2) + rates("Qrr", 2, 2),
        slack("Rl", *moments["Cl"]) + slack("Rn", *moments["Cn"]) + rates("Rpq", 0, 1) + rates("Rqr", 1, 2),
    ]
    slopes = [
        [slack("Pl", *per_rad["Cl"][s]) + slack("Pn", *per_rad["Cn"][s]) for s in range(4)],
        [slack("Qm", *per_rad["Cm"][s]) for s in range(4)],
        [slack("Rl", *per_rad["Cl"][s]) + slack("Rn", *per_rad["Cn"][s]) for s in range(4)],
    ]
    return np.array(bound), np.array(slopes)


@pytest.mark.parametrize("seed", range(3))
def test_the_bound_is_the_sum_of_what_each_product_can_grow_by(seed):
    declared_errors, design = records(seed)
    out = np.array([0.1, 0.2, 0.3])
    bounds.add_declared_bound(declared_errors, design, X, Y, U, out)
    bound, slopes = by_terms(declared_errors, design, U)
    assert out == pytest.approx(bound + np.array([0.1, 0.2, 0.3]), rel=1e-9)
    for s in range(4):
        bounds.fill_eG(declared_errors, design, s)
    assert declared_errors["eG"] == pytest.approx(slopes, rel=1e-9)
    assert slopes.max() > 0.01


def test_the_airspeed_reckoned_with_is_a_tenth_of_the_reading_at_least():
    declared_errors, _ = records()
    declared_errors["e0"][5] = 43.0
    bounds.fill_magnitudes(declared_errors, X, Y, U)
    assert declared_errors["yw"][2] == pytest.approx(4.4)


def test_an_error_is_what_the_truth_may_be_off_and_of_a_gyro_what_changes():
    declared_errors, _ = records()
    (
        declared_errors["e0"][1],
        declared_errors["e1"][1],
        declared_errors["steady"][1],
    ) = (
        0.03,
        0.1,
        0.01,
    )
    truth = (0.2 + 0.03) / 0.9
    assert bounds.reading_bound(declared_errors, 1, -0.2) == pytest.approx(truth - 0.2)
    # what is steady drops out; slope times the true rate and the rest of the offset may change
    assert bounds.n_gyro(declared_errors, 1, -0.2) == pytest.approx(0.02 + 0.1 * truth)


@pytest.mark.parametrize("dpt", [0.4, 0.05])
@pytest.mark.parametrize("engine", [0, 1])
def test_a_slipstream_worked_out_from_instruments_is_off_at_the_corner_of_their_errors(engine, dpt):
    """dpt = a + b P / (qdyn V) with the least qdyn and V, and the power in the densest air."""
    declared_errors, _ = records()
    y = Y.copy()
    y[4] = dpt
    (
        declared_errors["engine"],
        declared_errors["kw0"],
        declared_errors["kw1"],
    ) = (
        engine,
        2.0,
        150.0,
    )
    pressure = furthest(declared_errors, 6, y[3]) / y[3] - 1.0
    speed = furthest(declared_errors, 5, y[2]) / y[2] - 1.0

    def density(q, V):
        return 2.0 * q / V**2 / SEA_LEVEL_DENSITY_KG_M3

    slowest = y[2] * (1.0 - speed)
    thinner = density(y[3] * (1.0 + pressure), slowest) - density(y[3], y[2])
    more_kw = 2.0 + 150.0 * thinner
    power_kw = abs(dpt - DPT_0) * y[3] * y[2] / KW_TO_DPT
    there = KW_TO_DPT * (power_kw + more_kw) / (y[3] * (1.0 - pressure) * slowest)
    assert bounds.slipstream_bound(declared_errors, y) == pytest.approx(there - abs(dpt - DPT_0))
    bounds.fill_magnitudes(declared_errors, X, y, U)
    off = there - abs(dpt - DPT_0) if engine else 0.0
    assert declared_errors["yw"][4] == pytest.approx(dpt + off)
    assert declared_errors["ya"][4] == dpt


def test_errors_as_large_as_the_reading_leave_a_tenth_of_it():
    declared_errors, _ = records()
    declared_errors["kw0"], declared_errors["kw1"] = (
        2.0,
        0.0,
    )
    declared_errors["e1"], declared_errors["e0"] = (
        0.0,
        (0, 0, 0, 0, 0, 2.0 * Y[2], 2.0 * Y[3]),
    )
    stretch = 1.0 / (0.1 * 0.1)
    expected = stretch * KW_TO_DPT * 2.0 / (Y[3] * Y[2]) + (stretch - 1.0) * (Y[4] - DPT_0)
    assert bounds.slipstream_bound(declared_errors, Y) == pytest.approx(expected)
    declared_errors["kw0"], declared_errors["kw1"] = (
        0.0,
        1.0,
    )
    denser = (1.0 + 2.0) / 0.1**2 - 1.0
    ratio = 2.0 * Y[3] / Y[2] ** 2 / SEA_LEVEL_DENSITY_KG_M3
    expected = stretch * KW_TO_DPT * denser * ratio / (Y[3] * Y[2]) + (stretch - 1.0) * (Y[4] - DPT_0)
    assert bounds.slipstream_bound(declared_errors, Y) == pytest.approx(expected)
