"""The alarm of instruments: a reading further from what the others foretold than sound ones can be
(docs/theory.md, section 9).
"""

from collections.abc import Iterator, Mapping

import numpy as np

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


def of_alarm(watch: np.void) -> Document:
    """The test that sound instruments would have passed; why there is none where no test was failed.

    watch: of the flight's record at the alarm, of `WATCH`.
    """
    number = int(watch["output"]["furthest"])
    if watch["output"]["share"] > 1.0 and number >= N_COMPUTED:
        return {"because": NOT_COMPUTED}
    if watch["output"]["share"] > 1.0:
        looks = [look for look in _looks(watch["step"], number) if any(look)]
        value, limit = sum(z - then for z, then, _ in looks), sum(most for *_, most in looks)
        if value < 0.0:  # the other way round
            looks, value = [[then, z, most] for z, then, most in looks], -value
        if value > limit:
            return {"test": TESTS[number], "looks": looks, "sides": [value, limit]}
    named = int(watch["output"]["named"])
    if named >= 0 and watch["output"]["replaced"][named] and not watch["output"]["share"] > 1.0:
        because = f"there was no reading of {sensor_words(SENSORS[named])}, and no column that says so"
        return {"missing": [named], "because": because}
    return {"because": NOT_STATED}


def as_logged(said: Document, rows: Mapping[str, np.ndarray]) -> Document:
    """That a reading is missing, where the log says so: one, where sound instruments leave out none."""
    if rows.get("watch_missing", rows["detected"] - 2.0)[said["frame"]] != said["missing"][0]:
        return said
    return {name: value for name, value in said.items() if name != "because"} | {"sides": [1.0, 0.0]}


def _looks(step: np.void, number: int) -> Iterator[list[float]]:
    """Reading, what was foretold, and by how much sound instruments may differ: of the last look; and what
    the filter and its bound keep of those before."""
    test = step["test"][number]
    residual = float(test["residual"])
    if number >= RPM:
        told = float(step["memory"]["command"][number - RPM])
        yield [told + residual, told, float(step["memory"]["error"][ENGINE_SPEED + number - RPM]) + 1e-6]
        return
    reads = TESTS[number]
    foretold = float(step["memory"]["predicted"][SENSORS.index(reads)]) if reads in SENSORS else 0.0
    m = int(np.argmax(np.abs(test["filtered"]) / test["bound"]))
    now = float(step["config"]["h"] * test["rate"] + test["noise"] + test["air"] * step["config"]["gusts"][m])
    yield [foretold + residual, foretold, now]
    kept = np.array([test["filtered"][m] - residual, test["bound"][m] - now])
    kept[np.abs(kept) <= _LEAST * np.array([abs(test["filtered"][m]), test["bound"][m]])] = 0.0
    yield [float(kept[0]), 0.0, max(float(kept[1]), 0.0)]
