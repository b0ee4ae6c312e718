"""`beaver-ftc trim`: steady straight flight at a given condition."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, answer

if TYPE_CHECKING:
    from beaver_ftc.plant.trim import TrimPoint

_RESIDUALS = ("udot_mps2", "vdot_mps2", "wdot_mps2", "pdot_rad_s2", "qdot_rad_s2", "rdot_rad_s2")
_CONDITION = (("airspeed", "airspeed_mps", "m/s"), ("altitude", "altitude_m", "m"))
_ATTITUDE = (  # what, attribute, unit; angles in degrees
    ("angle of attack", "alpha_rad", "deg"),
    ("sideslip", "beta_rad", "deg"),
    ("pitch attitude", "theta_rad", "deg"),
    ("flight path", "gamma_rad", "deg"),
)


def command(
    scenario: Annotated[
        str | None, typer.Argument(metavar="SCENARIO", help="Take the flight condition from it.")
    ] = None,
    airspeed_mps: Annotated[float | None, typer.Option(min=1, max=1000, help="True airspeed, m/s.")] = None,
    altitude_m: Annotated[float | None, typer.Option(min=-300, max=30000, help="Altitude, m.")] = None,
    engine_rpm: Annotated[float | None, typer.Option(min=0, max=3000, help="Engine speed, rpm.")] = None,
    manifold_pressure_inhg: Annotated[
        float | None, typer.Option(min=0, max=50, help="Manifold pressure, inHg.")
    ] = None,
    flap_deg: Annotated[float | None, typer.Option(min=-6, max=60, help="Flap deflection, deg.")] = None,
    format: FormatOption = Format.text,
) -> None:
    """Print a trimmed flight condition.

    Steady straight flight, wings level; what cannot be trimmed is bad input (2). What is not given
    is the scenario's, or else its default: 45 m/s at 1828.8 m, 1800 rpm, 20 inHg, no flap.
    Engine and flap are those of an aircraft that has them.
    """
    asked = {
        "airspeed_mps": airspeed_mps,
        "altitude_m": altitude_m,
        "engine_rpm": engine_rpm,
        "manifold_pressure_inhg": manifold_pressure_inhg,
        "flap_deg": flap_deg,
    }
    from beaver_ftc.plant.conditions import trim

    point = trim(scenario, **{key: value for key, value in asked.items() if value is not None})
    residual = dict(zip(_RESIDUALS, point.residual, strict=True))
    answer(format, point.as_dict() | {"residual": residual}, lambda: _table(point))


def _table(point: "TrimPoint") -> str:
    settings = tuple((name.replace("_", " "), name, "") for name in point.settings)
    surfaces = tuple((name, f"{name}_rad", "deg") for name in point.surfaces_rad)
    shown = (*_CONDITION, *settings, *_ATTITUDE, *surfaces)
    lines = [
        f"{what:22}{_shown(getattr(point, name), unit):>12} {unit}".rstrip() for what, name, unit in shown
    ]
    lines.append(f"{'worst residual':22}{max(map(abs, point.residual)):>12.1e} m/s2 or rad/s2")
    if not point.envelope_valid:
        lines.append("outside the flight-validated envelope")
    return "\n".join(lines)


def _shown(value: float, unit: str) -> str:
    return f"{math.degrees(value):.4f}" if unit == "deg" else f"{value:g}"
