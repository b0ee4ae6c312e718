"""A rival's parameters: its defaults, what the tuning found, what the scenario says; in that order.

Where errors of instruments, air or model are declared, what was tuned for them takes the place of what was
tuned without.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from beaver_ftc.design.context import Context
from beaver_ftc.documents.errors import BadInput, suggestion

TUNED = Path(__file__).with_name("tuned.json")
TUNED_FOR_ERRORS = Path(__file__).with_name("tuned_for_errors.json")


@cache
def tuned(path: Path = TUNED) -> dict[str, dict[str, float]]:
    """Rival -> parameters found by `beaver-ftc compare --tune`."""
    return json.loads(path.read_text(encoding="utf-8"))["options"] if path.exists() else {}


def options_of(name: str, defaults: Mapping[str, float], context: Context) -> dict[str, float]:
    """The parameters a rival flies with. Raises BadInput for one it does not have."""
    for key in context.options:
        if key not in defaults:
            raise BadInput(f"{name}: options.{key}: unknown option{suggestion(key, defaults)}")
    found = tuned().get(name, {})
    if context.declared.errors:
        found = tuned(TUNED_FOR_ERRORS).get(name, found)
    return {**defaults, **found, **context.options}
