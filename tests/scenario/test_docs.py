"""The manual's examples load, and its tables name every kind, type and expectation there is."""

import re
from pathlib import Path

import pytest

from beaver_ftc.scenario.schema import Expect, json_schema, load_text
from beaver_ftc.scenario.signals import Signal

MANUAL = (Path(__file__).parents[2] / "docs/reference/scenarios.md").read_text()
EXAMPLES = re.findall(r"```yaml\n(.*?)```", MANUAL, re.DOTALL)


@pytest.mark.parametrize("text", EXAMPLES)
def test_an_example_loads_without_a_warning(text):
    assert load_text(text).warnings() == ()


def fault_types() -> list[str]:
    kinds = json_schema()["properties"]["faults"]["items"]["oneOf"]  # of surfaces, of instruments
    return [name for kind in kinds for name in kind["discriminator"]["mapping"]]


def test_every_signal_and_fault_is_explained_and_every_expectation_named():
    for name in [*Signal.model_fields, *fault_types()]:
        assert re.search(rf"^\|`{name}`\|", MANUAL, re.MULTILINE), name
    for name in Expect.model_fields:
        assert re.search(rf"`{name}\b", MANUAL), name
