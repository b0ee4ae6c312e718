"""The converted model against the specification: coefficients, masses, trim, modes, flights."""

from math import exp, radians

import numpy as np
import pytest
from tools.gtm import flights
from tools.gtm.flights import ADAMS_BASHFORTH, FINE_S, MOTION
from tools.gtm.specification import SURFACES, Specification

from beaver_ftc_aircraft.gtm.steady import Condition

SPAN = 1e-9  # of each coefficient's span
AFT = np.array([-12.0, 12.0, -12.0])  # JSBSim's structural frame


def test_the_given_points(where, bench):
    """Of each 10 digits are given."""
    given, found = flights.at_the_given_points(bench, where)
    assert len(given) == 60
    assert (np.abs(found - given) <= SPAN * np.ptp(given, axis=0)).all()


@pytest.mark.parametrize("seed", range(4))
def test_random_points_inside_and_beyond_the_tables(bench, specified, seed):
    """Angles and deflections beyond the ends, every case, surfaces at zero, equal and unequal."""
    rng = np.random.default_rng(seed)
    for k in range(40):
        alpha, beta = radians(rng.uniform(-90, 150)), radians(rng.uniform(-88, 88))
        deg = {name: rng.choice([0.0, 5.0, rng.uniform(-35, 35)]) for name in SURFACES}
        deg["STAB"] = rng.choice([0.0, rng.uniform(-12, 4)])
        case, gear, V = k % 7, bool(k % 2), rng.uniform(60, 250)
        rates = rng.choice([0.0, 1.0], 3) * rng.normal(0, [2.0, 1.0, 1.0])
        found = flights.coefficients(bench, alpha, beta, V, rates, deg, case, float(gear))
        wanted = specified.coefficients(alpha, beta, V, rates, deg, case, gear)
        assert np.abs(found - wanted).max() <= 1e-9 * (1.0 + np.abs(wanted).max()), (case, deg)


@pytest.mark.parametrize("case", range(7))
def test_mass_properties_of_each_case(bench, specified, case):
    weight, cg, inertia = specified.mass(case)
    found = flights.masses(bench, case)
    wanted = [*np.diag(inertia), *(-inertia[i, j] for i, j in ((0, 1), (0, 2), (1, 2)))]
    assert found[0] == pytest.approx(weight, rel=1e-6)
    assert found[1:4] == pytest.approx(cg * AFT / 12.0, rel=1e-6)
    np.testing.assert_allclose(np.abs(found[4:]), np.abs(wanted), atol=1e-6)


def test_trim_at_the_check_point(where, bench, specified):
    """Surfaces to the digits given; speed and throttle where the weight is that of JSBSim's Earth."""
    here = bench.steady(Condition(alpha_deg=3.0))
    assert round(here.elevator_deg, 3) == 2.415
    assert round(here.aileron_deg, 3) == -0.394
    assert round(here.rudder_deg, 3) == 0.004
    there = flights.specified_trim(specified, Condition(alpha_deg=3.0), here)
    assert round(there.throttle_percent, 2) == 39.84
    assert [round(there.velocity_fps[i], 3) for i in (0, 2)] == [163.917, 8.591]
    assert here.throttle_percent == pytest.approx(39.84, abs=0.06)


@pytest.fixture(scope="module")
def heavy(where, bench, specified):
    """The specification with what JSBSim's Earth leaves of gravity."""
    return Specification(where, flights.gravity_of(bench, specified))


@pytest.mark.parametrize("case", range(1, 7))
def test_velocities_are_continuous_through_damage_and_what_follows_is_the_same(bench, heavy, case):
    """From a state with rates and sideslip, half a second before the damage and half a second after."""
    steady = flights.specified_trim(heavy, Condition(alpha_deg=3.0), bench.steady(Condition(alpha_deg=3.0)))
    commands = flights.of_steady(steady)
    commands.surfaces["FLAPLOB"] = 5.0
    flight = flights.Manoeuvre(
        "damage", np.array([160.0, 3.0, 9.0, 0.1, -0.05, 0.06, 0.3, 0.08, 1.5, 800.0]), lambda t: commands,
        1.0, case, 0.5,
    )  # fmt: skip
    one, other = flight.by_specification(heavy), flight.by_jsbsim(bench, FINE_S, ADAMS_BASHFORTH)
    assert (flights.largest(one, other)[MOTION] < 0.01).all()
    jump = np.abs(np.diff(other[:, MOTION], axis=0)).max(axis=0)
    assert (jump < [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]).all()


@pytest.mark.parametrize(
    ("dt", "between_samples_s"), [(0.001, 0.005), (0.002, 0.006), (0.005, 0.005), (0.01, 0.01)]
)
def test_the_servo_is_late_by_15_ms_and_follows_at_5_hz(bench, dt, between_samples_s):
    """A ramp slower than the rate limit: late by the delay and the lag, whatever the frame."""
    fdm, rate = bench.fdm, 0.2
    bench.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    fdm.set_dt(dt)
    for k in range(1, round(0.4 / dt) + 1):
        fdm["fcs/right_aileron-cmd-rad"] = rate * k * dt
        fdm.run()
    late_s = 0.4 - fdm["fcs/right_aileron-pos-rad"] / rate
    fdm["fcs/right_aileron-cmd-rad"] = 0.0
    pole = exp(-2 * np.pi * 5 * dt)
    assert late_s == pytest.approx(0.015 + dt * pole / (1 - pole), abs=2e-4)
    assert fdm["fcs/delay/spacing-s"] == pytest.approx(between_samples_s)


def test_the_servo_is_no_faster_than_300_degrees_a_second(bench):
    fdm, dt = bench.fdm, 0.001
    bench.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    fdm.set_dt(dt)
    fdm["fcs/right_aileron-cmd-rad"] = 0.3
    stood = []
    for _ in range(60):
        fdm.run()
        stood.append(fdm["fcs/right_aileron-pos-rad"])
    fdm["fcs/right_aileron-cmd-rad"] = 0.0
    assert np.diff(stood).max() == pytest.approx(radians(300.0) * dt)


@pytest.mark.parametrize("dt", [0.002, 0.01])
def test_the_spool_dips_and_settles(bench, specified, dt):
    """A step of throttle against the exponential of the spool's matrix; thrust first falls."""
    fdm = bench.fdm
    fdm["fcs/throttle-cmd-norm"] = 0.3
    bench.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    spool = specified.of["engines"]["spool"]
    A, x = np.array(spool["A"]), np.array([0.0, 30.0 / 0.7314])
    fdm.set_dt(dt)
    found = []
    fdm["fcs/throttle-cmd-norm"] = 0.5
    for _ in range(round(1.0 / dt)):
        fdm.run()
        found.append(fdm["fcs/left_engine-lagged-percent"])
    settle = np.array([0.0, 50.0 / 0.7314])
    values, vectors = np.linalg.eig(A)
    after = len(found) - 1  # the first frame only takes the throttle
    grown = (vectors @ np.diag(np.exp(values * after * dt)) @ np.linalg.inv(vectors)).real
    fdm["fcs/throttle-cmd-norm"] = 0.0
    assert found[-1] == pytest.approx(np.array(spool["C"]) @ (settle + grown @ (x - settle)), abs=1e-6)
    assert min(found) < 29.9


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    ("failures", "percent"),
    [
        ({"effectiveness": 0.3}, 0.3 * 64.0), ({"stuck": 1.0, "stuck-at-norm": 0.22}, 22.0),
        ({"bias-norm": -0.1}, 54.0), ({"float": 1.0}, 0.0),
    ],
)  # fmt: skip
def test_an_engine_fails_like_a_surface(bench, side, failures, percent):
    """The one with the failure, not the other; the lever of its own adds to that of both."""
    fdm, other = bench.fdm, {"left": "right", "right": "left"}[side]
    usual = {name: fdm[f"failures/{side}_engine/{name}"] for name in failures}
    fdm["fcs/throttle-cmd-norm"], fdm[f"fcs/{side}_engine-cmd-norm"] = 0.6, 0.04
    for name, number in failures.items():
        fdm[f"failures/{side}_engine/{name}"] = number
    bench.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    found = [fdm[f"fcs/{of}_engine-lagged-percent"] for of in (side, other)]
    for name, number in usual.items():
        fdm[f"failures/{side}_engine/{name}"] = number
    fdm["fcs/throttle-cmd-norm"] = fdm[f"fcs/{side}_engine-cmd-norm"] = 0.0
    assert found == pytest.approx([percent, 60.0], abs=1e-6)
