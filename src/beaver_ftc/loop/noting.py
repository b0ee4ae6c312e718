"""A flight of which every frame's measurements are noted as a plug-in detector would be shown them.

Compiled, since a detector in Python that notes the same costs seven times the frame. The columns of the notes
are those of `Notes`.
"""

import numpy as np

from beaver_ftc.compiled import direct, kernel
from beaver_ftc.diagnosis import Measured
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.assembly import y_places
from beaver_ftc.loop.log_row import put
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.stepping import detection_share, diagnose_one
from beaver_ftc.plant.sensing import NOT_FINITE


@kernel
def fly_and_note(frames, references, log, notes):
    """One frame, as `PluginFrame` flies it with a detector that raises no alarm.

    notes (frames, columns): row frame.k is filled. The rest, and what is returned: see `stepping.fly_frame`.
    """
    frame = frames[0]
    row = notes[frame.k]
    whole.begin(frame)
    if frame.departed == NOT_FINITE:
        return frame.departed
    row[0] = frame.t
    at = put(row, 1, frame.measured.x)
    at = put(row, at, frame.measured.y[: 4 + frame.truth.declared])
    means = frame.prediction.means
    at = put(row, at, means.F)
    for axis in range(3):
        at = put(row, at, means.Gu[axis])
    at = put(row, put(row, at, frame.fdi.bound.eta_bar), frame.measured.attitude)
    at = put(row, at, frame.measured.force)
    row[at] = frame.measured.altitude
    at = put(row, at + 1, frame.prediction.u)
    diagnose_one(frame)
    whole.decide(frame)
    whole.command(frame)
    whole.finish(frame, references[frame.row], log[frame.row])
    error_map = frame.fdi.bound.error_map
    at = put(row, at, error_map.e_now)
    row[at] = not error_map.outside
    row[at + 1] = detection_share(frames)
    return frame.departed


class Notes:
    """The notes of a flight as arrays, a row a frame flown; units as in `Measured`.

    inside (frames,): whether the flight is inside the aircraft's map of the model's error; error (frames, 3)
    rad/s2: the bound that the map gives there. statistic (frames,): of the built-in detection.
    """

    def __init__(self, loop: Loop) -> None:
        self._n, self._signals = len(loop.aircraft.surfaces), len(y_places(loop.frames[0]))
        widths = (1, 3, self._signals, 3, 3 * self._n, 3, 3, 3, 1, self._n, 3, 1, 1)
        self._ends = np.cumsum(widths)[:-1]
        self._rows, self._frames = np.zeros((loop.n_frames, sum(widths))), loop.frames
        compiled = direct(fly_and_note, loop.frames, loop.references, loop.log, self._rows)
        loop.fly_frame = lambda frames, references, log: compiled(frames, references, log, self._rows)

    def read(self) -> None:
        """Read the rows of the frames flown."""
        rows = self._rows[: int(self._frames["k"][0])]
        (
            t, x, y, model, Gu, eta_bar, attitude, force, altitude, u, self.error, inside, statistic,
        ) = np.split(rows, self._ends, axis=1)  # fmt: skip
        self.inside, self.statistic = inside[:, 0] > 0.0, statistic[:, 0]
        Gu = Gu.reshape(-1, 3, self._n)
        times, altitudes = t[:, 0].tolist(), altitude[:, 0].tolist()
        shown = zip(times, x, y, model, Gu, eta_bar, attitude, force, altitudes, strict=True)
        self.seen = list(zip(map(Measured._make, shown), u, strict=True))
