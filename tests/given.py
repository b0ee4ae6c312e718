"""Tables of tests, in tests/data: a file of tests has one of the same name."""

from pathlib import Path
from typing import Any

import yaml

FOLDER = Path(__file__).with_name("data")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast; each worker reads them


def given(of: str) -> dict[str, Any]:
    """The tables of a file of tests, by name."""
    return documents(Path(of).stem.removeprefix("test_"))[0]


def documents(name: str) -> list[dict[str, Any]]:
    """The documents of a file in tests/data."""
    return list(yaml.load_all((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"), _LOADER))
