"""A flight of the published study, and what its log shows of tracking, residuals and exclusions.

Estimators are those of the isolation; each is named after the surface whose fault it fits. The time of an
event that never happens is infinite.
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.faults import place_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.reproduce.choices import FAULT_AT_S

ESTIMATORS = ("aileron", "elevator", "rudder")
AXIS = {"aileron": "p", "elevator": "q", "rudder": "r", "unanticipated": "q"}  # axis of the effect of a fault


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

    def is_excluded(self, estimator: str) -> np.ndarray:
        """Whether an isolation estimator is excluded in each frame, (frames,)."""
        return self.log[f"fie_{estimator}_excluded"] == 1

    def has(self, estimator: str) -> bool:
        """Whether the scheme has an isolation estimator: one that is left out is excluded from the first
        frame on."""
        return not self.is_excluded(estimator)[0]

    def excluded_at_s(self, estimator: str) -> float:
        """Time at which an isolation estimator was excluded, s; infinite if it was not, or if the scheme has
        no such estimator."""
        return self.first_s(self.is_excluded(estimator) & self.has(estimator))

    def of_axes(self, column: str) -> np.ndarray:
        """A column of each axis, (3, frames). column: its name, with {} for the axis."""
        return np.array([self.log[column.format(axis)] for axis in AXES])

    def shares_of(self, estimator: str) -> np.ndarray:
        """|residual| / threshold on the side of the residual, of an isolation estimator, (3, frames). All are
        0 before the estimator works, and if the scheme has no such estimator."""
        residual, lower, upper = (
            self.of_axes(f"fie_{estimator}_{{}}_{signal}_rad_s") for signal in ("residual", "lower", "upper")
        )
        return _shares(residual, np.where(residual < 0, lower, upper)) * self.has(estimator)

    def shares(self) -> np.ndarray:
        """|residual| / threshold of the detection estimator, (3, frames)."""
        return _shares(*map(self.of_axes, ("{}_residual_rad_s", "{}_threshold_rad_s")))

    def residuals_of(self, estimator: str) -> np.ndarray:
        """The residuals of an isolation estimator, (3, frames) rad/s; 0 as long as it does not work."""
        return np.nan_to_num(self.of_axes(f"fie_{estimator}_{{}}_residual_rad_s")) * self.has(estimator)

    def unexplained_rad_s2(self, axis: str) -> np.ndarray:
        """Acceleration over the frame that ends in each row, less that of the design model, (frames,) rad/s2.
        Row 0 has no frame before it: its acceleration counts as 0."""
        rate = self.log[f"{axis}_rad_s"]
        return np.diff(rate, prepend=rate[0]) / self.frame_s - self.log[f"{axis}_design_rad_s2"]

    def named_s(self, estimator: str) -> float:
        """Time after the alarm in which this was the only estimator not excluded, s."""
        others = [self.is_excluded(name) for name in ESTIMATORS if name != estimator]
        is_alone = np.all(others, axis=0) & ~self.is_excluded(estimator) & (self.log["detected"] == 1)
        return float(is_alone.sum() * self.frame_s)


def _shares(residual: np.ndarray, threshold: np.ndarray) -> np.ndarray:
    """|residual / threshold|; 0 / 0 is 0, as both start from 0, and so is NaN, before an estimator works."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(np.abs(residual / threshold), posinf=np.inf)
