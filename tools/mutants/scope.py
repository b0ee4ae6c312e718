"""The modules that get mutants, the tests that try them, and the mutants that a seed draws."""

import ast
import hashlib
import subprocess
from collections import Counter
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path

from tools.data import yaml_of
from tools.mutants.making import Mutant, mutants
from tools.mutants.syntax import imports, tree

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "src"
CORE = SOURCES / "beaver_ftc"
TESTS = ROOT / "tests"
KEPT = ROOT / ".mutants"
EQUIVALENT = Path(__file__).with_name("equivalent.yaml")

KERNELS, GLUE = "kernels", "glue"
# How tests run: in plain Python, since to compile each mutant of a kernel would take all day; or compiled,
# once for all, where no kernel changes; or compiled again, if no plain test finds a mutant of a kernel.
PLAIN, COMPILED, AGAIN = "plain", "compiled", "compiled again"
FLIGHTS = ("loop/test_compiled_as_plain.py", "relations/test_*.py", "reference/test_*.py")
ANSWERS = TESTS / "cli" / "test_kept_answers.py"
NOT_AT_NIGHT = "not nightly"
BY_DAY, EACH_PUSH = f"{NOT_AT_NIGHT} and not acceptance", f"{NOT_AT_NIGHT} and acceptance"

# Compiled modules that plain Python reaches in a second.
QUICK = ("design", "diagnosis", "control")
APART = {
    "beaver_ftc/compiled/records.py": GLUE,
    "beaver_ftc/compiled": "compile",
    "beaver_ftc/results/style.py": "looks",
}
LEFT_OUT = {
    "looks": "how lines look: only the eye can judge it",
    "compile": "what compiles and keeps code: a mistake in it would be kept",
    "fly": "their kernels, compiled into the whole flight: minutes in plain Python, half of one to compile",
}


def kind(file: Path) -> str:
    """KERNELS or GLUE, or the reason why a module gets no mutants (a key of LEFT_OUT)."""
    for place, reason in APART.items():
        if file.is_relative_to(SOURCES / place):
            return reason
    if file not in _compiled():
        return GLUE
    return KERNELS if _is_quick(file) else "fly"


def _is_quick(file: Path) -> bool:
    return any(file.is_relative_to(CORE / folder) for folder in QUICK)


def kind_of(mutant: Mutant) -> str:
    """The same of a mutant: what fills a kernel's records stands beside it, and is glue."""
    of = kind(mutant.file)
    return of if of in APART.values() or _in_compiled_code(mutant.file, mutant.lines[0]) else GLUE


def _in_compiled_code(file: Path, line: int) -> bool:
    """Whether a line changes a kernel: a line of a kernel, of a constant, or of the layout of a record."""
    if file not in _compiled():
        return False
    around = (node for node in tree(file).body if node.lineno <= line <= (node.end_lineno or 0))
    for node in around:
        if isinstance(node, ast.FunctionDef):
            kernel = any(ast.unparse(each).startswith(("kernel", "apart")) for each in node.decorator_list)
            return kernel or node.name.endswith("_dtype")
    return True


@cache
def _compiled() -> frozenset[Path]:
    """The modules with kernels, and the modules whose constants these kernels contain."""
    found = {file for file in SOURCES.rglob("*.py") if "beaver_ftc.compiled" in imports(file)}
    due = list(found)
    while due:
        for module, names in imports(due.pop()).items():
            file = (SOURCES / module.replace(".", "/")).with_suffix(".py")
            constants = any(name.lstrip("_").isupper() for name in names)
            if constants and _is_quick(file) and file not in found and file.exists():
                found.add(file)
                due.append(file)
    return frozenset(found)


def left_out() -> list[str]:
    """A line for each reason: the number of modules without mutants, and the reason."""
    kinds = Counter(kind(file) for file in SOURCES.rglob("*.py"))
    return [f"{kinds[reason]} modules: {text}" for reason, text in LEFT_OUT.items() if kinds[reason]]


@dataclass(frozen=True)
class Round:
    """Tests that run together: how, which, with which marks, and without which."""

    mode: str
    tests: tuple[str, ...]
    marks: str = ""
    left_out: tuple[str, ...] = ()

    @property
    def asked(self) -> list[str]:
        """What pytest is asked."""
        marks = ["-m", self.marks] * bool(self.marks)
        return [*marks, *(f"--deselect={test}" for test in self.left_out), *self.tests]

    def without(self, test: str) -> "Round":
        """The others."""
        return replace(self, left_out=(*self.left_out, test))


def rounds(file: Path, kind: str, reached: Set[Path] = frozenset()) -> list[Round]:
    """The tests for a mutant of a module, the nearest first. reached: the test files that execute glue, and
    of the answers of commands single tests."""
    near = nearest(file)
    flights = {path for pattern in FLIGHTS for path in TESTS.glob(pattern)}
    if kind == KERNELS:
        wider = _below(TESTS / file.relative_to(CORE).parts[0])
        found = [(PLAIN, wider & plain() - flights, BY_DAY), (AGAIN, near - plain() | flights, BY_DAY)]
    else:
        answers = {test for test in reached if is_answer(test)}
        others = reached - answers - plain()
        found = [
            (PLAIN, reached & plain(), BY_DAY),
            (COMPILED, answers, NOT_AT_NIGHT),
            (COMPILED, others & near, BY_DAY),
            (COMPILED, others - near, BY_DAY),
            (COMPILED, others, EACH_PUSH),
        ]
    named = [(mode, tuple(sorted(map(str, files))), marks) for mode, files, marks in found]
    return [Round(mode, names, marks) for mode, names, marks in named if names]


def is_answer(test: Path) -> bool:
    """Whether it is the file of the answers, or a test in it."""
    return test == ANSWERS or test.match(f"{ANSWERS}::*")


def every() -> set[Path]:
    """All test files but those that use an installed wheel, or a browser, which takes minutes."""
    return _below(TESTS)


def nearest(file: Path) -> set[Path]:
    """The test files below the folder that mirrors a module's: tests/products/NAME of beaver_ftc_NAME."""
    package, _, folder = file.relative_to(SOURCES).parent.as_posix().partition("/")
    product = package.removeprefix(CORE.name).removeprefix("_")
    place = TESTS / ("products" if product else "") / product / folder
    while not place.is_dir():
        place = place.parent
    return _below(place) if place != TESTS else set(TESTS.glob("test_*.py"))


def _below(folder: Path) -> set[Path]:
    found = set(folder.rglob("test_*.py")) - set((TESTS / "acceptance").glob("*.py"))
    return {file for file in found if "live_browser" not in file.read_text()}


@cache
def plain() -> frozenset[Path]:
    """The test files that `make test` runs in plain Python."""
    asked = ["make", "--silent", "plain"]
    done = subprocess.run(asked, capture_output=True, text=True, check=True, cwd=ROOT)
    entries = [ROOT / name for name in done.stdout.split()]
    return frozenset(file for entry in entries for file in ([entry] if entry.is_file() else _below(entry)))


def drawn(seed: int, patterns: Sequence[str]) -> tuple[list[tuple[str, Mutant]], Counter[str]]:
    """Kind and mutant in the order of a seed, kernels and glue in turn, and the number of each kind.

    The order depends on each mutant alone, so a change elsewhere in the package does not change it. Mutants
    that are listed as equivalent are left out.
    """
    known = equivalent()
    files = sorted({file for pattern in patterns for file in SOURCES.glob(pattern)})
    every: dict[str, list[Mutant]] = {KERNELS: [], GLUE: []}
    for mutant in chain(*map(mutants, files)):
        if mutant.name(SOURCES) not in known:
            every.get(kind_of(mutant), []).append(mutant)
    for found in every.values():
        found.sort(key=lambda mutant: hashlib.sha256(f"{seed} {mutant.name(SOURCES)}".encode()).digest())
    turns = zip_longest(*([(of, mutant) for mutant in found] for of, found in every.items()))
    return [pair for pair in chain(*turns) if pair], Counter({of: len(found) for of, found in every.items()})


def equivalent() -> set[str]:
    """The names of the mutants that change no result; the file has the reasons."""
    listed = yaml_of(EQUIVALENT) or {}
    return {f"{file}: {change}" for file, changes in listed.items() for change in changes}


def stale() -> list[str]:
    """Names in the list of equivalent mutants that no mutant has today."""
    known = equivalent()
    files = {SOURCES / name.split(":")[0] for name in known}
    there = {mutant.name(SOURCES) for file in files if file.exists() for mutant in mutants(file)}
    return sorted(known - there)
