"""Blocks of frames, by which types are tested where gyros are noisy (diagnosis/types/registry.py): every rule
takes a block as a frame of several instants, whose bound has the gyro noise of its two ends alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from beaver_ftc_assurance.certificates.inequality import Document, History, Term, axis_directions
from beaver_ftc_assurance.certificates.tape import Tape

# Quantities of a tape that a block has the mean of; of all others it has the value of its last frame
AVERAGED_QUANTITIES = "offset", "slope", "spread"
ADDING_POLE_PER_S = 0.1  # slow enough for the filter to add up a block
BLOCK_INSTANT_SHARE = 0.5  # any share below 1 says that a block has several instants


@dataclass(frozen=True)
class Blocks(History):
    """History by blocks of `length` rows, the first of which begins with row `begin` of `frames`."""

    frames: History
    begin: int
    length: int

    @property
    def statement_fields(self) -> Document:
        """Rows in a block, the first row, and the one after the last."""
        return {"block": [self.length, self.begin, self.begin + self.length * len(self.rates_rad_s)]}

    def unstated_bound(self, rows: slice) -> np.ndarray:
        """The mean over each block, (blocks, 3) rad/s2."""
        of_rows = slice(*(self.begin + n * self.length for n in (rows.start, rows.stop)))
        return self.mean(self.frames.unstated_bound(of_rows))

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Mean (blocks, ...) of values (frames, ...) over each whole block; an incomplete last one is left
        out."""
        n = len(values) // self.length
        blocks = values[: n * self.length].reshape(n, self.length, *values.shape[1:])
        return np.asarray(blocks.mean(axis=1))

    def summed_frame_tests(
        self, block: int, axes: tuple[int, ...], first_kept_frame: int
    ) -> Iterator[list[Term]]:
        """Inequalities of all frames in this block, and in the one before; theta may differ by frame. A block
        is left out if it begins before the effects of a fault are kept: after the frame `first_kept_frame`.
        """
        for end in (self.begin + n * self.length - 1 for n in (block, block + 1)):
            if end - self.length < first_kept_frame:
                continue
            yield from (
                [Term(direction, ADDING_POLE_PER_S, end - self.length, end)]
                for direction in axis_directions(axes)
            )


def by_blocks(history: History, length: int, begin: int) -> Blocks:
    """The blocks of `length` rows, the first of which begins with row `begin`."""
    none = np.empty((0, 3))
    empty = Blocks(
        length * history.dt, BLOCK_INSTANT_SHARE, none, none, none, history.declared, history, begin, length
    )
    return replace(
        empty,
        rates_rad_s=history.rates_rad_s[begin + length - 1 :: length],
        model_rad_s2=empty.mean(history.model_rad_s2[begin:]),
        eta_bar_rad_s2=empty.mean(history.eta_bar_rad_s2[begin:]),
    )


def in_blocks(tape: Tape, history: History, alarm_frame: int) -> tuple[Tape, Blocks, int]:
    """Tape, history and frame of the alarm by the blocks that types were tested with."""
    diagnosis = tape.alarm.diagnosis
    length = diagnosis.types_config.frames_per_block
    begin = (alarm_frame + 1 - diagnosis.n_frames_in_block_so_far) % length
    blocks, first_block = by_blocks(history, length, begin), ceil((tape.first - begin) / length)
    skipped = begin + first_block * length - tape.first
    kept = {
        name: blocks.mean(values[skipped:])
        if name in AVERAGED_QUANTITIES
        else values[skipped + length - 1 :: length]
        for name, values in tape.kept.items()
    }
    block_tape = replace(tape, first=first_block, frames=(tape.frames - skipped) // length, kept=kept)
    alarm_block = max(ceil((alarm_frame - begin) / length), 1)  # block 0 has no rates from before it
    return block_tape, blocks, alarm_block


def log_rows_of(said: Document, span: Document) -> np.ndarray:
    """The log's rows of a term or bound, `span`, of a statement."""
    length, begin, _ = said.get("block", (1, 0, 0))
    return np.arange(begin + span["first"] * length, begin + (span["frame"] + 1) * length)
