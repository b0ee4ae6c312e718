"""Fly cases on several cores; the results are in the order of the cases whatever the number of workers."""

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypeVar

from beaver_ftc.studies.compare.flights import Case
from beaver_ftc.studies.compare.trial import Entry, Trial, fly_case

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

In = TypeVar("In")
Out = TypeVar("Out")


def fly_cases(
    cases: Sequence[Case],
    entries: Sequence[Entry],
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> list[Trial]:
    """Every case with every entry."""
    return spread(partial(fly_case, entries=entries), cases, workers, progress)


def spread(
    work: Callable[[In], Out],
    items: Sequence[In],
    workers: int,
    progress: Callable[[float], None] | None = None,
) -> list[Out]:
    """work(item) of every item, in order, by this many processes."""
    done: list[Out] = []
    for result in map(work, items) if workers == 1 else _in_processes(work, items, workers):
        done.append(result)
        if progress:
            progress(len(done) / len(items))
    return done


def _in_processes(work: Callable[[In], Out], items: Sequence[In], workers: int) -> Iterator[Out]:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    for name in _ONE_THREAD:  # the cores are taken by the flights
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(work, items)
