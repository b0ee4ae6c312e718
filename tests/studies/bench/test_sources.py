"""The name compiled code is kept under: it follows from the sources of kernels, and of nothing else.

Expected by another road: the syntax tree of each file, and what comes out of a program that is changed.
"""

import ast
import shutil
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

import beaver_ftc
from beaver_ftc import compiled
from beaver_ftc.documents.sources import sources_of_kernels

PACKAGE = Path(beaver_ftc.__file__).parent
MAKERS = {"kernel", "apart", "compile_into"}
BESIDE = (
    "control/rivals/indi.py", "control/rivals/lqr.py", "loop/plugin_frame.py", "plant/channels.py",
    "aircraft/schema.py", "compiled.py", "control/laws/__init__.py", "numba_inside.py",
)  # fmt: skip


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def makes_kernels(path: Path) -> bool:
    """Whether a file has what kernels are made with from where it is."""
    return b"compiled" in path.read_bytes() and any(
        (node.module == "beaver_ftc.compiled" and MAKERS & {alias.name for alias in node.names})
        or (node.module == "beaver_ftc" and "compiled" in {alias.name for alias in node.names})
        for node in ast.walk(tree(path))
        if isinstance(node, ast.ImportFrom)
    )


def at_import(node: ast.AST):
    """The import statements that are executed when the file is imported."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
            continue
        elif not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from at_import(child)


def imported(path: Path):
    """The files of the package that a file imports when it is imported."""
    for node in at_import(tree(path)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            if name.startswith("beaver_ftc."):
                place = PACKAGE.joinpath(*name.split(".")[1:])
                yield from (p for p in (place / "__init__.py", place.with_suffix(".py")) if p.is_file())


def test_every_file_that_a_kernel_follows_from_is_hashed():
    """Kernels' files, and whatever these import, on and on."""
    made = {path for path in PACKAGE.rglob("*.py") if makes_kernels(path)}
    assert len(made) > 50
    wanted, ahead = set(), list(made)
    while ahead:
        path = ahead.pop()
        if path not in wanted:
            wanted.add(path)
            ahead += imported(path)
    hashed = {PACKAGE.joinpath(*name.split(".")) for name in sources_of_kernels(PACKAGE)}
    hashed = {p / "__init__.py" if p.is_dir() else p.with_suffix(".py") for p in hashed}
    assert wanted - hashed == set()
    assert not [path for path in hashed if path.relative_to(PACKAGE).parts[0] in ("cli", "integrations")]
    assert len(hashed) < len(list(PACKAGE.rglob("*.py"))) / 2, "an edit anywhere would compile all anew"


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package's sources."""
    copied = tmp_path_factory.mktemp("copy") / "beaver_ftc"
    shutil.copytree(
        PACKAGE, copied, ignore=lambda _, names: [n for n in names if "." in n and not n.endswith(".py")]
    )
    return copied


@pytest.fixture
def name_of(copy, monkeypatch, tmp_path):
    """The name of the folder that the copy's code is kept in."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiled, "_PACKAGE", copy)

    def name():
        compiled.cache_folder.cache_clear()
        return compiled.cache_folder().name

    yield name
    compiled.cache_folder.cache_clear()


def test_an_edit_of_what_a_kernel_follows_from_makes_another_name(copy, name_of):
    names = [name_of()]
    edited = {str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if makes_kernels(path)}
    for file in sorted(edited.union(BESIDE)):
        path = copy / file
        path.write_bytes(path.read_bytes() + b"\n")
        names.append(name_of())
    assert len(edited) > 50
    assert len(set(names)) == len(names)
    for file in ("cli/run.py", "results/report.py", "studies/sweep/campaign.py"):
        path = copy / file
        path.write_bytes(path.read_bytes() + b"\n")
        assert name_of() == names[-1], file


PROGRAM = """
import numpy as np
import constants_of_a_plug_in as constants
from constants_of_a_plug_in import FACTOR
TABLE = np.array([1.0, 2.0])
def inner(x):
    return 3.0 * x
inner = compile_into(folder, inner)
def outer(x):
    return inner(x) * FACTOR + constants.ADDED + TABLE[1] + 0.5
outer = compile_into(folder, outer)
"""


def test_a_plug_in_s_kernel_is_compiled_anew_when_what_it_is_made_of_changes(tmp_path, monkeypatch):
    """Outside the package no file is hashed: a number in the text, in an inner kernel, in another module."""

    def outcome(program=PROGRAM, **constants):
        module = ModuleType("constants_of_a_plug_in")
        vars(module).update({"FACTOR": 2.0, "ADDED": 1.0} | constants)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        space = {"__name__": "plug_in", "folder": tmp_path, "compile_into": compiled.compile_into}
        exec(program, space)
        return space["outer"](1.0), "loaded" if space["outer"].stats.cache_hits else "compiled"

    assert outcome() == (9.5, "compiled")
    assert outcome() == (9.5, "loaded")
    assert outcome(PROGRAM.replace("+ 0.5", "+ 0.75")) == (9.75, "compiled")
    assert outcome(PROGRAM.replace("3.0 * x", "4.0 * x")) == (11.5, "compiled")
    assert outcome(PROGRAM.replace("[1.0, 2.0]", "[1.0, 4.0]")) == (11.5, "compiled")
    assert outcome(FACTOR=3.0) == (12.5, "compiled")
    assert outcome(ADDED=2.0) == (10.5, "compiled")
    assert outcome() == (9.5, "loaded")
