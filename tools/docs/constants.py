"""The constants that prose cites, read from the code: `python -m tools.docs constants`."""

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from typing import Any
from warnings import catch_warnings

import numpy as np

from beaver_ftc.documents.errors import BeaverFtcError
from tools.docs.pages import ROOT

PACKAGE = "beaver_ftc"
_ASSIGNED = re.compile(r"^([A-Z_][A-Z\d_, ]*?)(?::[^=\n]*)? =", re.MULTILINE)


def constants() -> dict[str, Any]:
    """The document: defaults of every key of a scenario, and constants of modules by the module's path."""
    from beaver_ftc.scenario.schema import load_text

    defaults = load_text("name: default\n").model_dump()
    return {"defaults": _plain(defaults), "modules": dict(_of_modules())}


def _of_modules() -> Iterator[tuple[str, dict[str, Any]]]:
    """(module's path, its constants): names in capitals, of what JSON can say. A module of the core goes by
    its path below the package.
    """
    for path in sorted((ROOT / "src").rglob("*.py")):
        lines = _ASSIGNED.findall(path.read_text(encoding="utf-8"))
        names = [name for line in lines for name in re.split(r"\W+", line) if name.isupper()]
        parts = path.relative_to(ROOT / "src").with_suffix("").parts
        dotted = ".".join(part for part in parts if part != "__init__")
        # what an optional library would bring; what has moved, and says so
        with suppress(ImportError, BeaverFtcError), catch_warnings(action="ignore"):
            module, found = import_module(dotted) if names else None, {}
            for name in names:
                with suppress(TypeError, ValueError):
                    found[name] = _plain(getattr(module, name, None))
            yield dotted.removeprefix(f"{PACKAGE}."), found


def _plain(value: Any) -> Any:
    """As JSON has it; TypeError or ValueError for what it has not."""
    return json.loads(json.dumps(value, default=_as_list))


def _as_list(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.number):
        return value.tolist()
    if isinstance(value, range | set | frozenset):
        return sorted(value)
    raise TypeError
