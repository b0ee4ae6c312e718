"""Whoever reads the rows of the table of fault types names none: by the syntax tree of the readers."""

import ast
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

from beaver_ftc.diagnosis import types
from beaver_ftc.diagnosis.types import registry, table

FOLDER = Path(types.__path__[0])
READERS = sorted(path.name for path in FOLDER.glob("*.py"))
MODULES = [name for _, name, _ in iter_modules(table.__path__)]


def names_of_types():
    """What a type can be called in code: its module, its name and record, the constant of its row."""
    rows = {
        name
        for module in MODULES
        for name, value in vars(import_module(f"{table.__name__}.{module}")).items()
        if isinstance(value, types.FaultType)
    }
    words = {
        word for row in registry.TYPES for word in (row.name, row.description, row.memory_record_name) if word
    }
    return (rows | words | set(MODULES)) - {"float"}  # which is Python's as well


def named(source):
    """Every name, attribute, import and text of a module, its docstrings and those of its functions aside."""
    tree = ast.parse(source)
    documented = (
        node for node in ast.walk(tree) if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef)
    )
    docstrings = {id(node.body[0].value) for node in documented if ast.get_docstring(node) is not None}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.alias):
            yield node.name.rpartition(".")[2]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.value


@pytest.mark.parametrize("reader", READERS)
def test_a_reader_of_the_rows_names_no_type(reader):
    assert "verdict.py" in READERS
    assert set(named((FOLDER / reader).read_text())) & names_of_types() == set()


def test_what_would_name_one_is_seen():
    assert {"STUCK", "OSCILLATORY", "oscillatory", "hardover up", "bias", "growing_bias"} <= names_of_types()
    one_each = "from table import bias\nx = STUCK\ny = surface.growing_bias\nz = 'hardover'"
    assert set(named(one_each)) & names_of_types() == {"bias", "STUCK", "growing_bias", "hardover"}
    assert set(named('"""bias"""\ndef f():\n    """stuck"""')) & names_of_types() == set()
