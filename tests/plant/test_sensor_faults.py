"""What a broken instrument says, and when: against the words of the page on scenarios."""

import numpy as np
import pytest

from beaver_ftc.plant.faults import NEVER, SensorFaultSchedule
from beaver_ftc.plant.instruments import N_SENSORS, SENSORS, break_all, instruments_dtype
from beaver_ftc.scenario.schema import load
from beaver_ftc.scenario.sensors import QUANTITIES


def schedule_of(*faults, rate_hz=100.0):
    instruments = np.zeros(1, instruments_dtype())[0]
    given = load({"name": "x", "faults": list(faults)}).faults
    return instruments, SensorFaultSchedule(given, instruments, rate_hz)


def read(instruments, value, sensor="q"):
    """The reading of one sensor, and whether there is none."""
    signals, missing = np.full(N_SENSORS, value), np.zeros(N_SENSORS, np.int64)
    break_all(instruments, signals, missing)
    i = SENSORS.index(sensor)
    others = np.delete(signals, i)
    assert (others == value).all()
    return signals[i], bool(missing[i])


def test_each_type_does_what_it_says():
    bias, schedule = schedule_of({"sensor": "q", "type": "bias", "magnitude": 2, "at_s": 0.1, "end_s": 0.2})
    for k, expected in ((9, 0.3), (10, 0.3 + np.radians(2)), (19, 0.3 + np.radians(2)), (20, 0.3)):
        schedule.apply(k)
        assert read(bias, 0.3) == (pytest.approx(expected), False)
    scale, schedule = schedule_of({"sensor": "q", "type": "scale", "magnitude": -0.4, "at_s": 0})
    schedule.apply(0)
    assert read(scale, 0.3)[0] == pytest.approx(0.18)
    noise, schedule = schedule_of({"sensor": "q", "type": "noise", "magnitude": 2, "at_s": 0})
    schedule.apply(0)
    drawn = np.array([read(noise, 0.3)[0] for _ in range(20_000)])
    assert drawn.std() == pytest.approx(np.radians(2), rel=0.03)
    assert drawn.mean() == pytest.approx(0.3, abs=5 * np.radians(2) / np.sqrt(20_000))


@pytest.mark.parametrize("kind", ["freeze", "lost"])
def test_what_is_frozen_or_lost_stays_and_comes_back(kind):
    instruments, schedule = schedule_of({"sensor": "q", "type": kind, "at_s": 0.1, "end_s": 0.3})
    said = []
    for k in range(40):
        schedule.apply(k)
        said.append(read(instruments, float(k)))
    values, missing = zip(*said, strict=True)
    assert list(values) == [*range(10), *[10.0] * 20, *range(30, 40)]
    assert list(missing) == [kind == "lost" and 10 <= k < 30 for k in range(40)]


def test_faults_of_one_sensor_add_up():
    instruments, schedule = schedule_of(
        {"sensor": "alpha", "type": "bias", "magnitude": 1, "at_s": 0},
        {"sensor": "alpha", "type": "bias", "magnitude": 2, "at_s": 0},
        {"sensor": "alpha", "type": "scale", "magnitude": 0.5, "at_s": 0},
        {"actuator": "elevator", "type": "stuck", "at_s": 0},
    )
    schedule.apply(0)
    assert read(instruments, 0.1, "alpha")[0] == pytest.approx(0.15 + np.radians(3))


def test_it_says_when_to_come_again():
    _, schedule = schedule_of({"sensor": "V", "type": "freeze", "at_s": 0.105, "end_s": 2.0}, rate_hz=50.0)
    assert [schedule.next_change(k) for k in (0, 5, 6, 99, 100)] == [6, 6, 100, 100, NEVER]
    assert [schedule.begun(k) for k in (5, 6, 200)] == [False, True, True]


def test_an_accelerometer_s_fault_is_in_metres_a_second_squared():
    broken, schedule = schedule_of({"sensor": "az", "type": "bias", "magnitude": 2, "at_s": 0})
    schedule.apply(0)
    assert QUANTITIES["az"].si == 1.0
    assert read(broken, -9.8, "az") == (pytest.approx(-7.8), False)
