"""`python -m tools.mutants`: draw mutants by seed, put each on trial, count and list those that live."""

import argparse
import os
import random
import sys

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before anything imports Numba

import hypothesis
import numba
import pandas
import scipy.linalg
import scipy.optimize
import scipy.stats

from tools.mutants.making import Mutant, mutants
from tools.mutants.reach import ROOT, reach
from tools.mutants.trial import SURVIVED, chosen, outcome

LIBRARIES = (hypothesis, numba, pandas, scipy)  # loaded once here, not once in each child
PACKAGE = ROOT / "src" / "beaver_ftc"
# What computes, judges, counts and words; not what draws, reads files, talks to JSBSim or starts processes.
SCOPE = (
    "design/*.py", "diagnosis/**/*.py", "control/**/*.py", "studies/engine/statistics.py",
    "studies/*/summary.py", "studies/*/tally.py", "studies/*/text.py", "studies/*/words.py",
    "studies/*/levels.py", "studies/*/limit.py", "results/expectations.py", "results/metrics.py",
    "results/verdict.py", "scenario/signals.py", "scenario/table.py", "scenario/warnings.py",
)  # fmt: skip
# Tests that reach a folder of the package: its own, and those of what stands on it.
FOLDERS = {
    "design": ("design", "diagnosis", "control"),
    "diagnosis": ("diagnosis", "design"),
    "control": ("control",),
    "studies": ("studies",),
    "results": ("results",),
    "scenario": ("scenario",),
}


def main() -> int:
    """Exit status 0 if at least `--least` per cent of the mutants die."""
    options = _options()
    drawn = _drawn(options.seed, options.modules)[options.start : options.count]
    killed = 0
    for number, mutant in enumerate(drawn, options.start + 1):
        died = _dies(mutant)
        killed += died
        print(f"{number:4d} {'killed' if died else 'LIVES '} {_line(mutant)}", flush=True)
    print(f"{killed} of {len(drawn)} mutants killed (seed {options.seed})")
    return int(100 * killed < options.least * len(drawn))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100, help="how many of the seed's mutants")
    parser.add_argument("--start", type=int, default=0, help="leave out the first so many, to go on")
    parser.add_argument("--least", type=float, default=85.0, help="per cent that must die")
    parser.add_argument("modules", nargs="*", default=SCOPE, help="patterns below src/beaver_ftc")
    return parser.parse_args()


def _drawn(seed: int, patterns: list[str]) -> list[Mutant]:
    files = sorted({file for pattern in patterns for file in PACKAGE.glob(pattern)})
    every = [mutant for file in files for mutant in mutants(file)]
    random.Random(seed).shuffle(every)
    return every


def _dies(mutant: Mutant) -> bool:
    name = mutant.file.relative_to(ROOT).as_posix()
    for folder in FOLDERS[mutant.file.relative_to(PACKAGE).parts[0]]:
        found = reach(folder)
        tests = _tests(found["lines"].get(name, {}), mutant)
        if tests and outcome(mutant, chosen(tests, found["seconds"])) != SURVIVED:
            return True
    return False


def _tests(lines: dict[str, list[str]], mutant: Mutant) -> list[str]:
    """Those that execute the line; of one that ran at import, all that execute anything of the file."""
    for line in mutant.lines:
        if tests := lines.get(str(line)):
            return tests
    if any(str(line) in lines for line in mutant.lines):
        return sorted({test for tests in lines.values() for test in tests})
    return []


def _line(mutant: Mutant) -> str:
    where = f"{mutant.file.relative_to(PACKAGE).as_posix()}:{mutant.lines[0]}"
    return f"{where} {mutant.kind}: {mutant.before.splitlines()[0]}  ->  {mutant.after.splitlines()[0]}"


if __name__ == "__main__":
    sys.exit(main())
