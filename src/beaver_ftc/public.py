"""Public names of a folder, imported when they are first used.

A folder's `__init__.py` lists what it publishes to other packages as imports that tools read and Python does
not execute; so importing one module of the folder imports none of the others.

    if TYPE_CHECKING:
        from beaver_ftc.plant.adapter import Plant
    else:
        __getattr__, __dir__ = lazily(__name__)
"""

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def lazily(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package that publishes names."""

    def find(name: str) -> Any:
        if name.startswith("__") or name not in published(package):
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, attribute = published(package)[name]
        return getattr(import_module(module), attribute)

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *published(package)})

    return find, names


@cache
def published(package: str) -> dict[str, tuple[str, str]]:
    """{public name: (module, name there)} of the imports that a package lists under TYPE_CHECKING, where an
    `else` follows; without one they are for its annotations."""
    tree = ast.parse(Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8"))
    blocks = (
        node.body
        for node in tree.body
        if isinstance(node, ast.If) and node.orelse and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    imports = (node for block in blocks for node in block if isinstance(node, ast.ImportFrom))
    return {
        alias.asname or alias.name: (str(node.module), alias.name) for node in imports for alias in node.names
    }
