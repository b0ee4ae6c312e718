"""What is said of the instruments, as the monitor goes on."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.monitors.redundancy import (
    SENSOR_MONITOR_RECORD,
    UNANTICIPATED_DELAY_S,
    sensor_monitor_finding,
)
from beaver_ftc.plant.instruments import SENSORS
from beaver_ftc.scenario.sensors import sensor_words


@pytest.fixture
def monitor():
    record = np.zeros(1, SENSOR_MONITOR_RECORD)[0]
    said = record["output"]
    said["alarmed"], said["alarmed_at_s"], said["isolated_sensor"] = 1, 4.0, -1
    said["suspect"][[0, 2]] = 1
    return record


def test_nothing_is_said_without_an_alarm(monitor):
    monitor["output"]["alarmed"] = 0
    assert sensor_monitor_finding(monitor, 4.5) is None


@pytest.mark.parametrize("t_s", [4.0, 4.5, 4.0 + UNANTICIPATED_DELAY_S])
def test_until_the_wait_is_over_the_suspects_are_candidates(monitor, t_s):
    said = sensor_monitor_finding(monitor, t_s)
    assert said["candidates"] == (sensor_words(SENSORS[0]), sensor_words(SENSORS[2]))
    assert (said["detection_time_s"], said["isolation_time_s"], said["isolated"]) == (4.0, None, None)


def test_what_cannot_be_named_by_then_is_unanticipated(monitor):
    said = sensor_monitor_finding(monitor, 4.01 + UNANTICIPATED_DELAY_S)
    assert said["isolated"] == said["isolation_type"] == "unanticipated"
    assert said["isolation_time_s"] == 4.0 + UNANTICIPATED_DELAY_S
    assert said["candidates"] == ()


@pytest.mark.parametrize("named", [0, 1])
def test_the_instrument_that_is_named_is_said_with_its_instant(monitor, named):
    monitor["output"]["isolated_sensor"], monitor["output"]["isolated_at_s"] = named, 4.25
    said = sensor_monitor_finding(monitor, 9.0)
    assert (said["isolated"], said["isolation_time_s"]) == (sensor_words(SENSORS[named]), 4.25)
    assert said["isolation_type"] is None
