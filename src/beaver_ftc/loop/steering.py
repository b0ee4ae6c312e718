"""A stick in a flight flown step by step: what it adds to the scenario's reference, and what it has added."""

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.loop.loop import CHUNK_ROWS, Loop
from beaver_ftc.scenario.signals import RAD_PER_DEG, sample_deg_s
from beaver_ftc.scenario.sticks import StickTrack

Vector = NDArray[np.float64]


class Steering:
    """The stick of one flight; `track` keeps its movements."""

    def __init__(self, loop: Loop) -> None:
        self._loop, self._scenario = loop, loop.scenario
        self._base: tuple[int, Vector] | None = None
        self.track = StickTrack()

    def put(self, k: int, stop: int, stick_deg_s: Vector | None) -> None:
        """Add the stick, (3,) deg/s, to the references of frames k to stop, all in one chunk of the log.

        The sum is formed in deg/s, as a scenario that says the same forms it: to the bit.
        """
        self.track.move(k, stick_deg_s)
        if stick_deg_s is not None:
            row = slice(k % CHUNK_ROWS, k % CHUNK_ROWS + stop - k)
            self._loop.references[row] = (self._base_deg_s(k)[row] + stick_deg_s) * RAD_PER_DEG

    def _base_deg_s(self, k: int) -> Vector:
        """The scenario's own references of the chunk that frame k is in, (rows, 3) deg/s."""
        start = k - k % CHUNK_ROWS
        if self._base is None or self._base[0] != start:
            end = min(start + CHUNK_ROWS, self._loop.n_frames)
            t = np.arange(start, end) / self._scenario.rate_hz
            self._base = start, sample_deg_s(self._scenario.reference, t)
        return self._base[1]
