"""`beaver-ftc verify`: the promises of the theory, on the truth, over many random flights."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    hours: Annotated[float, typer.Option(min=0.0, max=1e6, help="Flight hours without a fault.")] = 2.0,
    faults: Annotated[int, typer.Option(min=0, max=10_000_000, help="Flights with one random fault.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of everything drawn.")] = 1,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes; default: one a core.")
    ] = None,
    out: Annotated[
        Path, typer.Option(help="Folder of the flights flown; a campaign goes on from it.")
    ] = Path("runs/verification"),
    steps: Annotated[
        bool, typer.Option("--steps", help="Also fly every step from the published scheme on.")
    ] = False,
    format: FormatOption = Format.text,
) -> None:
    """Fly at random inside all that is declared: what breaks?

    Counts, with exact confidence limits, broken promises: false alarms, true faults excluded, wrong
    isolations and detections later than guaranteed plus a frame, for the published and the sharpened
    scheme on the same flights. Stopped, it goes on where it was. Exit status 1 if a promise is broken.
    """
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.studies.engine.processes import cores
    from beaver_ftc.studies.verify.campaign import Campaign, conduct
    from beaver_ftc.studies.verify.summary import summarise, summary_text

    with progress_bar("verify") as progress:
        rows = conduct(Campaign(hours, faults, seed, steps), out, workers or cores(), progress)
    document = summarise(rows)
    if format is Format.json:
        emit_json({"seed": seed, **document})
    else:
        emit(summary_text(document))
    raise typer.Exit(0 if document["kept"] else 1)
