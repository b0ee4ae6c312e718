"""`python -m tools.mutants`: draw mutants by seed, put each on trial, count and list those that live."""

import argparse
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import hypothesis
import numba
import pandas
import pydantic
import scipy.linalg
import scipy.optimize
import scipy.stats

from tools.mutants.making import Mutant
from tools.mutants.marks import reaching
from tools.mutants.scope import GLUE, SOURCES, drawn, left_out, stale
from tools.mutants.trial import HANGS, KILLED, outcome

LEAST = 85.0  # per cent
LIBRARIES = (hypothesis, numba, pandas, pydantic, scipy)  # loaded once here, not once in each child


def main() -> int:
    """Exit status 0 if at least LEAST per cent of the mutants die."""
    options = _options()
    for name in stale():
        _say(f"equivalent.yaml: no such mutant: {name}")
    every, numbers = drawn(options.seed, options.modules)
    taken = every[: options.count]
    made = " and ".join(f"{number} of the {kind}" for kind, number in numbers.items())
    _say(f"mutants that can be made: {made}; none of")
    for line in left_out():
        _say(f"  {line}")
    ends = _trials(taken, options.jobs)
    for kind in numbers:
        of = {end: number for (its, end), number in sorted(ends.items()) if its == kind}
        _say(f"{kind}: {', '.join(f'{number} {end.lower()}' for end, number in of.items()) or 'none drawn'}")
    dead = sum(number for (_, end), number in ends.items() if end in (KILLED, HANGS))
    _say(f"{dead} of {len(taken)} mutants killed (seed {options.seed})")
    return int(100 * dead < LEAST * len(taken))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100, help="how many of the seed's mutants")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes side by side")
    parser.add_argument("modules", nargs="*", default=["**/*.py"], help="patterns below src")
    return parser.parse_args()


def _say(text: str) -> None:
    print(text, flush=True)


def _trials(taken: list[tuple[str, Mutant]], jobs: int) -> Counter[tuple[str, str]]:
    """How often mutants of each kind came to each end, tried side by side."""
    ends: Counter[tuple[str, str]] = Counter()
    kinds, mutants = zip(*taken, strict=True)
    glue = [mutant for kind, mutant in taken if kind == GLUE]
    found = dict(zip(glue, reaching(glue, jobs) if glue else [], strict=True))
    reached = [found.get(mutant, set()) for mutant in mutants]
    with ProcessPoolExecutor(jobs, mp_context=get_context("fork")) as pool:
        done = pool.map(outcome, mutants, kinds, reached)
        for number, ((kind, mutant), end) in enumerate(zip(taken, done, strict=True), 1):
            ends[kind, end] += 1
            _say(f"{number:4d} {kind} {end:7} {_line(mutant)}")
    return ends


def _line(mutant: Mutant) -> str:
    where = f"{mutant.file.relative_to(SOURCES).as_posix()}:{mutant.lines[0]}"
    return f"{where} {mutant.kind}: {mutant.before.splitlines()[0]}  ->  {mutant.after.splitlines()[0]}"


if __name__ == "__main__":
    sys.exit(main())
