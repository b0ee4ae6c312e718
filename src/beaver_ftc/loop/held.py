"""One frame of the loop in which another than the scenario's law commands the surfaces."""

import numpy as np

from beaver_ftc.compiled import direct
from beaver_ftc.loop import stages
from beaver_ftc.loop.frame import NOT_FINITE


class HeldFrame:
    """A frame with the built-in diagnosis and a command held from outside; called as `frame.fly_frame` is.

    deflections: (surfaces,) rad, what is commanded at the end of each frame.
    """

    def __init__(self, frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> None:
        self.deflections = frames["commanded"][0].copy()
        self._sense = direct(stages.sense, frames)
        self._diagnose = direct(stages.diagnose, frames)
        self._decide_mode = direct(stages.decide_mode, frames)
        self._obey = direct(stages.obey, frames, self.deflections)
        self._close = direct(stages.close, frames, references, log)

    def __call__(self, frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> int:
        """Fly one frame; see `frame.fly_frame`."""
        status: int = self._sense(frames)
        if status == NOT_FINITE:
            return status
        self._diagnose(frames)
        self._decide_mode(frames)
        self._obey(frames, self.deflections)
        self._close(frames, references, log)
        return status
