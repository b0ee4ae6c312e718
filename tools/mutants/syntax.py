"""What the syntax tree of a module says: what it imports, what runs at import, who reads a name."""

import ast
from functools import cache
from pathlib import Path


def imports(file: Path) -> dict[str, list[str]]:
    """{module: names} that a module imports."""
    nodes = (node for node in ast.walk(tree(file)) if isinstance(node, ast.ImportFrom))
    return {node.module or "": [alias.name for alias in node.names] for node in nodes}


def runs_at_import(file: Path, line: int) -> bool:
    """Whether a line is outside of all functions, so that every user of the module uses its result."""
    functions = (node for node in ast.walk(tree(file)) if isinstance(node, ast.FunctionDef))
    return not any(node.body[0].lineno <= line <= (node.end_lineno or 0) for node in functions)


def assigned(file: Path, line: int) -> set[str]:
    """The names of a module to which its statement at a line gives a value."""
    around = (node for node in tree(file).body if node.lineno <= line <= (node.end_lineno or 0))
    values = (node for node in around if isinstance(node, ast.Assign | ast.AnnAssign))
    every = (inner for node in values for inner in ast.walk(node))
    return {node.id for node in every if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}


def uses(file: Path, names: set[str]) -> set[int]:
    """The lines of a module at which one of these names is read."""
    every = (node for node in ast.walk(tree(file)) if isinstance(node, ast.Name | ast.Attribute))
    named = ((node, node.id if isinstance(node, ast.Name) else node.attr) for node in every)
    return {node.lineno for node, name in named if name in names and isinstance(node.ctx, ast.Load)}


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())
