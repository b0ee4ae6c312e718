"""A stage writes its own records alone: read from the syntax trees of the kernels.

    Config    filled by `configure`, written by no kernel
    Memory    written by the kernels of one file
    Output    written by the kernels of one file, read by any

A field counts whose name is declared once, by `record(...)` or in PARTS: whose record a common name belongs
to, the tree does not say. The lists below are the exceptions.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import beaver_ftc

ROOT = Path(beaver_ftc.__file__).parent
COMPILED = {"kernel", "apart", "lazy_kernel"}

SEVERAL_FILES = {"std", "e_G"}  # of the rows: rates.py and forces.py fill their own
OTHER_FOLDER: set[str] = set()
# Fields of one record, which is put together elsewhere
PARTS = {"TURN_FIELDS"}


@cache
def trees() -> dict[str, ast.Module]:
    """Path below the package -> syntax tree."""
    files = sorted(ROOT.rglob("*.py"))
    return {str(file.relative_to(ROOT)): ast.parse(file.read_text(encoding="utf-8")) for file in files}


def name_of(node: ast.expr) -> str:
    """The last name of a name, of an attribute, or of what is called."""
    node = node.func if isinstance(node, ast.Call) else node
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


@cache
def kernels(tree: ast.Module) -> list[ast.FunctionDef]:
    functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))
    return [node for node in functions if COMPILED & {name_of(d) for d in node.decorator_list}]


def stores(kernel: ast.FunctionDef) -> Iterator[ast.expr]:
    """Attributes and items that a kernel stores into."""
    for node in ast.walk(kernel):
        targets = node.targets if isinstance(node, ast.Assign) else []
        if isinstance(node, ast.AugAssign | ast.AnnAssign):
            targets = [node.target]
        for target in targets:
            for part in target.elts if isinstance(target, ast.Tuple | ast.List) else [target]:
                if isinstance(part, ast.Attribute | ast.Subscript):
                    yield part


def path_of(target: ast.expr) -> list[str]:
    """The names of `a.b[i].c`, from the left: a, b, c."""
    names: list[str] = []
    while isinstance(target, ast.Attribute | ast.Subscript):
        if isinstance(target, ast.Attribute):
            names.append(target.attr)
        target = target.value
    return [getattr(target, "id", ""), *reversed(names)]


@cache
def declared_once() -> dict[str, str]:
    """Field -> the one file that declares it."""
    declared = defaultdict(set)
    for place, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and name_of(node) == "record":
                for keyword in node.keywords:
                    declared[keyword.arg].add(place)
            elif isinstance(node, ast.Assign) and name_of(node.targets[0]) in PARTS:
                for key in getattr(node.value, "keys", []):
                    declared[key.value].add(place)
    return {str(field): places.pop() for field, places in declared.items() if len(places) == 1}


@cache
def writers() -> dict[str, set[str]]:
    """Field -> the files of the kernels that store into it, whole or in part."""
    found = defaultdict(set)
    for place, tree in trees().items():
        for kernel in kernels(tree):
            for target in stores(kernel):
                names = path_of(target)
                if len(names) > 1:
                    found[names[-1]].add(place)
    return found


def test_a_field_is_written_by_one_file():
    once = declared_once()
    found = {field for field, places in writers().items() if field in once and len(places) > 1}
    assert found == SEVERAL_FILES


def test_a_field_is_written_in_the_folder_that_declares_it():
    once, found = declared_once(), set()
    for field, places in writers().items():
        if field in once and {place.split("/")[0] for place in places} - {once[field].split("/")[0]}:
            found.add(field)
    assert found == OTHER_FOLDER


def test_no_kernel_writes_a_configuration():
    """By `record.config.field`, or by `config.field` where `config` names that."""
    written = [
        f"{place} {kernel.name}: {'.'.join(path_of(target))}"
        for place, tree in trees().items()
        for kernel in kernels(tree)
        for target in stores(kernel)
        if "config" in path_of(target)
    ]
    assert written == []


def test_what_is_read_here_is_there():
    """The rules above would hold of a package without kernels."""
    assert sum(len(kernels(tree)) for tree in trees().values()) > 400
    assert len(writers()) > 300
