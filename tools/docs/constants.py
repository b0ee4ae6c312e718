"""The constants that prose cites, read from the code: `python -m tools.docs constants`."""

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any
from warnings import catch_warnings

import numpy as np

from beaver_ftc.documents.errors import BeaverFtcError
from tools.docs.pages import ROOT

PACKAGE = "beaver_ftc"
_ASSIGNED = re.compile(r"^([A-Z_][A-Z\d_, ]*?)(?::[^=\n]*)? =", re.MULTILINE)
_LONGEST = 64  # elements of a constant that is shown


def constants() -> dict[str, Any]:
    """The document: defaults of every key of a scenario, and constants of modules by the module's path."""
    from beaver_ftc.scenario.schema import load_text

    defaults = load_text("name: default\n").model_dump()
    return _plain({"defaults": defaults, "modules": dict(_of_modules())})


def _of_modules() -> Iterator[tuple[str, dict[str, Any]]]:
    """(module's path, its constants): names in capitals with numbers, texts, or such. A module of the core
    goes by its path below the package.
    """
    for path in sorted((ROOT / "src").rglob("*.py")):
        lines = _ASSIGNED.findall(path.read_text(encoding="utf-8"))
        names = [name for line in lines for name in re.split(r"\W+", line) if name.isupper()]
        if names:
            parts = path.relative_to(ROOT / "src").with_suffix("").parts
            dotted = ".".join(part for part in parts if part != "__init__")
            # what an optional library would bring; what has moved, and says so
            with suppress(ImportError, BeaverFtcError), catch_warnings(action="ignore"):
                module = import_module(dotted)
                found = {name: getattr(module, name, None) for name in names}
                shown = {name: value for name, value in found.items() if _is_shown(value)}
                if shown:
                    yield dotted.removeprefix(f"{PACKAGE}."), shown


def _is_shown(value: Any) -> bool:
    """Whether a value is short enough to be read, and the same on every machine."""
    if isinstance(value, dict):
        return len(value) <= _LONGEST and all(map(_is_shown, value.values()))
    if isinstance(value, list | tuple | set | frozenset | range):
        return len(value) <= _LONGEST and all(map(_is_shown, value))
    if isinstance(value, np.ndarray):
        return value.size <= _LONGEST and value.dtype.kind in "fiu"
    if isinstance(value, str) and Path(value).is_absolute():
        return False  # where the checkout lies is no constant of the code
    return isinstance(value, str | bool | int | float | np.number)


def _plain(value: Any) -> Any:
    """As JSON has it."""
    if isinstance(value, dict):
        return {str(key): _plain(element) for key, element in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(map(_plain, value), key=str)
    if isinstance(value, list | tuple | range):
        return [_plain(element) for element in value]
    if isinstance(value, np.ndarray | np.number):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, str | bool | int | float) or value is None else str(value)
