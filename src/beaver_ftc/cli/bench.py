"""`beaver-ftc bench`: what a frame costs, against the bare aircraft."""

from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, complain, emit, emit_json


def command(
    rounds: Annotated[int, typer.Option(min=3, max=10000, help="How often everything is timed.")] = 60,
    no_parts: Annotated[
        bool, typer.Option("--no-parts", help="Time the whole loop only, not part by part.")
    ] = False,
    format: FormatOption = Format.text,
) -> None:
    """Time the closed loop against the bare aircraft.

    Side by side, and part by part. The first time, the frame is compiled once more for each part that
    is taken out: about two minutes.
    """
    from beaver_ftc.studies.bench.measure import bench

    document = bench(rounds, not no_parts, say=lambda what: complain(f"timing {what}"))
    if format is Format.json:
        emit_json(document)
    else:
        from beaver_ftc.studies.bench.text import text_of

        emit(text_of(document))
