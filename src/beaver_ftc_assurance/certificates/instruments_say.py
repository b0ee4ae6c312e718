"""Evidence of an alarm of the sensor monitor: a reading differs from its prediction by other sensors by more
than sound sensors allow, or a reading is missing (docs/explanation/instruments.md).
"""

from collections.abc import Iterator, Mapping

import numpy as np

from beaver_ftc.diagnosis import SensorMonitor
from beaver_ftc.diagnosis.monitors import COMPARISON_ROUNDING, RPM_TEST
from beaver_ftc.plant import SENSORS
from beaver_ftc.results import Document
from beaver_ftc.scenario import sensor_words
from beaver_ftc_assurance.certificates.check_certificate import TESTS

BECAUSE_BETWEEN_ROWS = "instruments raised it between two rows of the log"
BECAUSE_NO_EQUATION = "a sensor raised it that no equation of the checker uses"
ROUNDING_SHARE = 1e-13  # a smaller share of a limit is rounding


def alarm_evidence(monitor: SensorMonitor, rows: Mapping[str, np.ndarray], k: int) -> Document:
    """The evidence of an alarm in row k, the first of

        the test with its comparisons        if a test failed, and its comparisons exceed their bounds
        the sensor without a reading         if no test failed, and `watch_missing` of the log has it in row k
        the reason why there is no evidence

    monitor: at the alarm. The field `looks` lists the comparisons whose sum is the residual of the test:
    [reading, prediction, largest difference with sound instruments]. The sides of a missing reading are the
    number of missing readings, 1, and the number with sound instruments, 0.
    """
    number = monitor.worst_test_index
    failed = monitor.top_ratio > 1.0
    if failed and number >= len(TESTS):
        return {"because": BECAUSE_NO_EQUATION}
    if failed:
        compared = [comparison for comparison in _comparisons(monitor) if any(comparison)]
        value = sum(reading - predicted for reading, predicted, _ in compared)
        limit = sum(bound for *_, bound in compared)
        if value < 0.0:  # the checker requires a positive sum: exchange reading and prediction
            compared = [[predicted, reading, bound] for reading, predicted, bound in compared]
            value = -value
        if value > limit:
            return {"test": TESTS[number], "looks": compared, "sides": [value, limit]}
        return {"because": BECAUSE_BETWEEN_ROWS}
    sensor = monitor.isolated_sensor_index
    if sensor < 0 or not monitor.is_reading_unused[sensor]:
        return {"because": BECAUSE_BETWEEN_ROWS}
    if "watch_missing" in rows and rows["watch_missing"][k] == sensor:
        return {"missing": [sensor], "sides": [1.0, 0.0]}
    name = sensor_words(SENSORS[sensor])
    return {"because": f"there was no reading of {name}, and no column that says so"}


def _comparisons(monitor: SensorMonitor) -> Iterator[list[float]]:
    """Comparisons [reading, prediction, largest difference with sound instruments] in the unit of the
    residual.

    The first is that of the last sample. For a filtered test, the second is [sum, 0, bound] of all samples
    before, in the filter with the largest ratio of residual to bound.
    """
    test = monitor.worst_test
    number = monitor.worst_test_index
    name = TESTS[number]  # a sensor; of other tests (rotation, density) only the residual is known
    predicted = float(monitor.predicted_reading[SENSORS.index(name)]) if name in SENSORS else 0.0
    if number >= RPM_TEST:  # the tests of the engine are not filtered
        bound = float(monitor.reading_bound[SENSORS.index(name)]) + COMPARISON_ROUNDING
        yield [predicted + test.residual, predicted, bound]
        return
    pole = int(np.argmax(np.abs(test.filtered_residual) / test.filtered_bound))
    sample_bound = float(
        monitor.sample_time_s * test.bound_per_s
        + test.bound_per_sample
        + test.gust_gain * monitor.gust_change_mps[pole]
    )
    yield [predicted + test.residual, predicted, sample_bound]
    total = test.filtered_residual[pole]
    total_bound = test.filtered_bound[pole]
    earlier = np.array([total - test.residual, total_bound - sample_bound])
    earlier[np.abs(earlier) <= ROUNDING_SHARE * np.array([abs(total), total_bound])] = 0.0
    yield [float(earlier[0]), 0.0, max(float(earlier[1]), 0.0)]
