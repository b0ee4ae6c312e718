"""The syntax tree of a module, and what it imports."""

import ast
from functools import cache
from pathlib import Path


def imports(file: Path) -> dict[str, list[str]]:
    """{module: names} that a module imports."""
    nodes = (node for node in ast.walk(tree(file)) if isinstance(node, ast.ImportFrom))
    return {node.module or "": [alias.name for alias in node.names] for node in nodes}


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())
