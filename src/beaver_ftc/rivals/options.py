"""A rival's parameters: its defaults, what the tuning found, what the scenario says; in that order."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from beaver_ftc.errors import BadInput

TUNED = Path(__file__).with_name("tuned.json")


@cache
def tuned() -> dict[str, dict[str, float]]:
    """Rival -> parameters found by `beaver-ftc compare --tune`."""
    return json.loads(TUNED.read_text(encoding="utf-8"))["options"] if TUNED.exists() else {}


def options_of(name: str, defaults: Mapping[str, float], given: Mapping[str, float]) -> dict[str, float]:
    """The parameters a rival flies with. Raises BadInput for one it does not have."""
    from beaver_ftc.scenario.base import suggestion

    for key in given:
        if key not in defaults:
            raise BadInput(f"{name}: options.{key}: unknown option{suggestion(key, defaults)}")
    return {**defaults, **tuned().get(name, {}), **given}
