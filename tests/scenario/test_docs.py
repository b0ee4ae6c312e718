"""The manual's examples load."""

import re
from pathlib import Path

import pytest

from beaver_ftc.scenario.schema import load_text

MANUAL = (Path(__file__).parents[2] / "docs/reference/scenarios.md").read_text()
EXAMPLES = re.findall(r"```yaml\n(.*?)```", MANUAL, re.DOTALL)


@pytest.mark.parametrize("text", EXAMPLES)
def test_an_example_loads_without_a_warning(text):
    assert load_text(text).warnings() == ()
