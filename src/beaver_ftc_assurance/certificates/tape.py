"""Records the internal quantities of the diagnosis while it flies: a ring buffer of the last frames before
the alarm, and every frame after it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from beaver_ftc.compiled import direct, kernel
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

FRAMES_BEFORE_ALARM = 40  # frames kept before the alarm: what was before them is in the filters
STATISTICAL_FRAMES_BEFORE_ALARM = 2**N_SLOTS + 2  # with the statistical detector: its oldest onset
SEEN, ALARM, CLEAR, FLAG, OTHER_FLAG = range(5)  # places in the state of `keep_frame`
KEPT_AFTER_EVENT_S = 10.0  # after the last event, where types are excluded one by one
MAX_FRAMES_AFTER_ALARM = 1 << 16  # frames kept after the alarm; memory is taken as they come


@dataclass
class Tape:
    """Frames `first` to `first + frames - 1` of the flight, rows of its log.

    alarm, last: the flight at the alarm and at its end. since: the frame with which the diagnosis began.
    kept, by frame: of each isolation estimator `offset` (rad/s2), `slope` (rad/s2 per unit of its parameter)
    and `spread` (rad/s2) of its fault's effect, (estimators, 3); `excluded` (estimators,) and `types`
    (surfaces, types), above 0 for what is excluded; and, if the fault class is `all`, of each surface, rad,
    `command_low` and `command_high`, the least and greatest command, `least` and `greatest`, the same of the
    position of a healthy surface.
    filters: the filter states of the statistical detector, by frame up to the alarm. reach_low, reach_high
    (estimators, poles, 4): bounds on the effect of a fault in the filters before the first frame.
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
        """The frame after the last."""
        return self.first + self.frames


class _RecordWords:
    """The places of quantities in a record, as numbers of its words (8 bytes); reads them back from rows."""

    def __init__(self, views: dict[str, np.ndarray]) -> None:
        """views: of a record each word of which is its own number."""
        found = {name: np.ascontiguousarray(view) for name, view in views.items()}
        self.words = np.concatenate([view.view(np.int64).ravel() for view in found.values()])
        self._what = {name: (view.dtype, view.shape, view.nbytes // 8) for name, view in found.items()}

    def read(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """The quantities, (frames, ...), that were kept as rows (frames, words)."""
        found = {}
        place = 0
        for name, (dtype, shape, n) in self._what.items():
            words = np.ascontiguousarray(rows[:, place : place + n])
            found[name] = words.view(dtype).reshape(len(rows), *shape)
            place = place + n
        return found


class Recorder:
    """Copies the quantities of a `Tape` from a flight's record, (1,) of `frame_dtype`, at each `keep`."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def watch(self, loop: Loop) -> Callable[[], None]:
        """Keep every frame of a flight. Returns the function to call when the flight ends."""
        self.begin(loop.frames)
        loop.after_frame = self.keep
        return self.land

    def begin(self, frames: np.ndarray) -> None:
        """Begin to keep frames of the record `frames`, the first of them number 0."""
        numbers = take_memory((1,), frames.dtype)
        _words_of(numbers)[:] = np.arange(frames.nbytes // 8)
        config = self._scenario.fdi
        n = len(FrameReadout(frames[0]).diagnosis.estimators)
        every_type = config.fault_class == "all"
        statistical = config.statistical is not None
        arrays = recorded_arrays(numbers[0], n, every_type, statistical)
        self._always, self._early = map(_RecordWords, arrays)
        self._state = np.array([0, -1, 0, *alarm_flags(numbers[0])])
        give_back_memory(numbers)
        ring = 1 + (STATISTICAL_FRAMES_BEFORE_ALARM if statistical else FRAMES_BEFORE_ALARM)
        self._ring = np.empty((ring, len(self._early.words)), np.int64)
        self._kept = np.empty((ring + MAX_FRAMES_AFTER_ALARM, len(self._always.words)), np.int64)
        self._frames = frames
        self._alarm = copy_memory(frames)
        words = _words_of(frames)
        alarm = _words_of(self._alarm)
        places = self._always.words, self._early.words
        self._arguments = words, *places, self._kept, self._ring, alarm, self._state
        self._keep_frame = direct(keep_frame, *self._arguments)

    def land(self) -> None:
        """Keep the record as it is at the end."""
        self._last = copy_memory(self._frames)

    def keep(self) -> None:
        """Keep what stands in the record."""
        self._keep_frame(*self._arguments)

    def tape(self, events: Sequence[int], rows: int) -> Tape:
        """The frames around `events`. rows: number of frames of the flight."""
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
    """Copy the words `always` of a record (words,) and, up to the alarm, the words `early`: up to the alarm
    into a ring of rows, after it into the rows of `kept` behind the ring. At the alarm `alarm` becomes a copy
    of the record.

    state (5,), by place: SEEN, number of frames; ALARM, frame of the alarm, or -1; CLEAR, frame in which the
    last alarm was withdrawn; FLAG and OTHER_FLAG, places in the record of the two alarm flags.
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
        alarm[:] = record
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
    """`Recorder.tape` of a scenario that is flown again for it."""
    recorder = Recorder(scenario)
    fly(scenario, watch=recorder.watch)
    return recorder.tape(events, rows)
