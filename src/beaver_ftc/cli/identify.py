"""`beaver-ftc identify`: from recorded flights to a model of how the vehicle answers its commands."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    flights: Annotated[list[Path], typer.Argument(metavar="FLIGHT", help="Recorded flights.")],
    vehicle: Annotated[str, typer.Option(metavar="FILE", help="Vehicle file, or the built-in `alfa`.")],
    out: Annotated[Path, typer.Option(metavar="MODEL", help="The model file to write.")],
    reader: Annotated[
        str | None, typer.Option(help="table, alfa, ulog or ardupilot, where it is not evident.")
    ] = None,
    format: FormatOption = Format.text,
) -> None:
    """Identify a vehicle from recorded flights.

    Writes a model file for `diagnose`. Fitted are the flights' healthy parts, and faulty ones whose
    effectiveness the labels tell. What the fit did not see tells how good it is: in the model file, and
    as a page beside it (MODEL with .html).
    """
    from beaver_ftc.flights.identification import identify, summary
    from beaver_ftc.flights.inputs import load_flights
    from beaver_ftc.flights.model import as_text, write_text
    from beaver_ftc.flights.model_page import check_page, render_model
    from beaver_ftc.flights.vehicle import load_vehicle

    page = out.with_suffix(".html")
    check_page(page)
    described = load_vehicle(vehicle)
    loaded = load_flights(flights, described, reader)
    model = identify(loaded, described)
    shown = render_model(loaded, model)
    write_text(out, as_text(model))
    write_text(page, shown)
    if format is Format.json:
        emit_json(
            {
                "model": str(out),
                "page": str(page),
                "identified": model.identified,
                "settings": model.settings.model_dump(),
            }
        )
    else:
        emit(f"{summary(model)}\nmodel: {out}\npage: {page}")
