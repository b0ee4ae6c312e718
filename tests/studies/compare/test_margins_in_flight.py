"""Margins measured in flight against the default law's loop in closed form; unstable loops have none."""

import numpy as np
import pytest

from beaver_ftc.control.laws.rejecting import margins
from beaver_ftc.studies.compare import margins_in_flight
from beaver_ftc.studies.compare.margins_in_flight import _measured, in_trim
from beaver_ftc.studies.margins import at
from flying import loss, scenario


@pytest.mark.parametrize("actuators", ["ideal", "servo"])
def test_margins_in_flight_are_those_of_the_loop_in_closed_form(actuators):
    """Two flights of JSBSim, and the linearised aircraft with the law's equations."""
    flown = scenario(control={"law": "fault-tolerant"}, actuators=actuators, faults=[loss("rudder", 0.5)])
    closed = {margin.surface: margin for margin in at(flown) if margin.fault == "none"}
    for measured in _measured(flown):
        expected = closed[measured.surface]
        assert measured.up_db == pytest.approx(expected.up_db, abs=0.6)
        assert measured.down_db == expected.down_db == np.inf
        assert measured.phase_deg == pytest.approx(expected.phase_deg, abs=1.5)


def test_a_law_that_is_plugged_in_is_measured_as_well():
    """Less gain, more margin; an unstable loop has none."""

    def least(deflection_deg):
        options = {"deflection_deg": deflection_deg, "integral_deg": 0.5}
        found = _measured(scenario(control={"law": "lqr", "options": options}))
        return min(margin.up_db for margin in found)

    gains_db = [least(deflection_deg) for deflection_deg in (0.3, 1.0, 3.0)]
    assert gains_db[0] > gains_db[1] > gains_db[2] > 3.0
    assert least(1e4) == 0.0


def test_what_is_flown_for_margins_has_only_the_sensors_lags():
    sensors = {
        "p": {"noise_std_deg_s": 0.1, "delay_s": 0.02, "bandwidth_rad_s": 60},
        "q": {"bias_deg_s": 0.1},
    }
    air = {"turbulence": "dryden", "severity": "light"}
    still = in_trim(scenario(sensors=sensors, faults=[loss("rudder", 0.5)], environment=air))
    assert (still.sensors.p.delay_s, still.sensors.p.bandwidth_rad_s, still.sensors.p.noise_std_deg_s) == (
        0.02,
        60,
        0,
    )
    assert still.sensors.q.is_ideal
    assert (still.faults, still.environment.severity, still.fdi.scheme) == ((), None, "none")
    assert not np.any([vars(still.reference)[axis] for axis in "pqr"])


def test_margins_of_a_loop_that_is_known():
    """A delayed integrator: positions after a pulse by its difference equation, margins in closed form."""
    dt, gain, n = 0.01, 20.0, 400
    u, x = np.zeros(n), np.zeros(n)
    pulse = np.zeros(n)
    pulse[50] = np.radians(margins_in_flight.PULSE_DEG)
    for k in range(1, n):
        x[k] = x[k - 1] + dt * (u[k - 1] + pulse[k - 1])
        u[k] = -gain * x[k]
    omega = np.geomspace(0.3, np.pi / dt, 600)
    found = margins_in_flight._margins(np.zeros(n), u + pulse, omega, dt)
    z = np.exp(1j * omega * dt)
    assert found == pytest.approx(margins(gain * dt / (z - 1.0)), rel=0.02)
    assert found[0] == pytest.approx(20 * np.log10(2.0 / (gain * dt)), abs=0.05)  # at Nyquist
    for moved in (np.zeros(n - 1), np.zeros(n), np.cumsum(pulse)):  # departed, at a stop, not decayed
        assert margins_in_flight._margins(np.zeros(n), moved, omega, dt) == (0.0, 0.0, 0.0)
