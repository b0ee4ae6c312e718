"""The gusts that vanes show a rival, who is given what every plug-in is given."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.studies.compare.replay import record
from flying import scenario

AIR = {"turbulence": "dryden", "severity": "light"}


def airborne(duration_s=30, environment=AIR, **sensors):
    """A flight with a perfect model."""
    bounds = {"turbulence": "light", **sensors}
    given = {"environment": environment} if environment else {}
    return record(scenario(duration_s=duration_s, uncertainty={}, fdi={"bounds": bounds}, **given, **sensors))


def unexplained(seen):
    """Acceleration that a detector cannot explain, RMS per axis after two seconds."""
    x = np.array([measured.x for measured in seen])
    predicted = np.array([measured.acceleration for measured in seen])
    return np.sqrt(np.mean((np.diff(x, axis=0) / 0.01 - predicted[1:])[200:] ** 2, axis=0))


def test_what_is_left_unexplained_is_what_is_declared_of_it():
    recording = airborne()
    gust = VaneGust(recording.context)
    shown = [measured for measured, _ in recording.seen]
    left, declared = unexplained([gust.subtracted(each) for each in shown]), gust.context.declared
    assert left[1] < 0.2 * unexplained(shown)[1]
    assert left[[0, 2]] == pytest.approx(declared.turbulence_rad_s2[[0, 2]], rel=0.35)
    assert left[1] <= 1.2 * declared.turbulence_rad_s2[1]
    assert np.array_equal(declared.gust_time_s, recording.context.declared.gust_time_s)


def test_an_airspeed_of_zero_does_not_end_the_estimate():
    recording = airborne(duration_s=1)
    gust, (measured, _) = VaneGust(recording.context), recording.seen[0]
    for V in (1, 0, 1):
        left = gust.subtracted(measured._replace(y=measured.y * [1, 1, V, 1, 1]))
    assert np.isfinite(left.acceleration).all()


def test_still_air_needs_no_vanes():
    recording = record(scenario(duration_s=1))
    gust = VaneGust(recording.context)
    assert gust.context is recording.context
    assert all(gust.subtracted(measured) is measured for measured, _ in recording.seen)
