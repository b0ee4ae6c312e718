"""Exclusions of fault types by their course: what single frames say of where the surface was, compared.

In each frame that health does not explain the surface was between two bounds; a type forbids some of what
they say together (theory.md, section 4). A rule has the surface `Seen`, and yields what it finds.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi

import numpy as np

from beaver_ftc.diagnosis import Actuator, TypesConfig
from beaver_ftc.diagnosis.types import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis.types import TYPE_WORDS as WORDS
from beaver_ftc.scenario import Scenario
from beaver_ftc_assurance.certificates.inequality import Document, History, Hypothesis, by_each_frame
from beaver_ftc_assurance.certificates.kinds import wrong
from beaver_ftc_assurance.certificates.tape import Tape

_LEAST = 1e-9  # rad: by less no two positions are compared
Pair = tuple[float, float]  # what must be more, than what


@dataclass(frozen=True)
class Seen:
    """Where a surface was by frame from `first` on, by axis `least` to `most` (frames, 3), rad; mirrored by
    sign -1, so that a type needs one rule.

    command: where a healthy one was; commands (frames, 3): by each axis, which has a mean of its own where
    the effectiveness changes within the frame; room (frames, 2): how far below and above that within the
    frame, of several instants. wrong: health explains nothing. ordered: what it was told, at most. stops: low
    and high. slowest_rad_s: of an oscillation.
    """

    first: int
    sign: int
    least: np.ndarray
    most: np.ndarray
    command: np.ndarray
    commands: np.ndarray
    room: np.ndarray
    wrong: np.ndarray
    ordered: np.ndarray
    stops: np.ndarray
    slowest_rad_s: float

    @cached_property
    def low(self) -> np.ndarray:
        """By all axes."""
        return np.asarray(self.least.max(axis=1))

    @cached_property
    def high(self) -> np.ndarray:
        """By all axes."""
        return np.asarray(self.most.min(axis=1))

    def off_command(self) -> tuple[np.ndarray, np.ndarray]:
        """How far off its command it was, at least and at most; unlimited at the stop that may hide it."""
        least = self.wrong & (self.low - self.room[:, 0] > self.stops[0] + _LEAST)
        most = self.wrong & (self.high + self.room[:, 1] < self.stops[1] - _LEAST)
        low = np.where(least, self.low - self.command, -np.inf)
        return low, np.where(most, self.high - self.command, np.inf)

    def since(self, beyond: np.ndarray) -> np.ndarray:
        """Of each frame the first of the unbroken run of frames `beyond` that it ends; one later if none."""
        places = np.arange(len(beyond))
        return np.maximum.accumulate(np.where(beyond, 0, places + 1))


@dataclass(frozen=True)
class Found:
    """Frames whose bounds from below are compared, by which axis, and the one whose bound from above is."""

    run: range
    beside: int | None
    compared: list[Pair]
    said: Document = field(default_factory=dict)
    axis: int | None = None  # None: the one that says most


def _bias(seen: Seen, actuator: Actuator, config: TypesConfig) -> Iterator[Found]:
    """One offset: at least what one frame says, and less by another."""
    low, high = seen.off_command()
    i, j = int(np.argmax(low)), int(np.argmin(high))
    if low[i] > high[j] + _LEAST:
        yield from _offsets(seen, i, j)


def _growing(seen: Seen, actuator: Actuator, config: TypesConfig) -> Iterator[Found]:
    """Of one sign, and smaller than it was."""
    low, high = seen.off_command()
    for j in np.flatnonzero(high < np.inf).tolist():
        i = int(np.argmax(low[: j + 1]))
        if i < j and low[i] > max(high[j], 0.0) + _LEAST:
            for found in _offsets(seen, i, j):
                (off, _), frames = found.compared[0], (seen.first + j, seen.first + i)
                if off > 0.0:
                    yield replace(found, compared=[(off, 0.0), *found.compared, frames])
            return


def _offsets(seen: Seen, i: int, j: int) -> Iterator[Found]:
    """Two offsets, away from the stops: these as far as the command comes near them within the frames."""
    commands = seen.commands[i, seen.least[i].argmax()], seen.commands[j, seen.most[j].argmin()]
    low, high = seen.stops[0] + seen.room[i, 0], seen.stops[1] - seen.room[j, 1]
    off = seen.low[i] - commands[0], seen.high[j] - commands[1]
    pairs = [off, (seen.low[i], low), (high, seen.high[j])]
    if off[0] > off[1]:
        yield Found(range(i, i + 1), j, pairs, {"stops": [float(low), float(high)]})


def _runaway(seen: Seen, actuator: Actuator, config: TypesConfig) -> Iterator[Found]:
    """Less far than its least rate takes it; of several instants, by the frame before."""
    pace, stop = actuator.least_runaway_rad_s, seen.stops[1]
    step, late = pace * config.block_s, int(not config.single_instant)
    began = np.where(seen.wrong, seen.low - step * np.arange(len(seen.low)), -np.inf)
    for j in np.flatnonzero(seen.wrong & (seen.high < stop - _LEAST)).tolist():
        if j <= late:
            continue
        i = int(np.argmax(began[: j - late]))
        reached = seen.low[i] + step * (j - i - late)
        if seen.wrong[i] and reached > seen.high[j] + _LEAST:
            pairs = [(stop, seen.high[j]), (seen.first + j, seen.first + i), (reached, seen.high[j])]
            yield Found(range(i, i + 1), j, pairs, {"stops": [float(stop)], "pace_rad_s": pace})
            return


def _swing(seen: Seen, actuator: Actuator, config: TypesConfig) -> Iterator[Found]:
    """On one side for longer than half of the slowest oscillation."""
    for axis, low in enumerate(seen.least.T):
        begins = seen.since(seen.wrong & (low > seen.command + _LEAST))
        for k in np.flatnonzero(np.arange(len(begins)) - begins > config.half_cycle_frames)[:1].tolist():
            run = range(int(begins[k]), k + 1)
            slowest = pi / seen.slowest_rad_s / config.dt_s
            pairs = [(k - run[0], slowest), *_beyond(low - seen.command, run)]
            yield Found(run, None, pairs, {"slowest_rad_s": seen.slowest_rad_s}, axis)


def _slow(seen: Seen, actuator: Actuator, config: TypesConfig) -> Iterator[Found]:
    """Further away from all that it was ordered to than one can be that comes nearer at its least pace, until
    its lag makes the steps smaller."""
    step = actuator.slowest_step_rad
    least, close = config.instants * config.block_frames * step, step / actuator.approach
    for axis, low in enumerate(seen.least.T):
        beyond = seen.wrong & (low > seen.ordered + _LEAST)
        begins, comes = seen.since(beyond), seen.high + least * np.arange(len(low))
        for k in np.flatnonzero(beyond & (begins < np.arange(len(low)))).tolist():
            i = int(begins[k]) + int(np.argmin(comes[begins[k] : k]))
            run, top = range(i, k + 1), seen.high[i] - least * (k - i - 1)
            near = float(seen.ordered[i : k + 1].max()) + close
            if low[k] > max(top, near) + _LEAST:
                said = {"ordered": seen.ordered[i : k + 1].tolist(), "near": near}
                said |= {"step": least} if k - i > 1 else {}
                pairs = [*_beyond(low - seen.ordered, run), (low[k], top), (low[k], near), (1.0, 0.0)]
                yield Found(run, i, pairs, said, axis)
                return


def _beyond(ahead: np.ndarray, run: range) -> list[Pair]:
    """In every frame of the run by more than nothing."""
    here = ahead[run[0] : run[-1] + 1]
    return [(here.min(), 0.0), (here.sum(), 0.0)]


# By the type in words; a type without a rule is not certified by its course.
RULES: dict[str, Callable[[Seen, Actuator, TypesConfig], Iterator[Found]]] = {
    "hardover up": _runaway, "hardover down": _runaway, "bias": _bias, "bias that grows": _growing,
    "oscillatory": _swing, "rate_limit": _slow,
}  # fmt: skip


def excludes(
    scenario: Scenario, tape: Tape, history: History, of: Hypothesis, s: int, kind: int, alarm: int
) -> Document | None:
    """What excludes a type on surface s by its course; None where single frames do not.

    of: that the surface is held somewhere, theta.
    """
    diagnosis = tape.last.diagnosis
    direction = TYPES[kind].direction
    for sign in (direction,) if direction else (1, -1):
        seen = _seen(tape, history, of, s, alarm, sign, scenario.fdi.slowest_oscillation_rad_s)
        for found in RULES[WORDS[kind]](seen, diagnosis.surfaces[s].actuator, diagnosis.types_config):
            return _written(found, seen, of)
    return None


def _seen(
    tape: Tape, history: History, of: Hypothesis, s: int, alarm: int, sign: int, slowest_rad_s: float
) -> Seen:
    """The frames from the alarm on that the types have judged."""
    frames = np.arange(alarm, tape.end - 1)
    here, whole = slice(alarm - tape.first, tape.end - 1 - tape.first), history.share == 1.0
    least, most, _ = by_each_frame(of, history, frames)
    if sign < 0:
        least, most = -most, -least
    slope = of.slope[here]
    commands = -sign * of.offset[here] / np.where(slope == 0.0, np.inf, slope)
    command = commands[:, np.abs(slope).sum(axis=0).argmax()]
    told = tape.command_high if sign > 0 else -tape.command_low
    reach = np.column_stack([tape.least[here, s, 0], tape.greatest[here, s, 0]])[:, ::sign] * sign
    room = np.maximum(0.0, (command[:, None] - reach) * (1.0, -1.0)) * (not whole)
    actuator = tape.last.diagnosis.surfaces[s].actuator
    stops = np.sort(sign * np.array([actuator.travel_low_rad, actuator.travel_high_rad]))
    judged = slice(here.start + 1, here.stop + 1)
    ordered = np.maximum(told[judged, s, 2], told[judged, s, 2 if whole else 1])
    shows = wrong(history, frames)
    return Seen(alarm, sign, least, most, command, commands, room, shows, ordered, stops, slowest_rad_s)


def _written(found: Found, seen: Seen, of: Hypothesis) -> Document:
    """The statement."""
    i, j = found.run[0], found.beside
    axis = int(seen.least[i].argmax()) if found.axis is None else found.axis
    if j is None:  # of an oscillation theta is the offset
        of = replace(of, offset=np.zeros_like(of.offset))
    bounds = [_bound(seen, of, found.run, axis, 1)]
    if j is not None:
        bounds.append(_bound(seen, of, range(j, j + 1), int(seen.most[j].argmin()), -1))
    sides = [[float(value) for value in column] for column in zip(*found.compared, strict=True)]
    return {"theta": "course", **found.said, "bounds": bounds, "sides": sides}


def _bound(seen: Seen, of: Hypothesis, frames: range, axis: int, side: int) -> Document:
    """What frames take to bound the surface by an axis: from below (side 1), or above."""
    first, last = seen.first + frames[0], seen.first + frames[-1]
    rows, d = slice(first - of.first, last + 1 - of.first), np.zeros(3)
    d[axis] = side * seen.sign * np.sign(of.slope[rows.start, axis])
    numbers = {
        "h": of.offset[rows] @ d,
        "Z": seen.sign * of.slope[rows] @ d,
        "r": of.spread[rows] @ np.abs(d),
    }
    said = {"d": d.tolist(), "first": first, "frame": last}
    return said | {name: values.tolist() for name, values in numbers.items()}
