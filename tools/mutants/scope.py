"""The modules that get mutants, the test files of each mode, and the mutants that a seed draws."""

import ast
import hashlib
import subprocess
from collections import Counter
from collections.abc import Sequence
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path

import yaml

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
# once for all, where no kernel changes. A kernel whose mutant no plain test finds is compiled, for the other
# tests of its folder, and for flights beside the executable reference and beside each other.
PLAIN, COMPILED, FLOWN = "plain", "compiled", "flown"
FLIGHTS = ("diagnosis/test_short_flights.py", "relations/test_*.py", "reference/test_*.py")
FILE_S = 30.0  # of processor for a file of tests that fly, roughly
MODES = {KERNELS: (PLAIN, FLOWN), GLUE: (PLAIN, COMPILED)}

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
    if file not in _compiled(SOURCES):
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
    if file not in _compiled(SOURCES):
        return False
    around = (node for node in tree(file).body if node.lineno <= line <= (node.end_lineno or 0))
    for node in around:
        if isinstance(node, ast.FunctionDef):
            kernel = any(ast.unparse(each).startswith(("kernel", "apart")) for each in node.decorator_list)
            return kernel or node.name.endswith("_dtype")
    return True


@cache
def _compiled(sources: Path) -> frozenset[Path]:
    """The modules with kernels, and the modules whose constants these kernels contain."""
    found = {file for file in sources.rglob("*.py") if "beaver_ftc.compiled" in imports(file)}
    due = list(found)
    while due:
        for module, names in imports(due.pop()).items():
            file = (sources / module.replace(".", "/")).with_suffix(".py")
            constants = any(name.lstrip("_").isupper() for name in names)
            if constants and _is_quick(file) and file not in found and file.exists():
                found.add(file)
                due.append(file)
    return frozenset(found)


def left_out() -> list[str]:
    """A line for each reason: the number of modules without mutants, and the reason."""
    kinds = Counter(kind(file) for file in SOURCES.rglob("*.py"))
    return [f"{kinds[reason]} modules: {text}" for reason, text in LEFT_OUT.items() if kinds[reason]]


def tests(mode: str) -> list[Path]:
    """The test files of a mode: those that `make test` runs in plain Python, or all others."""
    plain = {
        file for entry in _plain() for file in ([entry] if entry.is_file() else entry.rglob("test_*.py"))
    }
    if mode == PLAIN:
        return sorted(plain)
    return sorted(set(TESTS.rglob("test_*.py")) - plain - set((TESTS / "acceptance").rglob("*.py")))


def flown(file: Path) -> dict[str, float]:
    """The test files that fly a compiled mutant of a module, and their times, s."""
    own = sorted(set((TESTS / folder_of_tests(file)).glob("test_*.py")) - set(tests(PLAIN)))
    flights = [path for pattern in FLIGHTS for path in sorted(TESTS.glob(pattern))]
    return {path.relative_to(ROOT).as_posix(): FILE_S for path in dict.fromkeys([*own, *flights])}


def folder_of_tests(file: Path) -> str:
    """The folder below tests/ that mirrors a module's: `products/NAME` for beaver_ftc_NAME."""
    package, _, folder = file.relative_to(SOURCES).parent.as_posix().partition("/")
    product = package.removeprefix(CORE.name).removeprefix("_")
    return "/".join(part for part in ("products" if product else "", product, folder) if part)


@cache
def _plain() -> list[Path]:
    asked = ["make", "--silent", "plain"]
    done = subprocess.run(asked, capture_output=True, text=True, check=True, cwd=ROOT)
    return [ROOT / name for name in done.stdout.split()]


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
    listed = yaml.safe_load(EQUIVALENT.read_text()) or {}
    return {f"{file}: {change}" for file, changes in listed.items() for change in changes}


def stale() -> list[str]:
    """Names in the list of equivalent mutants that no mutant has today."""
    known = equivalent()
    files = {SOURCES / name.split(":")[0] for name in known}
    there = {mutant.name(SOURCES) for file in files if file.exists() for mutant in mutants(file)}
    return sorted(known - there)
