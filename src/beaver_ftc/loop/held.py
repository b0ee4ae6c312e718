"""One frame of the loop in which another than the scenario's law commands the surfaces."""

import numpy as np

from beaver_ftc.loop import steps
from beaver_ftc.loop.direct import direct
from beaver_ftc.loop.frame import NOT_FINITE


class HeldFrame:
    """A frame with the built-in diagnosis and a command held from outside; called as `frame.fly_frame` is.

    deflections: (surfaces,) rad, what is commanded at the end of each frame.
    """

    def __init__(self, frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> None:
        self.deflections = frames["belief"]["commanded"][0].copy()
        self._measure = direct(steps.measure, frames)
        self._diagnose = direct(steps.diagnose, frames)
        self._decide = direct(steps.decide, frames)
        self._command = direct(steps.take_command, frames, self.deflections)
        self._finish = direct(steps.finish, frames, references, log)

    def __call__(self, frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> int:
        """Fly one frame; see `frame.fly_frame`."""
        status: int = self._measure(frames)
        if status == NOT_FINITE:
            return status
        self._diagnose(frames)
        self._decide(frames)
        self._command(frames, self.deflections)
        self._finish(frames, references, log)
        return status
