"""Surveys of faults: `beaver-ftc matrix`, each type on each surface; `power`, how likely each is found."""

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import TurbulenceName, WorkersOption
from beaver_ftc.cli.output import Document, Format, FormatOption, answer
from beaver_ftc.cli.progress import progress_bar


class GridName(StrEnum):
    """The grids there are."""

    quick = "quick"
    full = "full"


class SensorsName(StrEnum):
    """The sensors there are in a grid."""

    ideal = "ideal"
    tactical_grade = "tactical-grade"


def matrix(
    out: Annotated[
        Path,
        typer.Option(help="Folder for the results: `fault-matrix`, with what is declared, or `pitch-lost`."),
    ] = Path("runs"),
    airspeed: Annotated[
        list[float] | None, typer.Option(min=1, max=1000, help="Airspeed, m/s; once for each.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    pitch_lost: Annotated[
        bool,
        typer.Option(
            "--pitch-lost", help="Elevator and flap lost at once instead, with engine power and without."
        ),
    ] = False,
    declared: Annotated[
        bool,
        typer.Option(
            "--declared",
            help="With tactical-grade sensors, servos and 5 % wrong moment coefficients, and told so.",
        ),
    ] = False,
    turbulence: Annotated[
        TurbulenceName, typer.Option(help="Of --declared: flown, and told so.")
    ] = TurbulenceName.none,
    aircraft: Annotated[
        str | None, typer.Option(help="Built-in name, jsbsim:NAME, or ./FOLDER in the working directory.")
    ] = None,
    format: FormatOption = Format.text,
) -> None:
    """Fly every fault type on every surface.

    Says which are detected and named, and how well the rates are tracked beside the oracle's.

    With --declared also how many of the faults that a test told the fault sees are named.

    Exit status 1 if a fault is named wrongly or an alarm is false; with --pitch-lost, if engine power loses
    an aircraft that is kept without it.

    Stopped or killed, it goes on where it was with the same command.
    """
    if pitch_lost and declared:
        raise typer.BadParameter("--pitch-lost and --declared exclude each other, allowed: one of them")
    if aircraft and (pitch_lost or declared):
        raise typer.BadParameter(
            "--pitch-lost needs a flap and engine power that stand in for the elevator, --declared terms "
            "that the model lets be wrong: the built-in aircraft has these, allowed: without --aircraft"
        )
    if turbulence is not TurbulenceName.none and not declared:
        raise typer.BadParameter("--turbulence is declared or not flown, allowed: with --declared")
    name, run, as_text = _pitch_lost() if pitch_lost else _every_fault(declared, aircraft, turbulence)
    with progress_bar("faults") as progress:
        document = run(out, tuple(airspeed) if airspeed else None, workers, progress)
    folder = str(out / name)
    answer(format, document | {"folder": folder}, lambda: as_text(document) + f"\n\nresults: {folder}")
    raise typer.Exit(0 if document["passed"] else 1)


def _every_fault(
    declared: bool, aircraft: str | None, turbulence: TurbulenceName
) -> tuple[str, Callable[..., Document], Callable[[Document], str]]:
    from beaver_ftc.aircraft import DEFAULT
    from beaver_ftc.studies.matrix.fault_matrix import as_text, name_of, run_matrix

    run = partial(run_matrix, declared=declared, aircraft=aircraft or DEFAULT, turbulence=turbulence.value)
    return name_of(declared, turbulence), run, as_text


def _pitch_lost() -> tuple[str, Callable[..., Document], Callable[[Document], str]]:
    from beaver_ftc.studies.matrix.pitch_lost import NAME, as_text, run_pitch_lost

    return NAME, run_pitch_lost, as_text


def power(
    grid: Annotated[GridName, typer.Option(help="quick: a minute of CPU; full: ten or so.")] = GridName.quick,
    schemes: Annotated[
        str | None, typer.Option(help="Comma-separated schemes beside ours; all registered ones if left out.")
    ] = None,
    sensors: Annotated[
        SensorsName | None, typer.Option(help="Only with these sensors; left out: all of the grid.")
    ] = None,
    turbulence: Annotated[
        TurbulenceName | None, typer.Option(help="Only in this air; left out: all of the grid.")
    ] = None,
    rates_alone: Annotated[
        bool,
        typer.Option(
            "--rates-alone", help="Do not show plug-ins the air as our detector sees it by the vanes."
        ),
    ] = False,
    workers: WorkersOption = None,
    out: Annotated[Path, typer.Option(help="Folder for the results: `power` in it.")] = Path("runs"),
    format: FormatOption = Format.text,
) -> None:
    """Map how likely and how soon faults are detected.

    Over surface, magnitude, excitation, sensors and turbulence.

    Every scheme watches the same flights, at the alarm level that gives all the same false-alarm rate on the
    same healthy flights. Writes power.json, power.parquet, power.txt, and maps as PNG and SVG.

    Stopped or killed, it goes on where it was with the same command.
    """
    from beaver_ftc.studies.engine.workers import cores
    from beaver_ftc.studies.power.shown import NAME, as_text, run_power
    from beaver_ftc.studies.power.survey import GRIDS, contenders

    names = None if schemes is None else [name.strip() for name in schemes.split(",") if name.strip()]
    chosen = contenders(names)
    with progress_bar(f"power, {grid.value} grid") as progress:
        survey = replace(GRIDS[grid].only(sensors, turbulence), vanes=not rates_alone)
        document = run_power(out, survey, chosen, workers or cores(), progress)
    folder = str(out / NAME)
    answer(format, document | {"folder": folder}, lambda: as_text(document) + f"\n\nresults: {folder}")
