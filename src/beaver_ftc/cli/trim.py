"""`beaver-ftc trim`: a trimmed flight condition."""

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli import Format, FormatOption, answer

if TYPE_CHECKING:
    from beaver_ftc.plant.trim import TrimPoint

_RESIDUALS = ("udot_mps2", "vdot_mps2", "wdot_mps2", "pdot_rad_s2", "qdot_rad_s2", "rdot_rad_s2")
_CONDITION = (("airspeed", "airspeed_mps", "m/s"), ("altitude", "altitude_m", "m"))
_ATTITUDE = (  # name in the table, attribute of the trim point in rad, printed unit
    ("angle of attack", "alpha_rad", "deg"),
    ("sideslip", "beta_rad", "deg"),
    ("pitch attitude", "theta_rad", "deg"),
    ("flight path", "gamma_rad", "deg"),
)

ConditionOf = Annotated[str | None, typer.Argument(metavar="SCENARIO")]


@dataclass(frozen=True)
class Condition:
    """The arguments of `command`. All but `scenario` and `format` are keys of a scenario's `initial`."""

    scenario: ConditionOf = None
    airspeed_mps: Annotated[float | None, typer.Option(min=1, max=1000)] = None
    altitude_m: Annotated[float | None, typer.Option(min=-300, max=30000)] = None
    engine_rpm: Annotated[float | None, typer.Option(min=0, max=3000)] = None
    manifold_pressure_inhg: Annotated[float | None, typer.Option(min=0, max=50)] = None
    flap_deg: Annotated[float | None, typer.Option(min=-6, max=60)] = None
    format: FormatOption = Format.text


def command(condition: Condition) -> None:
    """Print a trimmed flight condition.

    The flight is steady and straight, with wings level. If you leave out an option, the value of the scenario
    is used. Without SCENARIO the default values are 45 m/s, 1828.8 m, 1800 rpm, 20 inHg and flap 0 deg. The
    options for engine and flap apply only to an aircraft with these parts. If no trim exists, the exit status
    is 2.

    Examples:
      beaver-ftc trim --airspeed-mps 40 --altitude-m 1000

    scenario: Scenario file or built-in name from which the flight condition is read.
    airspeed_mps: True airspeed, m/s.
    altitude_m: Altitude above sea level, m.
    engine_rpm: Engine speed, rpm.
    manifold_pressure_inhg: Manifold pressure, inHg.
    flap_deg: Flap deflection, deg.
    """
    from beaver_ftc.plant import conditions

    given = asdict(condition)
    name, format = given.pop("scenario"), given.pop("format")
    point = conditions.trim(name, **{key: value for key, value in given.items() if value is not None})
    residual = dict(zip(_RESIDUALS, point.residual, strict=True))
    answer(format, point.as_dict() | {"residual": residual}, lambda: _table(point))


def _table(point: "TrimPoint") -> str:
    """The trimmed condition as text, a line for each quantity."""
    settings = tuple((name.replace("_", " "), name, "") for name in point.settings)
    surfaces = tuple((name, f"{name}_rad", "deg") for name in point.surfaces_rad)
    shown = (*_CONDITION, *settings, *_ATTITUDE, *surfaces)
    lines = []
    for what, name, unit in shown:
        value = getattr(point, name)
        text = f"{math.degrees(value):.4f}" if unit == "deg" else f"{value:g}"
        lines.append(f"{what:22}{text:>12} {unit}".rstrip())
    lines.append(f"{'worst residual':22}{max(map(abs, point.residual)):>12.1e} m/s2 or rad/s2")
    if not point.envelope_valid:
        lines.append("outside the flight-validated envelope")
    return "\n".join(lines)
