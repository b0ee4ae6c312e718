"""Surveys of faults: `beaver-ftc matrix`, each type on each surface; `power`, how likely each is found;
`smallest`, how small a loss of one surface is found in time."""

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import ScenarioArgument, TurbulenceName, WorkersOption, listed
from beaver_ftc.cli.output import Format, FormatOption, answer, complain
from beaver_ftc.cli.progress import progress_bar

GridName = StrEnum("GridName", ["quick", "full"])
SensorsName = StrEnum("SensorsName", {"ideal": "ideal", "tactical_grade": "tactical-grade"})


def matrix(
    out: Path = Path("runs"),
    airspeed: Annotated[list[float] | None, typer.Option(min=1, max=1000)] = None,
    workers: Annotated[int, typer.Option(min=1)] = 1,
    pitch_lost: bool = False,
    declared: bool = False,
    turbulence: TurbulenceName = TurbulenceName.none,
    aircraft: str | None = None,
    format: FormatOption = Format.text,
) -> None:
    """Fly every fault type on every surface.

    Says which are detected and named, and how well the rates are tracked beside the oracle's.

    With --declared also how many of the faults that a test told the fault sees are named.

    Exit status 1 if a fault is named wrongly or an alarm is false; with --pitch-lost, if engine power loses
    an aircraft that is kept without it.

    Stopped or killed, it goes on where it was with the same command.

    out: Folder for the results: `fault-matrix`, with what is declared, or `pitch-lost`.
    airspeed: Airspeed, m/s; once for each.
    workers: Processes.
    pitch_lost: Elevator and flap lost at once instead, with engine power and without.
    declared: With tactical-grade sensors, servos and, where the model lets them be, 5 % wrong moment
      coefficients, and told so.
    turbulence: Of --declared: flown, and told so.
    aircraft: Built-in name, jsbsim:NAME, or ./FOLDER in the working directory.
    """
    if pitch_lost and declared:
        raise typer.BadParameter("--pitch-lost and --declared exclude each other, allowed: one of them")
    if aircraft and pitch_lost:
        raise typer.BadParameter(
            "--pitch-lost needs a flap and engine power in place of the elevator: the built-in aircraft "
            "has these, allowed: without --aircraft"
        )
    if turbulence is not TurbulenceName.none and not declared:
        raise typer.BadParameter("--turbulence is declared or not flown, allowed: with --declared")
    from beaver_ftc.aircraft import DEFAULT
    from beaver_ftc.studies.matrix import fault_matrix
    from beaver_ftc.studies.matrix import pitch_lost as lost

    speeds_mps = tuple(airspeed) if airspeed else None
    with progress_bar("faults flown") as progress:
        progress(0.0)
        if pitch_lost:
            name, as_text = lost.NAME, lost.as_text
            document = lost.run_pitch_lost(out, speeds_mps, workers, progress)
        else:
            name, as_text = fault_matrix.name_of(declared, turbulence), fault_matrix.as_text
            document = fault_matrix.run_matrix(
                out, speeds_mps, workers, progress, declared, aircraft or DEFAULT, turbulence.value
            )
    folder = str(out / name)
    answer(format, document | {"folder": folder}, lambda: as_text(document) + f"\n\nresults: {folder}")
    raise typer.Exit(0 if document["passed"] else 1)


@dataclass(frozen=True)
class Surveyed:
    """What is flown where, and who watches."""

    grid: GridName = GridName.quick
    schemes: str | None = None
    sensors: SensorsName | None = None
    turbulence: TurbulenceName | None = None
    airspeed: Annotated[float | None, typer.Option(min=1, max=1000)] = None
    altitude: Annotated[float | None, typer.Option(min=-300, max=30000)] = None
    aircraft: str | None = None
    surface: str | None = None
    rates_alone: bool = False
    workers: WorkersOption = None
    out: Path = Path("runs")
    format: FormatOption = Format.text


def power(asked: Surveyed) -> None:
    """Map how likely and how soon faults are detected.

    Over surface, magnitude, excitation, sensors and turbulence.

    Every scheme watches the same flights, at the alarm level that gives all the same false-alarm rate on the
    same healthy flights. Writes power.json, power.parquet, power.txt, and maps as PNG and SVG.

    Stopped or killed, it goes on where it was with the same command.

    grid: quick: a minute of CPU; full: ten or so.
    schemes: Comma-separated schemes beside ours; all registered ones if left out.
    sensors: Only with these sensors; left out: all of the grid.
    turbulence: Only in this air; left out: all of the grid.
    airspeed: Airspeed, m/s.
    altitude: Altitude above sea level, m.
    aircraft: Built-in name, jsbsim:NAME, or ./FOLDER in the working directory.
    surface: Only losses of this one, with an answer in a line for each of them.
    rates_alone: Do not show plug-ins the air as our detector sees it by the vanes.
    out: Folder for the results: `power` in it.
    """
    from beaver_ftc.studies.engine.workers import cores
    from beaver_ftc.studies.power.chances import answers
    from beaver_ftc.studies.power.shown import NAME, as_text, run_power
    from beaver_ftc.studies.power.survey import GRIDS, contenders

    chosen = contenders(None if asked.schemes is None else listed(asked.schemes))
    with progress_bar(f"power, {asked.grid.value} grid") as progress:
        survey = replace(GRIDS[asked.grid].only(asked.sensors, asked.turbulence), vanes=not asked.rates_alone)
        survey = survey.elsewhere(asked.aircraft, asked.airspeed, asked.altitude, asked.surface)
        document = run_power(asked.out, survey, chosen, asked.workers or cores(), progress)
    folder, said = str(asked.out / NAME), answers(document, asked.surface) if asked.surface else []
    document |= {"answers": said} if said else {}
    text = "\n".join(said) or as_text(document)
    answer(asked.format, document | {"folder": folder}, lambda: f"{text}\n\nresults: {folder}")


def smallest(
    scenario: ScenarioArgument,
    surface: Annotated[str, typer.Option()],
    within: Annotated[float, typer.Option(min=0.01, max=60)] = 0.5,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    workers: WorkersOption = None,
    out: Path = Path("runs"),
    format: FormatOption = Format.text,
) -> None:
    """Find how small a loss of one surface is found in time.

    The size that is certain to be detected, and the size that is found in 90 % of flights with its 95 %
    interval. Flies the scenario without its own faults; seed and instant of the loss are drawn, and flights
    are added until the interval is narrow, 480 at most.

    Then what limits it: turbulence, sensors, servos and uncertainty of the model, each left out of the same
    flights; and which reference would help: twice the amplitude, twice the frequency.

    Stopped or killed, it goes on where it was with the same command.

    Examples:
      beaver-ftc smallest elevator-partial-loss --surface elevator --within 0.5

    surface: The surface that loses effectiveness.
    within: From the loss to the alarm, s.
    seed: Of everything drawn.
    out: Folder for the results: SCENARIO-smallest-SURFACE in it, with a page, CSV and JSON.
    """
    from beaver_ftc.scenario.loader import load_scenario
    from beaver_ftc.studies.engine.workers import cores
    from beaver_ftc.studies.smallest.shown import as_text
    from beaver_ftc.studies.smallest.survey import Asked, run_smallest

    asked = Asked(surface, within, seed)
    document = run_smallest(out, load_scenario(scenario), asked, workers or cores(), complain)
    answer(format, document, lambda: f"{as_text(document)}\n\nresults: {document['folder']}")
