"""`beaver-ftc matrix`: every fault type on every surface, beside the oracle."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from beaver_ftc.cli.inputs import TurbulenceName
from beaver_ftc.cli.output import Format, FormatOption, answer

Document = dict[str, Any]


def command(
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
    from beaver_ftc.cli.progress import progress_bar

    if pitch_lost and declared:
        raise typer.BadParameter("--pitch-lost and --declared exclude each other, allowed: one of them")
    if aircraft and (pitch_lost or declared):
        raise typer.BadParameter(
            "--pitch-lost and --declared are for the built-in aircraft, allowed: without --aircraft"
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
    from functools import partial

    from beaver_ftc.aircraft import DEFAULT
    from beaver_ftc.studies.matrix.fault_matrix import as_text, name_of, run_matrix

    run = partial(run_matrix, declared=declared, aircraft=aircraft or DEFAULT, turbulence=turbulence.value)
    return name_of(declared, turbulence), run, as_text


def _pitch_lost() -> tuple[str, Callable[..., Document], Callable[[Document], str]]:
    from beaver_ftc.studies.matrix.pitch_lost import NAME, as_text, run_pitch_lost

    return NAME, run_pitch_lost, as_text
