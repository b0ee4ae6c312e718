"""What is one call: `trim`, `linearise`, `bench`, `reproduce`, `verify` and `detectability`."""

import math
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli.inputs import ScenarioArgument, WorkersOption
from beaver_ftc.cli.output import Format, FormatOption, answer, complain
from beaver_ftc.cli.progress import progress_bar

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

ConditionOf = Annotated[str | None, typer.Argument(metavar="SCENARIO")]


@dataclass(frozen=True)
class Condition:
    """The flight condition to trim: but for the first and the last, keys of a scenario's `initial`."""

    scenario: ConditionOf = None
    airspeed_mps: Annotated[float | None, typer.Option(min=1, max=1000)] = None
    altitude_m: Annotated[float | None, typer.Option(min=-300, max=30000)] = None
    engine_rpm: Annotated[float | None, typer.Option(min=0, max=3000)] = None
    manifold_pressure_inhg: Annotated[float | None, typer.Option(min=0, max=50)] = None
    flap_deg: Annotated[float | None, typer.Option(min=-6, max=60)] = None
    format: FormatOption = Format.text


def trim(condition: Condition) -> None:
    """Print a trimmed flight condition.

    Steady straight flight, wings level; what cannot be trimmed is bad input (2). What is not given
    is the scenario's, or else its default: 45 m/s at 1828.8 m, 1800 rpm, 20 inHg, no flap.
    Engine and flap are those of an aircraft that has them.

    Examples:
      beaver-ftc trim --airspeed-mps 40 --altitude-m 1000

    scenario: Take the flight condition from it.
    airspeed_mps: True airspeed, m/s.
    altitude_m: Altitude, m.
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


def bench(
    rounds: Annotated[int, typer.Option(min=3, max=10000)] = 60,
    no_parts: bool = False,
    format: FormatOption = Format.text,
) -> None:
    """Time the closed loop against the bare aircraft.

    Side by side, and part by part. The first time, the frame is compiled once more for each part that
    is taken out: about two minutes.

    rounds: How often everything is timed.
    no_parts: Time the whole loop only, not part by part.
    """
    from beaver_ftc.studies.bench.measure import bench, text_of

    document = bench(rounds, not no_parts, say=lambda what: complain(f"timing {what}"))
    answer(format, document, lambda: text_of(document))


def linearise(scenario: ConditionOf = None, format: FormatOption = Format.text) -> None:
    """Linearise the closed loop and print its margins.

    Over the airspeeds of the envelope. Aircraft, actuators, sensors' lag and delay, frame rate and the
    default law, broken at each surface in turn; healthy, and with losses of each surface that the law
    knows.

    And the handling qualities of the aircraft alone: short period, phugoid, Dutch roll, roll and spiral mode
    against the levels of MIL-F-8785C; of a scenario in which something breaks, also where its flight ends.

    scenario: Take sensors, actuators and law from it.
    """
    from beaver_ftc.scenario.loader import load
    from beaver_ftc.studies import handling, margins

    given = load({} if scenario is None else scenario)
    asked = given.control.gain_margin_db, given.control.phase_margin_deg
    found = margins.study(given)
    modes = handling.over_airspeeds(given)
    document = margins.as_document(found, asked) | {"handling": handling.as_rows(modes)}
    answer(format, document, lambda: f"{margins.as_text(found, asked)}\n\n{handling.as_text(modes)}")


def reproduce(
    out: Path = Path("runs"),
    workers: Annotated[int, typer.Option(min=1)] = 2,
    format: FormatOption = Format.text,
) -> None:
    """Fly the published study and judge its statements.

    Every figure, every statement with our number, the number without the mechanism it speaks of, and a
    verdict; the same cases flown by our defaults, side by side.

    Exit status 1 if a statement is not borne out and the reason is not known.

    Stopped or killed, it goes on where it was with the same command.

    out: Folder for the results: `reproduction` in it.
    workers: Processes that fly them.
    """
    from beaver_ftc.studies.reproduce.reproduction import reproduce
    from beaver_ftc.studies.reproduce.words import NAME, as_text

    with progress_bar("ablations, and changes to what the paper leaves open") as progress:
        document = reproduce(out, workers, progress)
    folder = str(out / NAME)
    answer(format, document | {"folder": folder}, lambda: as_text(document, folder, sys.stdout.isatty()))
    raise typer.Exit(0 if document["passed"] else 1)


def verify(
    hours: Annotated[float, typer.Option(min=0.0, max=1e6)] = 2.0,
    faults: Annotated[int, typer.Option(min=0, max=10_000_000)] = 200,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    workers: WorkersOption = None,
    out: Path = Path("runs/verification"),
    steps: bool = False,
    format: FormatOption = Format.text,
) -> None:
    """Fly at random inside all that is declared: what breaks?

    Counts, with exact confidence limits, broken promises: false alarms, true faults excluded, wrong
    isolations and detections later than guaranteed plus a frame, for the published and the sharpened
    scheme on the same flights. Stopped, it goes on where it was. Exit status 1 if a promise is broken.

    hours: Flight hours without a fault.
    faults: Flights with one random fault.
    seed: Of everything drawn.
    out: Folder of the flights flown; a campaign goes on from it.
    steps: Also fly every step from the published scheme on.
    """
    from beaver_ftc.studies.engine.workers import cores
    from beaver_ftc.studies.verify import Campaign, conduct, summarise, summary_text

    with progress_bar("verify") as progress:
        rows = conduct(Campaign(hours, faults, seed, steps), out, workers or cores(), progress)
    document = summarise(rows)
    answer(format, {"seed": seed, **document}, lambda: summary_text(document))
    raise typer.Exit(0 if document["kept"] else 1)


def detectability(
    scenario: ScenarioArgument,
    airspeed: Annotated[list[float] | None, typer.Option(min=1, max=1000)] = None,
    altitude: Annotated[list[float] | None, typer.Option(min=-300, max=30000)] = None,
    aircraft: str | None = None,
    surface: str | None = None,
    out: Path = Path("runs"),
    format: FormatOption = Format.text,
) -> None:
    """Survey the smallest fault that is certain to be found.

    Over speed, altitude and excitation: the smallest loss certain to be detected, and to be isolated.

    Certain: within 0.5 s and 1 s, whatever the declared uncertainty does, along the scenario's references
    scaled by 0.25 to 2; `median` where the fault strikes at half of all instants. With --surface it answers
    in a line for each place.

    And the map of isolability: which loss is told from which other surface, how small and how soon, and
    by which doublet.

    Stopped or killed, it goes on where it was with the same command.

    airspeed: Airspeed, m/s; once for each.
    altitude: Altitude above sea level, m; once for each.
    aircraft: In place of the scenario's: built-in name, jsbsim:NAME, or ./FOLDER in the working directory.
    surface: The surface to answer for.
    out: Folder for the maps, a page, CSV and JSON.
    """
    from beaver_ftc.scenario.loader import load_scenario
    from beaver_ftc.studies.detectability import (
        POINTER,
        alike,
        answers,
        engine_failures,
        geometry,
        of_engines,
        run_survey,
        survey_name,
        text,
        with_aircraft,
    )

    loaded = load_scenario(scenario)
    if aircraft is not None:
        loaded = with_aircraft(loaded, aircraft)
    known = loaded.airframe.class_of_losses
    if surface is not None and surface not in known:
        raise typer.BadParameter(f"--surface {surface!r:.60}: allowed: {', '.join(known)}")
    name = survey_name(loaded)
    with progress_bar(name) as progress:
        found = run_survey(out, loaded, airspeed or (), altitude or (), progress=progress)
    folder, rows = str(out / name), found["points"]
    if surface is None:
        pairs, failures = alike(loaded), engine_failures(loaded)
        lines = [*geometry(pairs), *of_engines(failures)]
        whole = "\n".join([text(rows, found["pairs"]), *lines, folder])
        given = found | {"alike": pairs, "folder": folder} | ({"engines": failures} if failures else {})
        answer(format, given, lambda: whole)
        return
    of = {what: [row for row in found[what] if row["fault"] == surface] for what in ("points", "pairs")}
    said = answers(loaded, of["points"])
    answer(format, found | of | {"answers": said, "folder": folder}, lambda: "\n".join([*said, POINTER]))
