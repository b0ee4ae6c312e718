"""`beaver-ftc identify`: from recorded flights to a model of how the vehicle answers its commands."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    flights: Annotated[list[Path], typer.Argument(metavar="FLIGHT...", help="Recorded flights.")],
    vehicle: Annotated[str, typer.Option(metavar="FILE", help="Vehicle file, or the built-in `alfa`.")],
    out: Annotated[Path, typer.Option(metavar="MODEL", help="The model file to write.")],
    reader: Annotated[
        str | None, typer.Option(help="table, alfa, ulog or ardupilot, where it is not evident.")
    ] = None,
    format: FormatOption = Format.text,
) -> None:
    """Identify a vehicle from recorded flights and write a model file for `diagnose`.

    Fitted are the flights' healthy parts, and faulty ones whose effectiveness the labels tell. What the fit
    did not see tells how good it is.
    """
    from beaver_ftc.flights.identification import identify, summary
    from beaver_ftc.flights.inputs import load_flights
    from beaver_ftc.flights.model import as_text, write_model
    from beaver_ftc.flights.vehicle import load_vehicle

    described = load_vehicle(vehicle)
    model = identify(load_flights(flights, described, reader), described)
    write_model(out, as_text(model))
    if format is Format.json:
        emit_json(
            {"model": str(out), "identified": model.identified, "settings": model.settings.model_dump()}
        )
    else:
        emit(f"{summary(model)}\nmodel: {out}")
