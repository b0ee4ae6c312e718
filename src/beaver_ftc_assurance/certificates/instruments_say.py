"""The alarm of instruments: a reading further from what the others predict than sound ones can be
(docs/explanation/theory.md, section 9).
"""

from collections.abc import Iterator, Mapping

import numpy as np

from beaver_ftc.diagnosis import SensorMonitor
from beaver_ftc.diagnosis.monitors import N_COMPUTED, RPM
from beaver_ftc.plant import ENGINE_SPEED, SENSORS
from beaver_ftc.scenario import sensor_words
from beaver_ftc_assurance.certificates.inequality import Document

TESTS = (
    "turning p", "turning q", "turning r", "phi", "theta", "psi", "V", "alpha", "beta", "density", "altitude",
    "engine_rpm", "manifold_pressure",
)  # fmt: skip
NOT_STATED = "instruments raised it between two rows of the log"
NOT_COMPUTED = "a sensor raised it that no equation of the diagnosis uses"
_LEAST = 1e-13  # of the limit: less is rounding


def of_alarm(monitor: SensorMonitor) -> Document:
    """The test that sound instruments would have passed; why there is none where no test was failed.

    monitor: at the alarm.
    """
    number, failed = monitor.largest_test, monitor.share > 1.0
    if failed and number >= N_COMPUTED:
        return {"because": NOT_COMPUTED}
    if failed:
        looks = [look for look in _looks(monitor) if any(look)]
        value, limit = sum(z - then for z, then, _ in looks), sum(most for *_, most in looks)
        if value < 0.0:  # the other way round
            looks, value = [[then, z, most] for z, then, most in looks], -value
        if value > limit:
            return {"test": TESTS[number], "looks": looks, "sides": [value, limit]}
    named = monitor.named
    if named >= 0 and monitor.replaced[named] and not failed:
        because = f"there was no reading of {sensor_words(SENSORS[named])}, and no column that says so"
        return {"missing": [named], "because": because}
    return {"because": NOT_STATED}


def as_logged(said: Document, rows: Mapping[str, np.ndarray]) -> Document:
    """That a reading is missing, where the log says so: one, where sound instruments leave out none."""
    if rows.get("watch_missing", rows["detected"] - 2.0)[said["frame"]] != said["missing"][0]:
        return said
    return {name: value for name, value in said.items() if name != "because"} | {"sides": [1.0, 0.0]}


def _looks(monitor: SensorMonitor) -> Iterator[list[float]]:
    """Reading, its prediction, and by how much sound instruments may differ: of the last look; and what the
    filter and its bound keep of those before."""
    test, number = monitor.test, monitor.largest_test
    if number >= RPM:
        predicted = float(monitor.engine[number - RPM])
        within = float(monitor.error[ENGINE_SPEED + number - RPM]) + 1e-6
        yield [predicted + test.residual, predicted, within]
        return
    reads = TESTS[number]
    predicted = float(monitor.predicted[SENSORS.index(reads)]) if reads in SENSORS else 0.0
    m = int(np.argmax(np.abs(test.filtered) / test.bound))
    now = float(monitor.step_s * test.rate + test.noise + test.air * monitor.gusts[m])
    yield [predicted + test.residual, predicted, now]
    kept = np.array([test.filtered[m] - test.residual, test.bound[m] - now])
    kept[np.abs(kept) <= _LEAST * np.array([abs(test.filtered[m]), test.bound[m]])] = 0.0
    yield [float(kept[0]), 0.0, max(float(kept[1]), 0.0)]
