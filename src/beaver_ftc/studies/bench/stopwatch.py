"""Timing side by side in one process: a machine's mood then strikes all contenders alike.

Time is this process's own processor time: others at work on the machine, and its disk, count little.
"""

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Contender(Protocol):
    """Something that flies a number of frames."""

    def prepare(self) -> None:
        """Go back to where every round starts; not timed."""

    def fly(self, frames: int) -> None:
        """Fly that many frames; timed."""


@dataclass(frozen=True)
class Timing:
    """A quantity over the rounds: its median, and the quartiles between which half the rounds lie."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: np.ndarray) -> "Timing":
        """values (rounds,), one a round."""
        low, median, high = (float(np.quantile(values, share)) for share in (0.25, 0.5, 0.75))
        return cls(median, low, high)


Clock = Callable[[], int]  # ns


def interleave(
    contenders: Sequence[Contender], rounds: int, frames: int, clock: Clock = time.process_time_ns
) -> np.ndarray:
    """Time all contenders in turn, A B C then C B A; microseconds a frame, (rounds, contenders).

    What is to be compared is formed within a round, which lasts some milliseconds, and condensed afterwards.
    """
    us = np.empty((rounds, len(contenders)))
    order = list(range(len(contenders)))
    collecting = gc.isenabled()
    gc.disable()
    try:
        for round_ in us:
            for i in order:
                round_[i] = _time(contenders[i], frames, clock)
            order.reverse()
    finally:
        if collecting:
            gc.enable()
    return us


def _time(contender: Contender, frames: int, clock: Clock) -> float:
    contender.prepare()
    start_ns = clock()
    contender.fly(frames)
    return (clock() - start_ns) / (1e3 * frames)
