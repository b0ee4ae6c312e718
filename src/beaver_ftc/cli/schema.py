"""`beaver-ftc schema`: the JSON Schema of a scenario, for editors."""

from beaver_ftc.cli.output import emit_json


def command() -> None:
    """Print the JSON Schema of a scenario file, for editors that complete and check as you type."""
    from beaver_ftc.scenario.schema import Scenario

    emit_json({"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()})
