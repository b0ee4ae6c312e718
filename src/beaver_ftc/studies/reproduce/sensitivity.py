"""Do the conclusions hang on what the paper leaves open? Every choice is changed, one at a time, and every
statement held against the flights again."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from beaver_ftc.studies.reproduce.cases import PUBLISHED, SHARPENED, fly_case
from beaver_ftc.studies.reproduce.choices import AMPLITUDE_DEG_S
from beaver_ftc.studies.reproduce.claims import CLAIMS

INTERVAL = {"fdi.thresholds": "interval"}


@dataclass(frozen=True)
class Variant:
    """What is changed, in words and as dotted scenario keys."""

    name: str
    changes: Mapping[str, Any]


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
    Variant("airspeed 42 m/s", {"initial.airspeed_mps": 42.0}),
    Variant("airspeed 48 m/s", {"initial.airspeed_mps": 48.0}),
    Variant("altitude 300 m", {"initial.altitude_m": 300.0}),
    Variant("altitude 3000 m", {"initial.altitude_m": 3000.0}),
    Variant("references half as fast", _references("sine", times=0.5)),
    Variant("references twice as fast", _references("sine", times=2.0)),
    Variant("square references, which jump themselves", _references("square")),
    Variant("uncertainty -, +, -", _couplings(-0.25, 0.25, -0.25)),
    Variant("uncertainty +, +, +", _couplings(0.25, 0.25, 0.25)),
    Variant("no inertia uncertainty", _couplings(0.0, 0.0, 0.0)),
    Variant("Kp halved, Ki to match", {"control.proportional_per_s": 1.0, "control.integral_per_s2": 0.25}),
    Variant("Kp doubled, Ki to match", {"control.proportional_per_s": 4.0, "control.integral_per_s2": 4.0}),
    Variant("no integral action", {"control.integral_per_s2": 0.0}),
    Variant("reference model 5 rad/s", {"control.reference_natural_frequency_rad_s": 5.0}),
    Variant("network gain 30 1/s2", {"control.network_gain_per_s2": 30.0}),
    Variant("network gain 120 1/s2", {"control.network_gain_per_s2": 120.0}),
    Variant("hand-over in 2 s", {"control.hand_over_s": 2.0}),
    Variant("detection pole 5 1/s", {"fdi.detection_pole_per_s": 5.0}),
    Variant("detection pole 20 1/s", {"fdi.detection_pole_per_s": 20.0}),
    Variant("isolation pole 5 1/s", {"fdi.isolation_pole_per_s": 5.0}),
    Variant("isolation pole 20 1/s", {"fdi.isolation_pole_per_s": 20.0}),
    Variant("forgetting time 20 s", {"fdi.forgetting_time_s": 20.0}),
    Variant("frame rate 50 Hz", {"rate_hz": 50.0}),
    Variant("frame rate 200 Hz", {"rate_hz": 200.0}),
    Variant("interval thresholds", INTERVAL),
    Variant("interval thresholds, 48 m/s", {**INTERVAL, "initial.airspeed_mps": 48.0}),
    Variant("interval thresholds, references twice as fast", {**INTERVAL, **_references("sine", times=2.0)}),
    Variant("sharpened estimators", SHARPENED),
)


def numbers_of(variant: Variant) -> list[float]:
    """The number of every claim, in the claims' order, with the variant's changes."""
    flights = {case.name: fly_case(case, variant.changes) for case in PUBLISHED}
    return [claim.measure(flights) for claim in CLAIMS]
