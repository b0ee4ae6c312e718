"""`beaver-ftc schema`: the JSON Schema of a scenario, for editors."""

from beaver_ftc.cli.output import emit_json


def command() -> None:
    """Print the JSON Schema of a scenario.

    Editors that know it complete and check a scenario as it is written.
    """
    from beaver_ftc.scenario.schema import Scenario

    emit_json({"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()})
