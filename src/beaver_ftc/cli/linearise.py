"""`beaver-ftc linearise`: the margins of the default law on the aircraft linearised over its envelope."""

from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    scenario: Annotated[
        str | None, typer.Argument(metavar="SCENARIO", help="Take sensors, actuators and law from it.")
    ] = None,
    format: FormatOption = Format.text,
) -> None:
    """Linearise the closed loop and print its margins.

    Over the airspeeds of the envelope. Aircraft, actuators, sensors' lag and delay, frame rate and the
    default law, broken at each surface in turn; healthy, and with losses of each surface that the law
    knows.
    """
    from beaver_ftc.scenario.given import load
    from beaver_ftc.studies.margins import as_document, as_text, study

    given = load({} if scenario is None else scenario)
    asked = given.control.gain_margin_db, given.control.phase_margin_deg
    found = study(given)
    if format is Format.json:
        emit_json(as_document(found, asked))
    else:
        emit(as_text(found, asked))
