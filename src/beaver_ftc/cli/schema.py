"""`beaver-ftc schema`: the JSON Schema of a scenario, for editors."""

from typing import Annotated

import typer

from beaver_ftc.cli.output import emit_json


def command(
    sweep: Annotated[bool, typer.Option("--sweep", help="Of a sweep file instead of a scenario.")] = False,
) -> None:
    """Print the JSON Schema of a scenario.

    Editors that know it complete and check a scenario as it is written.
    """
    if sweep:
        from beaver_ftc.scenario.sweep_schema import sweep_json_schema

        emit_json(sweep_json_schema())
        return
    from beaver_ftc.scenario.schema import Scenario

    emit_json({"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()})
