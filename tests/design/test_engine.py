"""dpt from the engine's instruments: against the truth's formula; its error bound against random errors."""

import numpy as np
import pytest

from beaver_ftc.design.model import engine_power_kw, measured_slipstream, power_error_kw, slipstream
from beaver_ftc.diagnosis.bounds import slipstream_bound
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.scenario.schema import load

RNG = np.random.default_rng(5)
TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


def test_readings_without_errors_give_the_truths_dpt():
    for rpm, inhg, V, rho in RNG.uniform([1000, 15, 30, 0.9], [2300, 30, 60, 1.225], (50, 4)):
        expected = slipstream(engine_power_kw(rpm, inhg, rho), rho, V)
        assert measured_slipstream(rpm, inhg, V, 0.5 * rho * V**2) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("grade", ["tactical-grade", "consumer-grade"])
def test_no_admitted_error_of_the_readings_is_beyond_the_bound(grade):
    scenario = load({"name": "x", "fdi": {"bounds": {"sensors": grade}}})
    declared_errors = configure_design(scenario, TRAVEL_RAD)["fdi"]["bound"]["declared_errors"][0].view(
        np.recarray
    )
    at_most = [
        4.0 * noise + abs(bias) + quantum / 2
        for noise, bias, quantum in (
            getattr(scenario.fdi.bounds.sensors, name).noise_bias_quantum
            for name in ("engine_rpm", "manifold_pressure", "V", "qdyn")
        )
    ]
    largest = 0.0
    for _ in range(3000):
        inhg, V, rho = RNG.uniform([15, 35, 0.9], [36, 55, 1.2])
        true = np.array([1800.0, inhg, V, 0.5 * rho * V**2])
        off = np.array(at_most) * RNG.choice([-1.0, 1.0], 4)
        reading = true + off
        y = np.zeros(8)
        y[2:5] = reading[2], reading[3], measured_slipstream(*reading)
        error = abs(y[4] - measured_slipstream(*true))
        largest = max(largest, error / slipstream_bound(declared_errors, y))
    assert 0.3 < largest <= 1.0


@pytest.mark.parametrize(
    ("rpm", "inhg", "rpm_error", "inhg_error"), RNG.uniform([1500, 18, 1, 0.05], [2300, 30, 60, 1], (6, 4))
)
def test_the_power_is_off_by_no_more_than_at_the_corners_of_the_errors(rpm, inhg, rpm_error, inhg_error):
    """Power is bilinear in speed and pressure; of the density its slope is linear in the speed."""

    def apart(rho):
        here = engine_power_kw(rpm, inhg, rho)
        corners = [(a, b) for a in (-1, 1) for b in (-1, 1)]
        return max(
            abs(engine_power_kw(rpm + a * rpm_error, inhg + b * inhg_error, rho) - here) for a, b in corners
        )

    by_instruments, by_air = power_error_kw(rpm, inhg, rpm_error, inhg_error)
    worst = max(apart(rho) for rho in (0.7, 1.0, 1.225))
    assert worst <= by_instruments * (1.0 + 1e-9)
    assert by_instruments < 1.1 * worst + 0.0965 * 0.7355 * 2.0 * rpm_error
    thin, thick = (
        max(engine_power_kw(rpm + a * rpm_error, inhg, rho) for a in (-1, 1)) for rho in (1e-9, 1.225)
    )
    assert abs(thin - thick) <= by_air * (1.0 + 1e-9)
