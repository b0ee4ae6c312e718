"""The faults of the matrix and the flights they are put in."""

from typing import TYPE_CHECKING, Any, NamedTuple

from beaver_ftc.aircraft import load
from beaver_ftc.design.coefficients import SURFACES

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

TOLERANCE, SENSORS = 0.05, "tactical-grade"
AIRSPEEDS_MPS = (38.0, 45.0, 52.0)
AT_S = 12.0
DURATION_S = 30.0
OWN_AXIS = {"aileron": "p", "elevator": "q", "rudder": "r", "flap": "q"}
REFERENCE = {
    axis: [{"sine": {"amplitude_deg_s": 3, "frequency_hz": frequency_hz}}]
    for axis, frequency_hz in (("p", 0.25), ("q", 0.2), ("r", 0.15))
}
# [Zhang2005, sec. VII]
UNCERTAINTY = {
    "inertia_coupling": {"p": 0.25, "q": -0.25, "r": 0.25},
    "sinusoid": {
        axis: {"amplitude_rad_s2": 0.02, "frequency_rad_s": frequency_rad_s}
        for axis, frequency_rad_s in (("p", 10), ("q", 15), ("r", 10))
    },
}

# Name in the table, and the fault; off_deg: a jam this far off the trimmed command.
FAULTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("40 % loss", {"type": "loss_of_effectiveness", "magnitude": 0.4}),
    ("total loss", {"type": "loss_of_effectiveness", "magnitude": 1.0}),
    ("stuck +3 deg", {"type": "stuck", "off_deg": 3.0}),
    ("stuck -3 deg", {"type": "stuck", "off_deg": -3.0}),
    ("hardover +", {"type": "hardover", "direction": 1}),
    ("hardover -", {"type": "hardover", "direction": -1}),
    ("float", {"type": "float"}),
    ("bias +2 deg", {"type": "bias", "bias_deg": 2.0}),
    ("bias -2 deg", {"type": "bias", "bias_deg": -2.0}),
    ("rate limit 1.2 deg/s", {"type": "rate_limit", "scale": 0.02}),
    ("oscillation 0.5 deg, 1 rad/s", {"type": "oscillatory", "amplitude_deg": 0.5, "frequency_rad_s": 1.0}),
    ("oscillation 0.5 deg, 10 rad/s", {"type": "oscillatory", "amplitude_deg": 0.5, "frequency_rad_s": 10.0}),
    ("oscillation 2 deg, 5 rad/s", {"type": "oscillatory", "amplitude_deg": 2.0, "frequency_rad_s": 5.0}),
)


class Case(NamedTuple):
    """One cell of the matrix at one airspeed."""

    fault: str
    surface: str
    airspeed_mps: float
    declared: bool = False  # with the errors of `declared`


def cases(airspeeds_mps: tuple[float, ...] = AIRSPEEDS_MPS, declared: bool = False) -> list[Case]:
    """Every fault on every surface at every airspeed, fault by fault."""
    return [
        Case(fault, surface, V, declared)
        for fault, _ in FAULTS
        for surface in SURFACES
        for V in airspeeds_mps
    ]


def declared() -> dict[str, Any]:
    """Real sensors, servos, coefficients at the ends of their tolerance by turns: all of it declared."""
    names = [term.name for term in load().moments]
    wrong = {name: 1.0 + (TOLERANCE if i % 2 else -TOLERANCE) for i, name in enumerate(names)}
    return {
        "uncertainty": UNCERTAINTY | {"coefficients": wrong},
        "sensors": SENSORS,
        "actuators": "servo",
        "fdi": {"fault_class": "all", "bounds": {"coefficients": TOLERANCE, "sensors": SENSORS}},
    }


def scenario_of(case: Case, law: str, trimmed_deg: float) -> "Scenario":
    """The flight of a case under a law; trimmed_deg: the surface's deflection in trim."""
    from beaver_ftc.scenario.schema import Scenario

    fault = dict(dict(FAULTS)[case.fault])
    if "off_deg" in fault:
        fault["position_deg"] = trimmed_deg + fault.pop("off_deg")
    return Scenario.model_validate(
        {
            "name": "matrix",
            "duration_s": DURATION_S,
            "initial": {"airspeed_mps": case.airspeed_mps},
            "reference": REFERENCE,
            "uncertainty": UNCERTAINTY,
            "faults": [{**fault, "actuator": case.surface, "at_s": AT_S}],
            "fdi": {"fault_class": "all"},
            "control": {"law": law},
        }
        | (declared() if case.declared else {})
    )
