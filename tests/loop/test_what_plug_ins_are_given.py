"""Plug-ins are given every reading that ours use, with its errors."""

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.simulation import Simulation
from beaver_ftc.studies.compare.replay import Recorder
from flying import Memory, scenario

REAL = {"sensors": "tactical-grade", "fdi": {"bounds": {"sensors": "tactical-grade"}}}


def recorded(**changes):
    """What a detector is given in a flight, and the log of it."""
    recorder, log = Recorder(), Memory()
    fly(scenario(duration_s=8, **changes), log, detector=recorder)
    return recorder, log


def test_attitude_and_altitude_of_sound_instruments_are_those_flown():
    recorder, log = recorded()
    for name, column in (("phi_rad", 0), ("theta_rad", 1), ("psi_rad", 2)):
        read = np.array([measured.attitude[column] for measured, _ in recorder.seen])
        assert np.sin(read - log[name]) == pytest.approx(0.0, abs=1e-12)
    read = np.array([measured.altitude_m for measured, _ in recorder.seen])
    assert read == pytest.approx(log["altitude_m"], abs=1e-6)


def test_readings_have_the_errors_of_their_instruments():
    """As the context declares them."""
    sound, _ = recorded()
    real, log = recorded(**REAL)
    declared = real.context.declared
    assert (declared.further_noise > 0.0).all()
    read = np.array([[*m.attitude, *m.force, m.altitude_m] for m, _ in real.seen])
    for column, name in enumerate(("phi_rad", "theta_rad", None, None, None, None, "altitude_m")):
        if name is not None:
            error = read[:, column] - log[name]
            assert 0.5 < np.std(error) / declared.further_noise[column] < 2.0
    steps = (
        np.diff(read, axis=0).std(axis=0),
        np.diff([[*m.force] for m, _ in sound.seen], axis=0).std(axis=0),
    )
    assert (steps[0][3:6] > 1.2 * declared.further_noise[3:6]).all()
    assert (steps[0][3:6] > steps[1]).all()


def test_accelerometers_are_read_though_nothing_declared_asks_for_them():
    sim = Simulation(scenario(duration_s=1))
    sim.step()
    assert np.linalg.norm(sim.measured.force) == pytest.approx(9.8, abs=0.5)
