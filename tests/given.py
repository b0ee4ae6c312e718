"""Tables of tests, in tests/data: a file of tests has one of the same name."""

from pathlib import Path
from typing import Any

import yaml

FOLDER = Path(__file__).with_name("data")


def given(of: str) -> dict[str, Any]:
    """The tables of a file of tests, by name."""
    name = Path(of).stem.removeprefix("test_")
    return yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
