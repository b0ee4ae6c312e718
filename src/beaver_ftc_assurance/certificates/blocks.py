"""Blocks of frames, by which types are tested where gyros are noisy (diagnosis/types/registry.py): to every
rule a block is a frame of several instants, whose bound has the noise of its two ends alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from beaver_ftc_assurance.certificates.inequality import Document, History, Term, directions
from beaver_ftc_assurance.certificates.tape import Tape

_MEANS = "offset", "slope", "spread"  # of the tape; of all else the last frame's counts
_SLOW_PER_S = 0.1  # of a filter that adds a block up


@dataclass(frozen=True)
class Blocks(History):
    """History by blocks of `length` rows, the first of which begins with row `begin` of `frames`."""

    frames: History
    begin: int
    length: int

    @property
    def said(self) -> Document:
        """Frames in a block, the first row, and the one after the last."""
        return {"block": [self.length, self.begin, self.begin + self.length * len(self.x)]}

    def rest(self, rows: slice) -> np.ndarray:
        """The mean over a block."""
        return self.mean(
            self.frames.rest(slice(*(self.begin + n * self.length for n in (rows.start, rows.stop))))
        )

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Of each block of these frames; of a part of one that is left over none."""
        n = len(values) // self.length
        blocks = values[: n * self.length].reshape(n, self.length, *values.shape[1:])
        return np.asarray(blocks.mean(axis=1))

    def added_up(self, k: int, asked: tuple[int, ...]) -> Iterator[list[Term]]:
        """Inequalities of all frames in block k, and in the one before, where each may have its own theta."""
        for end in (self.begin + n * self.length - 1 for n in (k, k + 1)):
            yield from ([Term(d, _SLOW_PER_S, end - self.length, end)] for d in directions(asked))


def by_blocks(history: History, length: int, begin: int) -> Blocks:
    """The blocks of this length, the first of which begins with this row."""
    none = np.empty((0, 3))
    of = Blocks(length * history.dt, 0.5, none, none, none, history.declared, history, begin, length)
    model, eta_bar = (of.mean(values[begin:]) for values in (history.model, history.eta_bar))
    return replace(of, x=history.x[begin + length - 1 :: length], model=model, eta_bar=eta_bar)


def in_blocks(tape: Tape, history: History, alarm: int) -> tuple[Tape, Blocks, int]:
    """Tape, history and alarm by the blocks that the types were held against."""
    diagnosis = tape.alarm.diagnosis
    length = diagnosis.types_config.block_frames
    begin = (alarm + 1 - diagnosis.frames_in_block) % length
    of, first = by_blocks(history, length, begin), ceil((tape.first - begin) / length)
    since = begin + first * length - tape.first
    kept = {
        name: of.mean(values[since:]) if name in _MEANS else values[since + length - 1 :: length]
        for name, values in tape.kept.items()
    }
    examined = replace(tape, first=first, frames=(tape.frames - since) // length, kept=kept)
    raised = max(ceil((alarm - begin) / length), 1)  # of the first block no one knows how it began
    return examined, of, raised


def rows_of(said: Document, span: Document) -> np.ndarray:
    """The log's rows of a term or bound of a statement."""
    length, begin, _ = said.get("block", (1, 0, 0))
    return np.arange(begin + span["first"] * length, begin + (span["frame"] + 1) * length)
