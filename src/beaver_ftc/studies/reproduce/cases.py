"""The flights of the published study, a few beside them for comparison, and what is changed in all of them.

Do the conclusions hang on what the paper leaves open? Every choice is changed, one at a time, and every
statement held against the flights again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import Document, metrics
from beaver_ftc.scenario.diagnosis import DEADBEAT_PER_S
from beaver_ftc.studies.reproduce.choices import (
    AMPLITUDE_DEG_S,
    ELEVATOR_LOSS,
    FAULT_AT_S,
    UNANTICIPATED,
    scenario,
)

AXES = ("p", "q", "r")
ESTIMATORS = ("aileron", "elevator", "rudder")
NOMINAL = {"control.law": "nominal"}
SHARPENED = {"fdi.thresholds": "interval", "fdi.sharpen": "all", "fdi.pole_bank_per_s": (DEADBEAT_PER_S,)}
SETTLED_S = 2.0  # from rest, or from a fault, to steady tracking: four error time constants


@dataclass(frozen=True)
class Changed:
    """What is changed in the published setting, as dotted scenario keys, and where the paper shows it."""

    name: str
    changes: Mapping[str, Any]
    shown_in: str = ""


def _loss(actuator: str) -> list[dict[str, Any]]:
    return [{**ELEVATOR_LOSS, "actuator": actuator}]


PUBLISHED = (
    Changed("fault-free-nominal", NOMINAL, "Fig. 2a"),
    Changed("elevator-nominal", {"faults": _loss("elevator"), **NOMINAL}, "Fig. 2b"),
    Changed("elevator", {"faults": _loss("elevator")}, "Fig. 3, 4, 5"),
    Changed("unanticipated-nominal", {"faults": [UNANTICIPATED], **NOMINAL}, "Fig. 6"),
    Changed("unanticipated", {"faults": [UNANTICIPATED]}, "Fig. 7"),
    Changed("aileron", {"faults": _loss("aileron")}, "mentioned"),
    Changed("rudder", {"faults": _loss("rudder")}, "mentioned"),
)
BESIDE = (
    Changed("elevator-sharpened", {"faults": _loss("elevator"), **SHARPENED}),
    Changed("unanticipated-sharpened", {"faults": [UNANTICIPATED], **SHARPENED}),
    Changed("aileron-sharpened", {"faults": _loss("aileron"), **SHARPENED}),
    Changed("rudder-sharpened", {"faults": _loss("rudder"), **SHARPENED}),
    Changed("unanticipated-interval", {"faults": [UNANTICIPATED], "fdi.thresholds": "interval"}),
)


@dataclass(frozen=True)
class Flown:
    """A case flown: its metrics, and its log as name -> values, shape (frames,)."""

    metrics: Document
    log: dict[str, np.ndarray]

    def error_deg_s(self, axis: str) -> np.ndarray:
        """Tracking error of an axis, deg/s."""
        return np.degrees(self.log[f"{axis}_model_rad_s"] - self.log[f"{axis}_rad_s"])

    def rms_deg_s(self, axis: str, start_s: float, end_s: float = np.inf) -> float:
        """RMS tracking error of an axis from start_s to end_s, deg/s; infinite where the flight is over."""
        error = self.error_deg_s(axis)[self.between(start_s, end_s)]
        return float(np.sqrt(np.mean(error**2))) if error.size else np.inf

    def before_deg_s(self, axis: str) -> float:
        """RMS tracking error before the fault, once settled, deg/s."""
        return self.rms_deg_s(axis, SETTLED_S, FAULT_AT_S)

    def after_deg_s(self, axis: str) -> float:
        """RMS tracking error after the fault, once settled, deg/s."""
        return self.rms_deg_s(axis, FAULT_AT_S + SETTLED_S)

    def between(self, start_s: float, end_s: float = np.inf) -> np.ndarray:
        """Which frames lie in a span of time."""
        return (self.log["t_s"] >= start_s) & (self.log["t_s"] < end_s)

    def excluded_at_s(self, estimator: str) -> float:
        """When an isolation estimator was excluded, s; infinite if it never was."""
        out = np.flatnonzero(self.log[f"fie_{estimator}_excluded"] == 1)
        return float(self.log["t_s"][out[0]]) if out.size else np.inf

    def closest(self, estimator: str) -> float:
        """Largest |residual| / threshold of an isolation estimator, on the residual's side."""
        return max(np.nanmax(self._ratio(f"fie_{estimator}_{axis}")) for axis in AXES)

    def _ratio(self, stem: str) -> np.ndarray:
        residual = self.log[f"{stem}_residual_rad_s"]
        bound = np.where(residual < 0, self.log[f"{stem}_lower_rad_s"], self.log[f"{stem}_upper_rad_s"])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(residual == 0, 0.0, np.abs(residual / bound))

    def closest_before_fault(self) -> float:
        """Largest |residual| / threshold of the detection estimator before the fault."""
        healthy = self.between(self.log["t_s"][1], FAULT_AT_S)  # residual and threshold start from zero
        residual, threshold = (
            np.array([self.log[f"{axis}_{what}_rad_s"][healthy] for axis in AXES])
            for what in ("residual", "threshold")
        )
        return float(np.max(np.abs(residual / threshold)))

    def named_s(self, estimator: str) -> float:
        """For how long this was the only estimator left, s."""
        possible = np.column_stack([self.log[f"fie_{name}_excluded"] != 1 for name in ESTIMATORS])
        alone = (
            (possible.sum(axis=1) == 1)
            & possible[:, ESTIMATORS.index(estimator)]
            & (self.log["detected"] == 1)
        )
        return float(alone.sum() * (self.log["t_s"][1] - self.log["t_s"][0]))


def fly_case(case: Changed, changes: Mapping[str, Any] | None = None) -> Flown:
    """Fly a case, with further changes to the choices."""
    log = Columns()
    flight = fly(scenario(case.name, {**case.changes, **(changes or {})}), log)
    return Flown(metrics(flight), log)


INTERVAL = {"fdi.thresholds": "interval"}


def _references(kind: str, **options: Any) -> dict[str, Any]:
    frequencies = {"p": 0.25, "q": 0.2, "r": 0.15}
    return {
        f"reference.{axis}": [
            {kind: {"amplitude_deg_s": AMPLITUDE_DEG_S, "frequency_hz": hz * options.get("times", 1.0)}}
        ]
        for axis, hz in frequencies.items()
    }


def _couplings(p: float, q: float, r: float) -> dict[str, Any]:
    return {"uncertainty.inertia_coupling": {"p": p, "q": q, "r": r}}


VARIANTS = (
    Changed("airspeed 42 m/s", {"initial.airspeed_mps": 42.0}),
    Changed("airspeed 48 m/s", {"initial.airspeed_mps": 48.0}),
    Changed("altitude 300 m", {"initial.altitude_m": 300.0}),
    Changed("altitude 3000 m", {"initial.altitude_m": 3000.0}),
    Changed("references half as fast", _references("sine", times=0.5)),
    Changed("references twice as fast", _references("sine", times=2.0)),
    Changed("square references, which jump themselves", _references("square")),
    Changed("uncertainty -, +, -", _couplings(-0.25, 0.25, -0.25)),
    Changed("uncertainty +, +, +", _couplings(0.25, 0.25, 0.25)),
    Changed("no inertia uncertainty", _couplings(0.0, 0.0, 0.0)),
    Changed("Kp halved, Ki to match", {"control.proportional_per_s": 1.0, "control.integral_per_s2": 0.25}),
    Changed("Kp doubled, Ki to match", {"control.proportional_per_s": 4.0, "control.integral_per_s2": 4.0}),
    Changed("no integral action", {"control.integral_per_s2": 0.0}),
    Changed("reference model 5 rad/s", {"control.reference_natural_frequency_rad_s": 5.0}),
    Changed("network gain 30 1/s2", {"control.network_gain_per_s2": 30.0}),
    Changed("network gain 120 1/s2", {"control.network_gain_per_s2": 120.0}),
    Changed("hand-over in 2 s", {"control.hand_over_s": 2.0}),
    Changed("detection pole 5 1/s", {"fdi.detection_pole_per_s": 5.0}),
    Changed("detection pole 20 1/s", {"fdi.detection_pole_per_s": 20.0}),
    Changed("isolation pole 5 1/s", {"fdi.isolation_pole_per_s": 5.0}),
    Changed("isolation pole 20 1/s", {"fdi.isolation_pole_per_s": 20.0}),
    Changed("forgetting time 20 s", {"fdi.forgetting_time_s": 20.0}),
    Changed("frame rate 50 Hz", {"rate_hz": 50.0}),
    Changed("frame rate 200 Hz", {"rate_hz": 200.0}),
    Changed("interval thresholds", INTERVAL),
    Changed("interval thresholds, 48 m/s", {**INTERVAL, "initial.airspeed_mps": 48.0}),
    Changed("interval thresholds, references twice as fast", {**INTERVAL, **_references("sine", times=2.0)}),
    Changed("sharpened estimators", SHARPENED),
)
