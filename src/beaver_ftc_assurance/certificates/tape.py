"""Record internal quantities of the diagnosis during a flight: in a ring buffer of the last frames up to the
alarm, and of every frame after it, up to MAX_FRAMES_AFTER_ALARM.

The quantities are copied as *words* of 8 bytes out of the flight's record, an array (1,) of `frame_dtype`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from beaver_ftc.compiled import copy, direct, kernel
from beaver_ftc.diagnosis import estimator_names
from beaver_ftc.diagnosis.detection import N_SLOTS
from beaver_ftc.loop import (
    FrameReadout,
    Loop,
    alarm_flags,
    copy_memory,
    fly,
    give_back_memory,
    recorded_arrays,
    take_memory,
)
from beaver_ftc.scenario import Scenario

FRAMES_BEFORE_ALARM = 40  # frames kept before the alarm; the filters contain the effects of earlier ones
STATISTICAL_FRAMES_BEFORE_ALARM = 2**N_SLOTS + 2  # with the statistical detector: from its oldest onset on
SEEN, ALARM, CLEAR, FLAG, OTHER_FLAG = range(5)  # positions in the state of `keep_frame`
# Time after the last event if fault types are tested, each of which may be excluded later.
KEPT_AFTER_EVENT_S = 10.0
MAX_FRAMES_AFTER_ALARM = 1 << 16  # frames kept after the alarm; the memory is used as they come


@dataclass
class Tape:
    """Frames `first` to `first + frames - 1` of the flight, rows of its log.

    alarm, last: the flight at the alarm (without one, at its end) and at its end. since: the frame with which
    the diagnosis began. names: of the isolation estimators. kept: name -> quantity (frames, ...), which is
    also an attribute of the tape:

        offset, slope, spread (estimators, 3)   effect of each estimator's fault, rad/s2; slope: for a unit
                                                of the fault's parameter
        excluded (estimators,)                  above 0 for an excluded fault
        types (surfaces, types)                 above 0 for an excluded type
        command_low, command_high               least and greatest command of each surface, rad
        least, greatest                         the same of the position of a healthy surface, rad

    The last four are kept only if the fault class is `all`.

    filters: name -> filter state of the statistical detector, by frame up to the alarm. reach_low, reach_high
    (estimators, poles, 4): bounds on the effect of a fault in the detection filters before the first frame.
    """

    first: int
    frames: int
    since: int
    alarm: FrameReadout
    last: FrameReadout
    names: tuple[str, ...]
    reach_low: np.ndarray
    reach_high: np.ndarray
    kept: dict[str, np.ndarray]
    filters: dict[str, np.ndarray]

    def __getattr__(self, name: str) -> np.ndarray:
        """A quantity over the frames, (frames, ...)."""
        if name.startswith("_") or name not in self.kept:
            raise AttributeError(name)
        return self.kept[name]

    @property
    def end(self) -> int:
        """The number of the frame after the last."""
        return self.first + self.frames


class _RecordWords:
    """The positions of quantities in a record, as numbers of its words; reads the quantities back from copied
    words."""

    def __init__(self, views: dict[str, np.ndarray]) -> None:
        """views: name -> the quantity in a record in which each word holds its own number."""
        quantities = {name: np.ascontiguousarray(view) for name, view in views.items()}
        self.words = np.concatenate([view.view(np.int64).ravel() for view in quantities.values()])
        self._what = {name: (view.dtype, view.shape, view.nbytes // 8) for name, view in quantities.items()}

    def read(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Name -> quantity (frames, ...), from the words that were copied in each frame, rows (frames,
        words)."""
        quantities = {}
        first_word = 0
        for name, (dtype, shape, n) in self._what.items():
            words = np.ascontiguousarray(rows[:, first_word : first_word + n])
            quantities[name] = words.view(dtype).reshape(len(rows), *shape)
            first_word += n
        return quantities


class Recorder:
    """Copies the quantities of a `Tape` from the record of a flight at each `keep`."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def watch(self, loop: Loop) -> Callable[[], None]:
        """Copy every frame of a flight. Returns the function that the flight calls at its end."""
        self.begin(loop.frames)
        loop.after_frame = self.keep
        return self.land

    def begin(self, frames: np.ndarray) -> None:
        """Begin to copy frames of the record `frames`, the first of them number 0.

        numbers: a record in which each word holds its own number. _ring: rows of the ring for the words that
        are kept up to the alarm only (`early`); _kept: rows of the ring, then of the frames after the alarm,
        for those that are kept `always`.
        """
        numbers = take_memory((1,), frames.dtype)
        _words_of(numbers)[:] = np.arange(frames.nbytes // 8)
        config = self._scenario.fdi
        n = len(FrameReadout(frames[0]).diagnosis.estimators)
        every_type = config.fault_class == "all"
        statistical = config.statistical is not None
        self._always, self._early = map(_RecordWords, recorded_arrays(numbers[0], n, every_type, statistical))
        self._state = np.array([0, -1, 0, *alarm_flags(numbers[0])])
        give_back_memory(numbers)
        ring = 1 + (STATISTICAL_FRAMES_BEFORE_ALARM if statistical else FRAMES_BEFORE_ALARM)
        self._ring = np.empty((ring, len(self._early.words)), np.int64)
        self._kept = np.empty((ring + MAX_FRAMES_AFTER_ALARM, len(self._always.words)), np.int64)
        self._frames = frames
        self._alarm = copy_memory(frames)
        self._arguments = (
            _words_of(frames), self._always.words, self._early.words, self._kept, self._ring,
            _words_of(self._alarm), self._state,
        )  # fmt: skip
        self._keep_frame = direct(keep_frame, *self._arguments)

    def land(self) -> None:
        """Copy the whole record at the end of the flight."""
        self._last = copy_memory(self._frames)

    def keep(self) -> None:
        """Copy the quantities of the present frame."""
        self._keep_frame(*self._arguments)

    def tape(self, events: Sequence[int], rows: int) -> Tape:
        """The tape of the frames around `events`. rows: number of frames of the flight.

        first: the first frame that is in the ring for the first event and for the alarm, not before the
        diagnosis began or the last alarm was withdrawn. end: the frame after the last one, `after` frames
        from the last event on, as far as frames are kept, not after a restart of the diagnosis. before: rows
        of the ring with the frames up to the alarm.
        """
        last = FrameReadout(self._last[0])
        config = self._scenario.fdi
        seen, alarm, clear = self._state[[SEEN, ALARM, CLEAR]].tolist()
        ring = len(self._ring)
        raised = alarm >= 0
        alarm, at_alarm = (alarm, FrameReadout(self._alarm[0])) if raised else (seen - 1, last)
        since = at_alarm.since
        restarted = last.since
        after = round(KEPT_AFTER_EVENT_S * self._scenario.rate_hz) if config.fault_class == "all" else 1
        first = max(min(events) - ring + 1, alarm - ring + 1, since, clear, 0)
        end = min(max(events) + after, rows, alarm + 1 + len(self._kept) - ring)
        if restarted > alarm:  # another diagnosis began
            end = min(end, restarted)
        before = np.arange(first, min(alarm + 1, end)) % ring
        early = self._early.read(self._ring[before])
        return Tape(
            first=first, frames=end - first, since=since, alarm=at_alarm, last=last,
            names=estimator_names(config.fault_class, self._scenario.airframe),
            reach_low=early.pop("reach_low")[0], reach_high=early.pop("reach_high")[0],
            kept=self._always.read(self._kept[np.r_[before, ring : ring + end - first - len(before)]]),
            filters=early,
        )  # fmt: skip


@kernel
def keep_frame(record, always, early, kept, ring, alarm, state):
    """Copy words of a record (words,): those `always` in every frame, those `early` up to the alarm. Up to
    the alarm they go into a ring of rows, as the first rows of `kept` and of `ring`; after it into the rows
    of `kept` behind the ring, until `kept` is full. At the alarm, `alarm` becomes a copy of the record. If
    both flags are cleared, the ring goes on.

    state (5,), by position: SEEN, number of frames so far; ALARM, frame of the alarm, or -1; CLEAR, frame in
    which the last alarm was withdrawn; FLAG and OTHER_FLAG, positions in the record of the two alarm flags.
    """
    k = state[SEEN]
    rows = len(ring)
    state[SEEN] = k + 1
    if record[state[FLAG]] == 0 and record[state[OTHER_FLAG]] == 0:
        if state[ALARM] >= 0:
            state[ALARM] = -1
            state[CLEAR] = k
    elif state[ALARM] < 0:
        state[ALARM] = k
        copy(record, alarm)
    after = k - state[ALARM] if state[ALARM] >= 0 else 0
    row = k % rows if after == 0 else rows - 1 + after
    if row >= len(kept):
        return
    for j in range(len(always)):
        kept[row, j] = record[always[j]]
    if after == 0:
        for j in range(len(early)):
            ring[row, j] = record[early[j]]


def _words_of(frames: np.ndarray) -> np.ndarray:
    """The memory (words,) of a record from `take_memory` or `copy_memory`, in words of 8 bytes."""
    assert frames.base is not None
    return frames.base[: frames.nbytes].view(np.int64)


def tape_of_flight_again(scenario: Scenario, events: Sequence[int], rows: int) -> Tape:
    """`Recorder.tape` of a scenario, which is flown again for it."""
    recorder = Recorder(scenario)
    fly(scenario, watch=recorder.watch)
    return recorder.tape(events, rows)
