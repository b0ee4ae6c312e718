"""Which test files execute the statements that mutants change: one run of the tests, with marks."""

import contextlib
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from tools.mutants.making import MARKS, Mutant, marked
from tools.mutants.scope import ANSWERS, NOT_AT_NIGHT, ROOT, every, is_answer, nearest, plain
from tools.mutants.trial import ROUND_S, in_place

_TO = "BEAVER_FTC_MARKS"  # the file that marked statements write to
# What they call. Each process notes each pair of a statement and a test file, or an answer, once.
_CALLED = f"""
import os
_seen = set()
def reached(n):
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
    if not test.startswith("{ANSWERS.relative_to(ROOT)}"):
        test = test.partition("::")[0]
    if test and (n, test) not in _seen:
        _seen.add((n, test))
        with open(os.environ["{_TO}"], "a") as file:
            file.write(f"{{n}} {{test}}\\n")
"""


def reaching(mutants: Sequence[Mutant], jobs: int) -> list[set[Path]]:
    """Of each mutant the test files that execute its statement, and of the answers of commands each single
    test that does. If none does, as with what runs when a module is imported: the files of its folder, and
    all answers."""
    lines: dict[Path, dict[int, int]] = defaultdict(dict)
    for n, mutant in enumerate(mutants):
        lines[mutant.file][n] = mutant.lines[1]
    found: dict[int, set[Path]] = defaultdict(set)
    with tempfile.TemporaryDirectory() as folder:
        notes = Path(folder) / "notes"
        notes.touch()
        with in_place({file: marked(file, of) for file, of in lines.items()}) as sources:
            (sources / f"{MARKS}.py").write_text(_CALLED)
            _run(plain(), jobs, {"NUMBA_DISABLE_JIT": "1", _TO: str(notes)})
            _run(every() - plain(), jobs, {_TO: str(notes)})
        for note in notes.read_text().splitlines():
            n, _, test = note.partition(" ")
            found[int(n)].add(ROOT / test)
    known = every()
    return [
        {test for test in found[n] if test in known or is_answer(test)} or nearest(mutant.file) | {ANSWERS}
        for n, mutant in enumerate(mutants)
    ]


def _run(files: set[Path] | frozenset[Path], jobs: int, variables: dict[str, str]) -> None:
    """Run test files, whatever comes of it: a page that waits for its browser is not waited for."""
    spread = ("-q", "-n", str(jobs), "--dist", "loadfile", "-m", NOT_AT_NIGHT)
    command = [sys.executable, "-m", "pytest", *spread, *sorted(map(str, files))]
    with contextlib.suppress(subprocess.TimeoutExpired):
        subprocess.run(
            command, cwd=ROOT, env=os.environ | variables, capture_output=True, check=False, timeout=ROUND_S
        )
