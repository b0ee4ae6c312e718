"""`python -m tools.mutants`: draw mutants by seed, put each on trial, count and list those that live."""

import argparse
import os
import sys

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before anything imports Numba

from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import hypothesis
import numba
import pandas
import scipy.linalg
import scipy.optimize
import scipy.stats

from tools.mutants.making import Mutant
from tools.mutants.reach import Reach, few_examples, reach
from tools.mutants.scope import FOLDERS, PACKAGE, ROOT, SCOPE, drawn, left_out, stale
from tools.mutants.trial import HANGS, KILLED, outcome

LIBRARIES = (hypothesis, numba, pandas, scipy)  # loaded once here, not once in each child


def main() -> int:
    """Exit status 0 if at least `--least` per cent of the mutants die."""
    options = _options()
    for name in stale():
        print(f"equivalent.yaml: no such mutant: {name}")
    every, known = drawn(options.seed, options.modules)
    taken = every[options.start : options.count]
    _head(options, len(every), known)
    found = _tests(taken, options.jobs)
    ends = _trials(taken, found, options)
    dead = ends[KILLED] + ends[HANGS]
    print(", ".join(f"{number} {end.lower()}" for end, number in sorted(ends.items())))
    print(f"{dead} of {len(taken)} mutants killed (seed {options.seed})")
    return int(100 * dead < options.least * len(taken))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100, help="how many of the seed's mutants")
    parser.add_argument("--start", type=int, default=0, help="leave out the first so many, to go on")
    parser.add_argument("--least", type=float, default=85.0, help="per cent that must die")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes side by side")
    parser.add_argument("modules", nargs="*", default=SCOPE, help="patterns below src/beaver_ftc")
    return parser.parse_args()


def _say(text: str) -> None:
    print(text, flush=True)


def _head(options: argparse.Namespace, number: int, known: int) -> None:
    _say(f"{number} mutants can be made of {', '.join(options.modules)}; {known} more make no difference")
    _say("not of:")
    for line in left_out():
        _say(f"  {line}")


def _tests(taken: list[Mutant], jobs: int) -> dict[str, Reach]:
    """What the tests that may reach the mutants execute, by the folder of the package."""
    folders = sorted({mutant.file.relative_to(PACKAGE).parts[0] for mutant in taken})
    of_tests = sorted({test for folder in folders for test in FOLDERS[folder]})
    whole = reach(of_tests, jobs, _say)
    reasons = ", ".join(f"{number} {why}" for why, number in whole.left_out.items())
    _say(f"{len(whole.seconds)} tests take part; left out: {reasons or 'none'}")
    return {folder: reach(FOLDERS[folder], jobs, _say) for folder in folders}


def _trials(taken: list[Mutant], found: dict[str, Reach], options: argparse.Namespace) -> Counter[str]:
    few_examples()
    ends: Counter[str] = Counter()
    given = []
    for mutant in taken:
        tests = found[mutant.file.relative_to(PACKAGE).parts[0]]
        reached = tests.of(mutant.file.relative_to(ROOT).as_posix(), mutant.lines)
        given.append((mutant, reached, {test: tests.seconds[test] for test in reached}))
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("fork")) as pool:
        for number, end in enumerate(pool.map(outcome, *zip(*given, strict=True)), options.start):
            ends[end] += 1
            _say(f"{number + 1:4d} {end:7} {_line(taken[number - options.start])}")
    return ends


def _line(mutant: Mutant) -> str:
    where = f"{mutant.file.relative_to(PACKAGE).as_posix()}:{mutant.lines[0]}"
    return f"{where} {mutant.kind}: {mutant.before.splitlines()[0]}  ->  {mutant.after.splitlines()[0]}"


if __name__ == "__main__":
    sys.exit(main())
