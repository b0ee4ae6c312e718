"""The flights of the published study, further ones for comparison, and the changes of their setting.

    case      a published flight: a change of the published setting, such as a fault, by name
    setting   a change for all cases: a choice that the paper leaves open, another condition, another gain
    flown     a case in a setting, with its log and measures

Choices that the paper leaves open are changed, one in each setting, and all statements are tested again, to
show whether the conclusions depend on the choices.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.document import parse
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.faults import place_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.reproduce.choices import FAULT_AT_S, GIVEN, gains, scenario

ESTIMATORS = ("aileron", "elevator", "rudder")
AXIS = {"aileron": "p", "elevator": "q", "rudder": "r", "unanticipated": "q"}  # axis of the effect of a fault
PUBLISHED_LOSS = 0.4  # share of the effectiveness
AFTER_S = 18.0  # time that is flown after the fault
SETTLED_S = 2.0  # from the start or a fault to steady tracking: two time constants of the error


Changes = Mapping[str, Any]
"""Values by dotted key of a scenario."""


@dataclass(frozen=True)
class Changed:
    """A change of the published setting. shown_in: its place in the paper, or empty."""

    name: str
    changes: Changes
    shown_in: str = ""


_FILE = parse(Path(__file__).with_name("cases.yaml").read_text(encoding="utf-8")).data
PUBLISHED, VARIANTS = (
    tuple(Changed(name, changes, _FILE["shown_in"].get(name, "")) for name, changes in _FILE[these].items())
    for these in ("published", "variants")
)
OURS: Changes = _FILE["ours"]  # selects our default scheme and law
GAINS = tuple(  # every gain of the published scheme and law, halved and doubled
    Changed(f"{gain.key.split('.')[0]} {gain.name} {how}", {gain.key: share * gain.default})
    for gain in gains()
    for how, share in (("halved", 0.5), ("doubled", 2.0))
)
CASES = {case.name: case for case in PUBLISHED}
HEALTHY = Changed("fault-free", {})
AIRSPEEDS_MPS = (32.0, 36.0, 40.0, 43.0, 47.0, 54.0)
SIZES = (0.1, 0.2, 0.6, 0.8, 1.0)  # share of the effectiveness that a published loss takes
INSTANTS_S = (10.75, 13.0, 14.5)  # begins of the fault, at different phases of the references
SIZE, AT = "published loss", "instant of the fault"  # keys of a setting that change the faults of a case
EDGES = tuple(  # every combination of the ends and the centre of the published range on the axes
    Changed("theta " + ", ".join(f"{theta:+g}" for theta in corner),
            {"uncertainty.inertia_coupling": dict(zip(AXES, corner, strict=True))})
    for corner in product((-0.25, 0.0, 0.25), repeat=3)
)  # fmt: skip
CORNERS = tuple(  # all axes at an end of the range, or all at 0
    edge
    for edge in EDGES
    if set(map(abs, edge.changes["uncertainty.inertia_coupling"].values())) in ({0.25}, {0.0})
)
BEYOND = (
    *CORNERS,
    *(Changed(f"airspeed {v:g} m/s", {"initial.airspeed_mps": v}) for v in AIRSPEEDS_MPS),
    *(Changed(f"losses of {size:.0%}".replace("%", " %"), {SIZE: size}) for size in SIZES),
    *(Changed(f"fault at {at_s:g} s", {AT: at_s}) for at_s in INSTANTS_S),
)


@dataclass(frozen=True)
class Flown:
    """A case flown: its metrics, its log as name -> values, shape (frames,), and its scenario."""

    metrics: Metrics
    log: dict[str, np.ndarray]
    scenario: Scenario

    @property
    def fault_at_s(self) -> float:
        """Begin of the fault, s; in a healthy flight, that of the other flights."""
        return self.metrics.fault.at_s if self.metrics.fault else FAULT_AT_S

    @property
    def struck(self) -> str:
        """The surface with the first fault; `unanticipated` for a fault without a surface."""
        return place_of(self.scenario.faults[0])

    @property
    def axis(self) -> str:
        """The axis of the effect of the fault."""
        return AXIS[self.struck]

    @property
    def alarm_s(self) -> float:
        """Time of the alarm, s; infinite without an alarm."""
        return or_never(self.metrics.detection.time_s)

    @property
    def rightly_named_s(self) -> float:
        """Time at which the fault was named, s; infinite if the name at the end is wrong or missing."""
        isolation = self.metrics.isolation
        return or_never(isolation.time_s if isolation.correct else None)

    def mode_at_s(self, mode: str) -> float:
        """Time at which the supervisor first enters a mode, s; infinite if it never does."""
        return next((change.time_s for change in self.metrics.supervisor if change.mode == mode), np.inf)

    @property
    def frame_s(self) -> float:
        """Length of a frame, s."""
        return float(self.log["t_s"][1] - self.log["t_s"][0])

    def error_deg_s(self, axis: str) -> np.ndarray:
        """Tracking error of an axis, deg/s."""
        return np.degrees(self.log[f"{axis}_model_rad_s"] - self.log[f"{axis}_rad_s"])

    def rms_deg_s(self, axis: str, start_s: float, end_s: float = np.inf) -> float:
        """RMS tracking error of an axis from start_s to end_s, deg/s; infinite if the flight has no frame in
        this span."""
        error = self.error_deg_s(axis)[self.between(start_s, end_s)]
        return float(np.sqrt(np.mean(error**2))) if error.size else np.inf

    def kept_deg_s(self, axis: str, start_s: float) -> float:
        """RMS tracking error of an axis from start_s on, deg/s; infinite if the aircraft is lost."""
        return np.inf if self.metrics.departure else self.rms_deg_s(axis, start_s)

    def first_s(self, holds: np.ndarray) -> float:
        """The first instant at which something (frames,) holds, s; infinite if it never does."""
        return float(self.log["t_s"][np.argmax(holds)]) if holds.any() else np.inf

    def first_beyond_s(self, shares: np.ndarray) -> float:
        """The first instant at which any of these shares (3, frames) exceeds 1, s; infinite if none does."""
        return self.first_s(shares.max(axis=0) > 1.0)

    def between(self, start_s: float, end_s: float = np.inf) -> np.ndarray:
        """Whether each frame lies in a span of time, (frames,): start_s <= t < end_s."""
        return (self.log["t_s"] >= start_s) & (self.log["t_s"] < end_s)

    def excluded_at_s(self, estimator: str) -> float:
        """Time at which an isolation estimator was excluded, s; infinite if it was not, or if the scheme has
        no such estimator."""
        return self.first_s((self.log[f"fie_{estimator}_excluded"] == 1) & self.has(estimator))

    def has(self, estimator: str) -> bool:
        """Whether the scheme has an isolation estimator: one that is left out is excluded from the first
        frame on."""
        return bool(self.log[f"fie_{estimator}_excluded"][0] != 1)

    def shares_of(self, estimator: str) -> np.ndarray:
        """|residual| / threshold on the side of the residual, of an isolation estimator, (3, frames); 0 / 0
        is 0. All are 0 before the estimator works, and if the scheme has no such estimator."""
        residual, lower, upper = (
            np.array([self.log[f"fie_{estimator}_{axis}_{signal}_rad_s"] for axis in AXES])
            for signal in ("residual", "lower", "upper")
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(residual / np.where(residual < 0, lower, upper))
        return np.nan_to_num(np.where(residual == 0, 0.0, ratio), posinf=np.inf) * self.has(estimator)

    def shares(self) -> np.ndarray:
        """|residual| / threshold of the detection estimator, (3, frames); 0 / 0 is 0, as both start from
        0."""
        residual, threshold = (
            np.array([self.log[f"{axis}_{signal}_rad_s"] for axis in AXES])
            for signal in ("residual", "threshold")
        )
        return np.abs(residual) / np.where(residual == 0, 1.0, threshold)

    def residuals_of(self, estimator: str) -> np.ndarray:
        """The residuals of an isolation estimator, (3, frames) rad/s; 0 as long as it does not work."""
        residuals = [self.log[f"fie_{estimator}_{axis}_residual_rad_s"] for axis in AXES]
        return np.nan_to_num(residuals) * self.has(estimator)

    def unexplained_rad_s2(self, axis: str) -> np.ndarray:
        """Acceleration over the frame that ends in each row, less that of the design model, (frames,) rad/s2.
        Row 0 has no frame before it: its acceleration counts as 0."""
        rate = self.log[f"{axis}_rad_s"]
        return np.diff(rate, prepend=rate[0]) / self.frame_s - self.log[f"{axis}_design_rad_s2"]

    def named_s(self, estimator: str) -> float:
        """Time after the alarm in which this was the only estimator not excluded, s."""
        others = [self.log[f"fie_{name}_excluded"] == 1 for name in ESTIMATORS if name != estimator]
        is_alone = np.all(others, axis=0) & (self.log[f"fie_{estimator}_excluded"] != 1)
        is_alone &= self.log["detected"] == 1
        return float(is_alone.sum() * self.frame_s)


def fly_case(case: Changed, changes: Changes | None = None) -> Flown:
    """Fly a case in a setting. changes: of the setting."""
    return _fly(case.name, keys_of(case, changes or {}))


def keys_of(case: Changed, changes: Changes) -> Document:
    """The keys of the scenario of a case in a setting. Cases with the same keys are the same flight.

    A setting may change the size of the published loss, and the begin of the fault. AFTER_S are flown after
    it.
    """
    keys = _without_unused({**case.changes, **changes})
    size = keys.pop(SIZE, PUBLISHED_LOSS)
    at_s = keys.pop(AT, FAULT_AT_S)
    keys["duration_s"] = AFTER_S + at_s
    if "faults" in keys:
        keys["faults"] = [_struck(fault, size, at_s) for fault in keys["faults"]]
    return keys


def _struck(fault: Changes, size: float, at_s: float) -> Document:
    """A fault that begins at `at_s`; the published loss has this size."""
    changed = {"magnitude": size} if fault.get("magnitude") == PUBLISHED_LOSS else {}
    return {**fault, **changed, "at_s": at_s}


def _fly(name: str, keys: Changes) -> Flown:
    """Fly the published setting with these keys."""
    log = Columns()
    flight = fly(scenario(name, keys), log)
    return Flown(measure(flight), log, flight.scenario)


class LazyFlights(dict[str, Flown]):
    """The published cases in a setting, by name. A case is flown when it is first used.

    flown: flights of all settings by their keys, so that a flight that two settings share is flown once.
    """

    def __init__(self, changes: Changes, flown: dict[str, Flown]) -> None:
        super().__init__()
        self._changes = changes
        self._flown = flown

    def __missing__(self, name: str) -> Flown:
        keys = keys_of(CASES[name], self._changes)
        key = repr(sorted(keys.items()))
        if key not in self._flown:
            self._flown[key] = _fly(name, keys)
        return self._flown[key]


def _without_unused(changes: Changes) -> Document:
    """The changes, without options of the published scheme or law if the changes select another one."""
    unused = [
        f"{options}."
        for chosen, options in (("fdi.scheme", "fdi.options"), ("control.law", "control.options"))
        if changes.get(chosen, GIVEN[chosen]) != GIVEN[chosen]
    ]
    return {key: value for key, value in changes.items() if not key.startswith(tuple(unused))}
