"""`python -m tools.check`: the tests that execute the lines you have changed, the quickest first.

Which test executes which line is what `python -m tools.mutants` has found out (`.mutants/`): of the sources
as they were then, so line numbers are those before the change. Test files that you have changed run as well.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator

from tools.mutants.reach import Reach, kept_so_far
from tools.mutants.scope import COMPILED, PLAIN, ROOT, tests

BUDGET_S = 50.0  # of processor, as measured before
_HUNK = re.compile(r"^@@ -(\d+)(?:,(\d+))? ")


def changed(diff: str) -> Iterator[tuple[str, list[int]]]:
    """The files of `git diff -U0`, each with the lines that a change takes the place of or follows."""
    name, lines = "", list[int]()
    for line in diff.splitlines():
        if line.startswith("--- "):
            if name:
                yield name, lines
            name, lines = line.removeprefix("--- a/"), []
        elif found := _HUNK.match(line):
            first, count = int(found[1]), int(found[2] or 1)
            lines += range(first, first + max(count, 1))
    if name:
        yield name, lines


def chosen(reach: Reach, files: Iterable[tuple[str, list[int]]], budget_s: float) -> list[str]:
    """The tests that execute these lines, the quickest first, as far as the budget goes."""
    found = {test for name, lines in files for line in lines for test in reach.of(name, [line])}
    taken, spent = [], 0.0
    for test in sorted(found, key=lambda test: (reach.seconds[test], test)):
        spent += reach.seconds[test]
        if spent > budget_s:
            break
        taken.append(test)
    return taken


def main() -> int:
    """Run them, plain kernels and compiled ones apart; exit status 1 if one fails."""
    command = ["git", "diff", "-U0", "--no-renames", "HEAD", "--", "src", "tests"]
    diff = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    files = list(changed(diff))
    if not (ROOT / ".mutants").exists():
        print(
            "no map of lines yet: `make mutants` makes it; running changed test files alone", file=sys.stderr
        )
    failed = False
    for mode in (PLAIN, COMPILED):
        sources = [(name, lines) for name, lines in files if name.startswith("src/")]
        taken = chosen(kept_so_far(mode), sources, BUDGET_S / 2)
        of_mode = {file.relative_to(ROOT).as_posix() for file in tests(mode)}
        taken += [name for name, _ in files if name in of_mode and (ROOT / name).exists()]
        print(f"{mode}: {len(taken)} tests and files", flush=True)
        if taken:
            environment = os.environ | {"NUMBA_DISABLE_JIT": "1" if mode == PLAIN else "0"}
            run = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist", "loadfile", *taken]
            failed |= subprocess.run(run, cwd=ROOT, env=environment, check=False).returncode not in (0, 5)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
