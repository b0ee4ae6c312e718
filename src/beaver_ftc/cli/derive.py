"""`beaver-ftc derive`: a design model for a JSBSim aircraft, with the error it leaves."""

from pathlib import Path
from typing import Annotated, Any

import typer

from beaver_ftc.cli.output import Format, FormatOption, complain, emit, emit_json


def command(
    aircraft: Annotated[
        str,
        typer.Argument(
            metavar="AIRCRAFT",
            help="jsbsim:NAME of the installed jsbsim package, a JSBSim model, or an aircraft's folder.",
        ),
    ],
    envelope: Annotated[
        Path | None,
        typer.Option(help="YAML with airspeed_mps, alpha_deg, altitude_m, sideslip_deg: where to sample."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write the aircraft's folder into, if not the cache.")
    ] = None,
    format: FormatOption = Format.text,
) -> None:
    """Derive an aircraft's design model from JSBSim.

    And measure the error that is left. It samples the aircraft over its envelope, fits sparse terms,
    and checks them on states the fit did not see: the largest error becomes the declared bound.
    Afterwards `aircraft: jsbsim:NAME` flies.
    """
    from beaver_ftc.studies.derive.run import derive
    from beaver_ftc.studies.derive.text import document_of, text_of

    made = derive(aircraft, out, envelope, tell=lambda what: complain(f"deriving: {what}"))
    document: dict[str, Any] = document_of(made)
    if format is Format.json:
        emit_json(document)
    else:
        emit(text_of(document))
