"""The flights of the published study, a few beside them for comparison, and what is changed in all of them.

Do the conclusions hang on what the paper leaves open? Every choice is changed, one at a time, and every
statement held against the flights again.
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
AXIS = {"aileron": "p", "elevator": "q", "rudder": "r", "unanticipated": "q"}  # where a fault shows
PUBLISHED_LOSS = 0.4  # of the effectiveness
AFTER_S = 18.0  # flown on after the fault, s
SETTLED_S = 2.0  # from rest, or from a fault, to steady tracking: four error time constants


Changes = Mapping[str, Any]
"""Values by dotted scenario key."""


@dataclass(frozen=True)
class Changed:
    """A change of the published setting, and where the paper shows it, if it does."""

    name: str
    changes: Changes
    shown_in: str = ""


_FILE = parse(Path(__file__).with_name("cases.yaml").read_text(encoding="utf-8")).data
PUBLISHED, VARIANTS = (
    tuple(Changed(name, changes, _FILE["shown_in"].get(name, "")) for name, changes in _FILE[these].items())
    for these in ("published", "variants")
)
OURS: Changes = _FILE["ours"]  # what makes the published setting our default scheme and law
GAINS = tuple(  # every gain of the published scheme and law, halved and doubled
    Changed(f"{gain.key.split('.')[0]} {gain.name} {how}", {gain.key: share * gain.default})
    for gain in gains()
    for how, share in (("halved", 0.5), ("doubled", 2.0))
)
CASES = {case.name: case for case in PUBLISHED}
HEALTHY = Changed("fault-free", {})
AIRSPEEDS_MPS = (32.0, 36.0, 40.0, 43.0, 47.0, 54.0)
SIZES = (0.1, 0.2, 0.6, 0.8, 1.0)  # share of the effectiveness that a published loss takes
INSTANTS_S = (10.75, 13.0, 14.5)  # of the fault; at each the references are elsewhere in their periods
SIZE, AT = "published loss", "instant of the fault"  # not keys of a scenario: they change its faults
EDGES = tuple(
    Changed("theta " + ", ".join(f"{theta:+g}" for theta in corner),
            {"uncertainty.inertia_coupling": dict(zip(AXES, corner, strict=True))})
    for corner in product((-0.25, 0.0, 0.25), repeat=3)
)  # fmt: skip
CORNERS = tuple(  # the uncertainty's corners, and none
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
        """When the fault strikes, s; of a healthy flight, when it would."""
        return self.metrics.fault.at_s if self.metrics.fault else FAULT_AT_S

    @property
    def struck(self) -> str:
        """The surface that the fault is of; of an unanticipated one its type."""
        return place_of(self.scenario.faults[0])

    @property
    def axis(self) -> str:
        """The axis on which the fault shows."""
        return AXIS[self.struck]

    @property
    def alarm_s(self) -> float:
        """When the alarm is raised, s; infinite if it never is."""
        return or_never(self.metrics.detection.time_s)

    @property
    def rightly_named_s(self) -> float:
        """When the fault gets its name, s; infinite if anything else is named in the end."""
        isolation = self.metrics.isolation
        return or_never(isolation.time_s if isolation.correct else None)

    def mode_at_s(self, mode: str) -> float:
        """When the supervisor first enters a mode, s; infinite if it never does."""
        return next((change.time_s for change in self.metrics.supervisor if change.mode == mode), np.inf)

    @property
    def frame_s(self) -> float:
        """Length of a frame, s."""
        return float(self.log["t_s"][1] - self.log["t_s"][0])

    def error_deg_s(self, axis: str) -> np.ndarray:
        """Tracking error of an axis, deg/s."""
        return np.degrees(self.log[f"{axis}_model_rad_s"] - self.log[f"{axis}_rad_s"])

    def rms_deg_s(self, axis: str, start_s: float, end_s: float = np.inf) -> float:
        """RMS tracking error of an axis from start_s to end_s, deg/s; infinite where the flight is over."""
        error = self.error_deg_s(axis)[self.between(start_s, end_s)]
        return float(np.sqrt(np.mean(error**2))) if error.size else np.inf

    def kept_deg_s(self, axis: str, start_s: float) -> float:
        """RMS tracking error of an axis from start_s on, deg/s; infinite if the aircraft is lost."""
        return np.inf if self.metrics.departure else self.rms_deg_s(axis, start_s)

    def first_s(self, holds: np.ndarray) -> float:
        """The first instant at which something (frames,) holds, s; infinite if it never does."""
        return float(self.log["t_s"][np.argmax(holds)]) if holds.any() else np.inf

    def first_beyond_s(self, shares: np.ndarray) -> float:
        """The first instant at which any of these shares (3, frames) exceeds 1, s."""
        return self.first_s(shares.max(axis=0) > 1.0)

    def between(self, start_s: float, end_s: float = np.inf) -> np.ndarray:
        """Whether each frame lies in a span of time, (frames,)."""
        return (self.log["t_s"] >= start_s) & (self.log["t_s"] < end_s)

    def excluded_at_s(self, estimator: str) -> float:
        """When an isolation estimator was excluded, s; infinite if it never was, or was not there at all."""
        return self.first_s((self.log[f"fie_{estimator}_excluded"] == 1) & self.has(estimator))

    def has(self, estimator: str) -> bool:
        """Whether an isolation estimator is there: one left out is excluded from the first frame on."""
        return bool(self.log[f"fie_{estimator}_excluded"][0] != 1)

    def shares_of(self, estimator: str) -> np.ndarray:
        """|residual| / threshold of an isolation estimator, on the residual's side, (3, frames)."""
        residual, lower, upper = (
            np.array([self.log[f"fie_{estimator}_{axis}_{what}_rad_s"] for axis in AXES])
            for what in ("residual", "lower", "upper")
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(residual / np.where(residual < 0, lower, upper))
        return np.nan_to_num(np.where(residual == 0, 0.0, ratio), posinf=np.inf) * self.has(estimator)

    def shares(self) -> np.ndarray:
        """|residual| / threshold of the detection estimator, (3, frames); both start from zero."""
        residual, threshold = (
            np.array([self.log[f"{axis}_{what}_rad_s"] for axis in AXES])
            for what in ("residual", "threshold")
        )
        return np.abs(residual) / np.where(residual == 0, 1.0, threshold)

    def residuals_of(self, estimator: str) -> np.ndarray:
        """The residuals of an isolation estimator, (3, frames) rad/s; zero while it is not at work."""
        residuals = [self.log[f"fie_{estimator}_{axis}_residual_rad_s"] for axis in AXES]
        return np.nan_to_num(residuals) * self.has(estimator)

    def unexplained_rad_s2(self, axis: str) -> np.ndarray:
        """The acceleration of each frame that the design model does not explain, (frames,) rad/s2."""
        rate = self.log[f"{axis}_rad_s"]
        return np.diff(rate, prepend=rate[0]) / self.frame_s - self.log[f"{axis}_design_rad_s2"]

    def named_s(self, estimator: str) -> float:
        """Time for which this was the only estimator left, s."""
        others = [self.log[f"fie_{name}_excluded"] == 1 for name in ESTIMATORS if name != estimator]
        alone = np.all(others, axis=0) & (self.log[f"fie_{estimator}_excluded"] != 1)
        alone &= self.log["detected"] == 1
        return float(alone.sum() * self.frame_s)


def fly_case(case: Changed, changes: Changes | None = None) -> Flown:
    """Fly a case, with further changes to the choices."""
    return _fly(case.name, keys_of(case, changes or {}))


def keys_of(case: Changed, changes: Changes) -> Document:
    """The dotted keys of a case with further changes: two with the same keys are the same flight."""
    merged = _apt({**case.changes, **changes})
    size = merged.pop(SIZE, PUBLISHED_LOSS)
    at_s = merged.pop(AT, FAULT_AT_S)
    faults = [fault | _struck(fault, size, at_s) for fault in merged.get("faults", [])]
    later = {"duration_s": AFTER_S + at_s} if at_s != FAULT_AT_S else {}
    return merged | ({"faults": faults} if "faults" in merged else {}) | later


def _struck(fault: Changes, size: float, at_s: float) -> Document:
    """The size and instant of a fault; a slight loss, and what is no loss, keep theirs."""
    return {"at_s": at_s} | ({"magnitude": size} if fault.get("magnitude") == PUBLISHED_LOSS else {})


def _fly(name: str, keys: Changes) -> Flown:
    log = Columns()
    flight = fly(scenario(name, keys), log)
    return Flown(measure(flight), log, flight.scenario)


class LazyFlights(dict[str, Flown]):
    """The published cases in a setting, by name, each flown when a measure asks for it. flown: the flights of
    all settings by their keys, so that a flight that two settings share is flown once."""

    def __init__(self, changes: Changes, flown: dict[str, Flown]) -> None:
        super().__init__()
        self._changes = changes
        self._flown = flown

    def __missing__(self, name: str) -> Flown:
        keys = keys_of(CASES[name], self._changes)
        known = repr(sorted(keys.items()))
        if known not in self._flown:
            self._flown[known] = _fly(name, keys)
        return self._flown[known]


def _apt(changes: Changes) -> Document:
    """The changes without options of the published scheme or law where another one flies."""
    others = [
        f"{options}."
        for chosen, options in (("fdi.scheme", "fdi.options"), ("control.law", "control.options"))
        if changes.get(chosen, GIVEN[chosen]) != GIVEN[chosen]
    ]
    return {key: value for key, value in changes.items() if not key.startswith(tuple(others))}
