"""What the diagnosis supposed, frame by frame: kept by flying the same flight again, which is the same to the
bit. So the first flight pays nothing for its certificate.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beaver_ftc.diagnosis.isolation import estimator_names
from beaver_ftc.loop import memory
from beaver_ftc.loop.loop import CHUNK_ROWS, FLYING, Loop
from beaver_ftc.scenario.schema import Scenario

BEFORE = 40  # frames kept before the first event: what was before them is in the filters
BEFORE_CHANCE = 130  # with the statistical detector, whose evidence builds up
AFTER_S = 10.0  # after the last one, where types are excluded one by one


@dataclass
class Tape:
    """Frames `first` to `first + len(x) - 1` of the flight, rows of its log.

    alarm, last: the flight's record as it was at the alarm and at the end, of `frame_dtype`. since: the frame
    with which the diagnosis began. Of each frame x (3,) rad/s, model and eta_bar (3,) rad/s2, what a gyro's
    error changes by noise (3,) rad/s, and of each estimator offset, slope and spread (estimators, 3): rad/s2,
    and per unit of its parameter. reach (estimators, poles, 4): what a fault can have done to the filters
    before.
    """

    first: int
    since: int
    alarm: np.void
    last: np.void
    names: tuple[str, ...]
    reach_low: np.ndarray
    reach_high: np.ndarray
    kept: dict[str, np.ndarray]
    frames: int = 0
    chances: dict[str, list[np.ndarray]] = field(default_factory=dict)

    def __getattr__(self, name: str) -> np.ndarray:
        """A quantity over the frames, (frames, ...)."""
        if name.startswith("_") or name not in self.kept:
            raise AttributeError(name)
        return self.kept[name][: self.frames]

    @property
    def end(self) -> int:
        """The frame after the last."""
        return self.first + self.frames

    def at(self, k: int) -> int:
        """The place of frame k."""
        return k - self.first


def recorded(scenario: Scenario, events: Sequence[int], rows: int) -> Tape:
    """Fly again and keep the frames around these, of so many rows; the first of them is the alarm's."""
    loop = Loop(scenario)
    try:
        first, end = span(scenario, events, rows)
        return record(loop.frames, _flown(loop, first, end), scenario, events, end)
    finally:
        loop.release()


def span(scenario: Scenario, events: Sequence[int], rows: int) -> tuple[int, int]:
    """The first frame to keep around these, of so many rows, and the one after the last."""
    before = BEFORE if scenario.fdi.statistical is None else BEFORE_CHANCE
    after = round(AFTER_S * scenario.rate_hz) if scenario.fdi.fault_class == "all" else 1
    return max(min(events) - before, 0), min(max(events) + after, rows)


def record(
    frames: np.ndarray, flown: Iterable[int], scenario: Scenario, events: Sequence[int], end: int
) -> Tape:
    """Keep what stands in the record `frames` (1,) after each frame that has been flown, up to `end`."""
    tape: Tape | None = None
    views: dict[str, Any] = {}
    chance, frame = scenario.fdi.statistical is not None, frames[0]
    for k in flown:
        if tape is None or tape.since != int(frame["since"]):  # another diagnosis has begun
            tape, views = _begun(frame, scenario, end - k)
        for name, view in views.items():
            tape.kept[name][tape.frames] = view
        tape.frames += 1
        if chance and k <= events[0]:
            tape.chances.setdefault("blocks", []).append(frame["fdi"]["statistical"]["block"].copy())
            tape.chances.setdefault("bounded", []).append(
                frame["fdi"]["statistical"]["noise"]["bounded"].copy()
            )
        if k == events[0]:
            tape.alarm = memory.copied(frames)[0]
    assert tape is not None
    tape.last = memory.copied(frames)[0]
    return tape


def _flown(loop: Loop, first: int, end: int) -> Iterator[int]:
    """Fly to frame `end`; yield after each frame from `first` on."""
    turn_at = 0
    for start in range(0, end, CHUNK_ROWS):
        k, stop = start, min(start + CHUNK_ROWS, end)
        loop.sample_references(start, min(CHUNK_ROWS, loop.n_frames - start))
        while k < stop:
            if k >= turn_at:
                turn_at = loop.turn_to(k)
            to = min(turn_at, stop, max(k + 1, first))
            status = loop.fly_segment(k, to)
            k = to
            if k > first:
                yield k - 1
            if status != FLYING:
                return


def _begun(frame: np.void, scenario: Scenario, n: int) -> tuple[Tape, dict[str, Any]]:
    """A tape of n frames that begins with this one, and where in the record each quantity stands."""
    fdi, isolation = frame["fdi"], frame["fdi"]["isolation"]
    config = scenario.fdi
    estimators = isolation["estimator"][: int(isolation["n"])]
    names = estimator_names(config.fault_class, scenario.airframe)
    views = {
        "x": frame["measured"]["x"], "model": frame["belief"]["means"]["acceleration"],
        "eta_bar": fdi["bound"]["eta_bar"], "noise": fdi["bound"]["noise"],
        "offset": estimators["effect"]["offset"], "slope": estimators["effect"]["Z"],
        "spread": estimators["effect"]["spread"], "excluded": estimators["excluded"],
        "types": fdi["types"]["surface"]["type_excluded"],
    }  # fmt: skip
    if config.fault_class == "all":  # what the surfaces were told, and where healthy ones were
        orders = fdi["types"]["surface"]["orders"]
        views |= {"told_least": orders["low"], "told_most": orders["high"]}
        views |= {name: orders[name] for name in ("least", "greatest")}
    k = int(frame["k"]) - 1
    reach = estimators["reach_low"].copy(), estimators["reach_high"].copy()
    kept = {name: np.empty((n, *view.shape), view.dtype) for name, view in views.items()}
    tape = Tape(k, int(frame["since"]), frame, frame, names, *reach, kept)
    return tape, views
