"""What is said of the instruments, as the watch over them goes on."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.monitors.sensor_records import WAIT_S, WATCH, instrument_found
from beaver_ftc.plant.instruments import SENSORS
from beaver_ftc.scenario.sensors import sensor_words


@pytest.fixture
def watch():
    record = np.zeros(1, WATCH)[0]
    said = record["output"]
    said["alarmed"], said["alarmed_at_s"], said["named"] = 1, 4.0, -1
    said["suspect"][[0, 2]] = 1
    return record


def test_nothing_is_said_without_an_alarm_or_beside_a_surfaces(watch):
    watch["output"]["beside"] = 1
    assert instrument_found(watch, 4.5) is None
    watch["output"]["beside"] = watch["output"]["alarmed"] = 0
    assert instrument_found(watch, 4.5) is None


@pytest.mark.parametrize("t_s", [4.0, 4.5, 4.0 + WAIT_S])
def test_until_the_wait_is_over_the_suspects_are_candidates(watch, t_s):
    said = instrument_found(watch, t_s)
    assert said["candidates"] == (sensor_words(SENSORS[0]), sensor_words(SENSORS[2]))
    assert (said["detection_time_s"], said["isolation_time_s"], said["isolated"]) == (4.0, None, None)


def test_what_cannot_be_named_by_then_is_unanticipated(watch):
    said = instrument_found(watch, 4.01 + WAIT_S)
    assert said["isolated"] == said["isolation_type"] == "unanticipated"
    assert said["isolation_time_s"] == 4.0 + WAIT_S
    assert said["candidates"] == ()


@pytest.mark.parametrize("named", [0, 1])
def test_the_instrument_that_is_named_is_said_with_its_instant(watch, named):
    watch["output"]["named"], watch["output"]["named_at_s"] = named, 4.25
    said = instrument_found(watch, 9.0)
    assert (said["isolated"], said["isolation_time_s"]) == (sensor_words(SENSORS[named]), 4.25)
    assert said["isolation_type"] is None
