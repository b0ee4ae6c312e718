"""The faults of the matrix and the flights they are put in."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from beaver_ftc.aircraft import AXES, DEFAULT, Aircraft, load
from beaver_ftc.scenario.environment import air_of

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

TOLERANCE, SENSORS = 0.05, "tactical-grade"
AIRSPEEDS_MPS = (38.0, 45.0, 52.0)
AT_S = 12.0
DURATION_S = 30.0
SPEEDS = (0.9, 1.0, 1.1)  # of another aircraft, as shares of the speed it starts with
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
    aircraft: str = DEFAULT
    turbulence: str = "none"  # flown and declared, with `declared`


def airspeeds_of(reference: str) -> tuple[float, ...]:
    """Airspeeds to fly an aircraft at, m/s."""
    if reference == DEFAULT:
        return AIRSPEEDS_MPS
    aircraft = aircraft_of(reference)
    start = aircraft.file.start.airspeed_mps or 0.5 * sum(aircraft.envelope.airspeed_mps)
    return tuple(round(share * start, 1) for share in SPEEDS)


def aircraft_of(reference: str) -> Aircraft:
    """The aircraft of that name; a folder is looked for in the working directory."""
    return load(reference, Path())


def own_axis(case: Case) -> str:
    """The axis the surface of a case turns most about: p, q or r."""
    aircraft = aircraft_of(case.aircraft)
    return AXES[aircraft.dominant_axis[aircraft.surfaces.index(case.surface)]]


def cases(
    airspeeds_mps: tuple[float, ...] = AIRSPEEDS_MPS,
    declared: bool = False,
    aircraft: str = DEFAULT,
    turbulence: str = "none",
) -> list[Case]:
    """Every fault on every surface at every airspeed, fault by fault."""
    return [
        Case(fault, surface, V, declared, aircraft, turbulence)
        for fault, _ in FAULTS
        for surface in aircraft_of(aircraft).surfaces
        for V in airspeeds_mps
    ]


def declared(turbulence: str = "none") -> dict[str, Any]:
    """Real sensors, servos, coefficients at the ends of their tolerance by turns, air: all of it declared."""
    names = [term.name for term in load().moments]
    wrong = {name: 1.0 + (TOLERANCE if i % 2 else -TOLERANCE) for i, name in enumerate(names)}
    return {
        "uncertainty": UNCERTAINTY | {"coefficients": wrong},
        "sensors": SENSORS,
        "actuators": "servo",
        "environment": air_of(turbulence),
        "fdi": {
            "fault_class": "all",
            "bounds": {"coefficients": TOLERANCE, "sensors": SENSORS, "turbulence": turbulence},
            "statistical": {},
        },
    }


def scenario_of(case: Case, law: str, trimmed_deg: float) -> "Scenario":
    """The flight of a case under a law; trimmed_deg: the surface's deflection in trim."""
    from beaver_ftc.scenario.given import load as load_scenario

    fault = dict(dict(FAULTS)[case.fault])
    if "off_deg" in fault:
        fault["position_deg"] = trimmed_deg + fault.pop("off_deg")
    return load_scenario(
        {
            "name": "matrix",
            "aircraft": case.aircraft,
            "duration_s": DURATION_S,
            "initial": {"airspeed_mps": case.airspeed_mps},
            "reference": REFERENCE,
            "uncertainty": UNCERTAINTY if case.aircraft == DEFAULT else {},
            "faults": [{**fault, "actuator": case.surface, "at_s": AT_S}],
            "fdi": {"fault_class": "all"},
            "control": {"law": law},
        }
        | (declared(case.turbulence) if case.declared else {})
    )
