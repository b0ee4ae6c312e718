"""dpt from the engine's instruments: against the truth's formula; its error bound against random errors."""

import numpy as np
import pytest

from beaver_ftc.design.engine import engine_power_kw, measured_slipstream, slipstream
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
