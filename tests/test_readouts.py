"""Records are read through readouts: outside the folders that own them, nobody names a field of one.

A record is an array or a scalar of a structured dtype that a stage declares. Within a class or a function the
test follows it through assignments, loops and subscripts, from `.frames`, `.record` and `.records` of a
flight, from functions that make records, and from an annotation `np.void`.

The test cannot see a record that is passed as `Any`, that a function returns under another annotation than
np.void, or that a container holds. mypy's strict annotations leave few of these. A document is no record.
"""

import ast
from pathlib import Path

import pytest

import beaver_ftc

SRC = Path(beaver_ftc.__file__).parents[1]
ROOTS = (SRC, SRC.parent / "tools")
OWNERS = tuple(
    SRC / "beaver_ftc" / name for name in ("design", "diagnosis", "control", "loop", "plant", "compiled")
)
OF_A_FLIGHT = {"frames", "record", "records", "_frame", "_frames"}
MADE_BY = {"design_of", "design_record", "assemble", "diagnosis_record"}
NO_RECORDS = (SRC.parent / "tools/fdc_check.py",)  # rows of FDC's own tables


def files() -> list[Path]:
    found = (file for root in ROOTS for file in sorted(root.rglob("*.py")))
    return [file for file in found if not any(file.is_relative_to(owner) for owner in (*OWNERS, *NO_RECORDS))]


def name_of(node: ast.expr) -> str:
    """The last name of a name or an attribute, `self.x` as it is."""
    if isinstance(node, ast.Attribute):
        return f"self.{node.attr}" if getattr(node.value, "id", "") == "self" else node.attr
    return getattr(node, "id", "")


class Followed(ast.NodeVisitor):
    """Names that hold records, and subscripts of records by a string."""

    def __init__(self, records: set[str]) -> None:
        self.records, self.found = records, []

    def holds_record(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Subscript):
            return self.holds_record(node.value)
        if isinstance(node, ast.Call):
            return name_of(node.func).removeprefix("self.") in MADE_BY or (
                isinstance(node.func, ast.Attribute)
                and node.func.attr in ("copy", "view")
                and self.holds_record(node.func.value)
            )
        if isinstance(node, ast.Attribute) and node.attr in OF_A_FLIGHT:
            return True
        return name_of(node) in self.records

    def note(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for one, its in zip(target.elts, value.elts, strict=False):
                self.note(one, its)
        elif isinstance(target, ast.Name | ast.Attribute) and self.holds_record(value):
            self.records.add(name_of(target))

    def visit_arg(self, node: ast.arg) -> None:
        annotation = "" if node.annotation is None else ast.unparse(node.annotation)
        array = "ndarray" in annotation and node.arg in ("frame", "frames", "record")
        if "np.void" in annotation or array:
            self.records.add(node.arg)

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            self.note(target, node.value)
        self.generic_visit(node)

    def visit_For(self, node: ast.For) -> None:
        self.note(node.target, node.iter)
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        by_name = isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str)
        if by_name and self.holds_record(node.value):
            self.found.append(node)
        self.generic_visit(node)


def fields_read(text: str) -> list[str]:
    """`line: expression` of each subscript of a record by a string."""
    said = []
    for scope in ast.parse(text).body:  # a class as a whole: its methods share attributes
        names: set[str] = set()
        while True:  # a name may be used above where it is noted
            followed, before = Followed(set(names)), len(names)
            followed.visit(scope)
            names |= followed.records
            if len(names) == before:
                break
        said += [f"{node.lineno}: {ast.unparse(node)}" for node in followed.found]
    return said


def test_no_field_of_a_record_is_read_outside_its_stage():
    found = [f"{file}:{said}" for file in files() for said in fields_read(file.read_text(encoding="utf-8"))]
    assert found == []


def test_no_record_is_handed_about_outside_its_stage():
    assert [str(file) for file in files() if "np.void" in file.read_text(encoding="utf-8")] == []


IN_A_CLASS = """
class Outsider:
    def read(self):
        return self._kept["k"]
    def keep(self, loop):
        self._kept = loop.frames.copy()
"""


@pytest.mark.parametrize(
    "text",
    [
        "def f(loop):\n    return loop.frames['fdi']",
        "def f(fdi: np.void):\n    return fdi['types']",
        "def f(frames: np.ndarray):\n    first = frames[0]\n    for a in first['fdi']: pass",
        IN_A_CLASS,
        "def f(m):\n    d, n = design_of(m)[0], 1\n    return d['x0']",
    ],
)
def test_a_field_is_seen_to_be_read(text):
    assert len(fields_read(text)) == 1
