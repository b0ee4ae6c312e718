"""Exclusions of fault types by their course: bounds of single frames on the surface's position, compared.

Each frame that health does not explain bounds the surface's position from below, or above; a fault type
forbids some pairs of such bounds. A rule takes the bounds (`SurfaceBounds`), and yields what it finds: pairs
(greater, less), where the type requires greater <= less. docs/explanation/certificates.md, "Types that pairs
exclude", has the pairs of each rule, in order.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi

import numpy as np

from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis import Actuator, FaultTypesConfig
from beaver_ftc.scenario import Scenario
from beaver_ftc_assurance.certificates.history import Document, History
from beaver_ftc_assurance.certificates.inequality import Hypothesis, theta_bounds_by_frame
from beaver_ftc_assurance.certificates.kinds import hypothesis_held_anywhere
from beaver_ftc_assurance.certificates.tape import Tape

MIN_POSITION_DIFFERENCE_RAD = 1e-9  # two positions that differ by less are not compared
Pair = tuple[float, float]  # greater, less: rad, or frames


@dataclass(frozen=True)
class SurfaceBounds:
    """Bounds on a surface's position p, and its commands, in frames first_frame, first_frame + 1, ...; rad.

    For sign -1 all positions, commands and stops are multiplied by -1, so that a type needs one rule. Shapes,
    with n frames and the axes p, q, r:

    lower, upper (n, 3): bounds on p by the innovation of one axis; infinite where that axis bounds nothing.
    command (n,): position of a healthy surface, as the axis on which the surface acts most has it.
    axis_commands (n, 3): the same as each axis has it; they differ if the effectiveness changes in a frame.
    command_range (n, 2): how far below and above `command` the commands of the frame's instants reach, >= 0.
    is_unexplained (n,): health does not explain the frame. max_order (n,): largest command in effect in the
    frame. stops (2,): low and high end of travel. slowest_oscillation_rad_s: angular frequency.
    """

    first_frame: int
    sign: int
    lower: np.ndarray
    upper: np.ndarray
    command: np.ndarray
    axis_commands: np.ndarray
    command_range: np.ndarray
    is_unexplained: np.ndarray
    max_order: np.ndarray
    stops: np.ndarray
    slowest_oscillation_rad_s: float

    @cached_property
    def largest_lower(self) -> np.ndarray:
        """Largest lower bound over the axes, (n,) rad."""
        return np.asarray(self.lower.max(axis=1))

    @cached_property
    def smallest_upper(self) -> np.ndarray:
        """Smallest upper bound over the axes, (n,) rad."""
        return np.asarray(self.upper.min(axis=1))

    def offset_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bound (n,) on p - command, rad; infinite where a stop may hide an offset."""
        above_low_stop = self.largest_lower - self.command_range[:, 0] > (
            self.stops[0] + MIN_POSITION_DIFFERENCE_RAD
        )
        below_high_stop = self.smallest_upper + self.command_range[:, 1] < (
            self.stops[1] - MIN_POSITION_DIFFERENCE_RAD
        )
        lower = np.where(self.is_unexplained & above_low_stop, self.largest_lower - self.command, -np.inf)
        upper = np.where(self.is_unexplained & below_high_stop, self.smallest_upper - self.command, np.inf)
        return lower, upper


def run_starts(flags: np.ndarray) -> np.ndarray:
    """For each frame k of flags (n,): the first frame of the unbroken run of flags that ends with k; k + 1 if
    the flag of k is not set."""
    places = np.arange(len(flags))
    return np.maximum.accumulate(np.where(flags, 0, places + 1))


@dataclass(frozen=True)
class Exclusion:
    """What a rule has found: frames whose lower bounds are compared, by number from first_frame on, and by
    which axis, None for the one with the largest; the frame whose upper bound is compared, None if there is
    none; the pairs; and further fields of the statement."""

    lower_frames: range
    upper_frame: int | None
    pairs: list[Pair]
    fields: Document = field(default_factory=dict)
    axis: int | None = None


def _exclude_offset(
    bounds: SurfaceBounds, actuator: Actuator, config: FaultTypesConfig
) -> Iterator[Exclusion]:
    """A constant offset: its lower bound by one frame exceeds its upper bound by another."""
    lower, upper = bounds.offset_bounds()
    i, j = int(np.argmax(lower)), int(np.argmin(upper))
    if lower[i] > upper[j] + MIN_POSITION_DIFFERENCE_RAD:
        yield from _compare_offsets(bounds, i, j)


def _exclude_growing_offset(
    bounds: SurfaceBounds, actuator: Actuator, config: FaultTypesConfig
) -> Iterator[Exclusion]:
    """An offset that only grows, and keeps its sign: a positive one is smaller in a later frame."""
    lower, upper = bounds.offset_bounds()
    for j in np.flatnonzero(upper < np.inf).tolist():
        i = int(np.argmax(lower[: j + 1]))
        if i < j and lower[i] > max(upper[j], 0.0) + MIN_POSITION_DIFFERENCE_RAD:
            for found in _compare_offsets(bounds, i, j):
                (offset, _), frames = found.pairs[0], (bounds.first_frame + j, bounds.first_frame + i)
                if offset > 0.0:
                    yield replace(found, pairs=[(offset, 0.0), *found.pairs, frames])
            return


def _compare_offsets(bounds: SurfaceBounds, i: int, j: int) -> Iterator[Exclusion]:
    """The offsets of frames i and j, away from the stops, which are nearer by the range of the command."""
    commands = (
        bounds.axis_commands[i, bounds.lower[i].argmax()],
        bounds.axis_commands[j, bounds.upper[j].argmin()],
    )
    low_stop = bounds.stops[0] + bounds.command_range[i, 0]
    high_stop = bounds.stops[1] - bounds.command_range[j, 1]
    offsets = bounds.largest_lower[i] - commands[0], bounds.smallest_upper[j] - commands[1]
    pairs = [offsets, (bounds.largest_lower[i], low_stop), (high_stop, bounds.smallest_upper[j])]
    if offsets[0] > offsets[1]:
        yield Exclusion(range(i, i + 1), j, pairs, {"stops": [float(low_stop), float(high_stop)]})


def _exclude_runaway(
    bounds: SurfaceBounds, actuator: Actuator, config: FaultTypesConfig
) -> Iterator[Exclusion]:
    """A runaway at its least rate or faster: a later frame shows less travel. In a frame of several instants
    the lower bound may hold from its last instant on only: a frame less counts."""
    rate, high_stop = actuator.min_runaway_rate_rad_s, bounds.stops[1]
    step, late_frames = rate * config.block_duration_s, int(not config.single_instant)
    # lower bound of each frame, traced back to frame 0 at the least rate
    traced_back = np.where(
        bounds.is_unexplained,
        bounds.largest_lower - step * np.arange(len(bounds.largest_lower)),
        -np.inf,
    )
    below_stop = bounds.smallest_upper < high_stop - MIN_POSITION_DIFFERENCE_RAD
    for j in np.flatnonzero(bounds.is_unexplained & below_stop).tolist():
        if j <= late_frames:
            continue
        i = int(np.argmax(traced_back[: j - late_frames]))
        reached, upper = bounds.largest_lower[i] + step * (j - i - late_frames), bounds.smallest_upper[j]
        if bounds.is_unexplained[i] and reached > upper + MIN_POSITION_DIFFERENCE_RAD:
            frames = bounds.first_frame + j, bounds.first_frame + i
            pairs = [(high_stop, upper), frames, (reached, upper)]
            yield Exclusion(range(i, i + 1), j, pairs, {"stops": [float(high_stop)], "pace_rad_s": rate})
            return


def _exclude_oscillation(
    bounds: SurfaceBounds, actuator: Actuator, config: FaultTypesConfig
) -> Iterator[Exclusion]:
    """An oscillation about the command: the surface is on one side of it for longer than half of the slowest
    period."""
    for axis, lower in enumerate(bounds.lower.T):
        starts = run_starts(bounds.is_unexplained & (lower > bounds.command + MIN_POSITION_DIFFERENCE_RAD))
        for k in np.flatnonzero(np.arange(len(starts)) - starts > config.half_blocks)[:1].tolist():
            run = range(int(starts[k]), k + 1)
            half_period_frames = pi / bounds.slowest_oscillation_rad_s / config.dt_s
            pairs = [(k - run[0], half_period_frames), *_positive_pairs(lower - bounds.command, run)]
            yield Exclusion(run, None, pairs, {"slowest_rad_s": bounds.slowest_oscillation_rad_s}, axis)


def _exclude_rate_limit(
    bounds: SurfaceBounds, actuator: Actuator, config: FaultTypesConfig
) -> Iterator[Exclusion]:
    """A surface that approaches its order by its least step in every instant, until its lag makes the steps
    smaller: in a run of frames beyond all orders, a later one shows a position farther away."""
    min_step = actuator.slow_step_rad
    min_approach = config.n_substeps * config.frames_per_block * min_step  # of a frame, rad
    for axis, lower in enumerate(bounds.lower.T):
        is_beyond = bounds.is_unexplained & (lower > bounds.max_order + MIN_POSITION_DIFFERENCE_RAD)
        starts = run_starts(is_beyond)
        # upper bound of each frame, traced back to frame 0 at the least approach
        traced_back = bounds.smallest_upper + min_approach * np.arange(len(lower))
        for k in np.flatnonzero(is_beyond & (starts < np.arange(len(lower)))).tolist():
            i = int(starts[k]) + int(np.argmin(traced_back[starts[k] : k]))
            run, upper = range(i, k + 1), bounds.smallest_upper[i] - min_approach * (k - i - 1)
            near = float(bounds.max_order[i : k + 1].max()) + actuator.lag_distance_rad
            if lower[k] > max(upper, near) + MIN_POSITION_DIFFERENCE_RAD:
                fields = {"ordered": bounds.max_order[i : k + 1].tolist(), "near": near}
                fields |= {"step": min_approach} if k - i > 1 else {}
                beyond = _positive_pairs(lower - bounds.max_order, run)
                yield Exclusion(
                    run, i, [*beyond, (lower[k], upper), (lower[k], near), (1.0, 0.0)], fields, axis
                )
                return


def _positive_pairs(distance: np.ndarray, run: range) -> list[Pair]:
    """Pairs that hold if the distance is positive in every frame of the run: the smallest, and the sum."""
    of_run = distance[run[0] : run[-1] + 1]
    return [(of_run.min(), 0.0), (of_run.sum(), 0.0)]


# By the course that a type's row names.
RULES: dict[str, Callable[[SurfaceBounds, Actuator, FaultTypesConfig], Iterator[Exclusion]]] = {
    "runaway": _exclude_runaway, "offset": _exclude_offset, "growing offset": _exclude_growing_offset,
    "swing": _exclude_oscillation, "approach": _exclude_rate_limit,
}  # fmt: skip


def evidence(
    scenario: Scenario, tape: Tape, history: History, surface: int, fault_type: int, alarm_frame: int
) -> Document | None:
    """What excludes a fault type on a surface by its course; None where single frames do not."""
    held = hypothesis_held_anywhere(tape, surface)
    diagnosis = tape.last.diagnosis
    direction, actuator = (
        TYPES[fault_type].stop_direction,
        diagnosis.surface_fault_types[surface].actuator,
    )
    rule = RULES[TYPES[fault_type].frames_test]
    slowest_rad_s = scenario.fdi.slowest_oscillation_rad_s
    for sign in (direction,) if direction else (1, -1):
        bounds = _surface_bounds(tape, history, held, surface, alarm_frame, sign, slowest_rad_s)
        for found in rule(bounds, actuator, diagnosis.types_config):
            return history.statement_fields | _statement(found, bounds, held)
    return None


def _surface_bounds(
    tape: Tape,
    history: History,
    held: Hypothesis,
    surface: int,
    alarm_frame: int,
    sign: int,
    slowest_rad_s: float,
) -> SurfaceBounds:
    """The bounds of the frames from the alarm on that the diagnosis has tested types with."""
    frames = np.arange(alarm_frame, tape.end - 1)
    here = slice(alarm_frame - tape.first, tape.end - 1 - tape.first)
    single_instant = history.has_single_instants
    lower, upper, _ = theta_bounds_by_frame(held, history, frames)
    if sign < 0:
        lower, upper = -upper, -lower
    slope = held.slope[here]
    axis_commands = -sign * held.offset[here] / np.where(slope == 0.0, np.inf, slope)
    command = axis_commands[:, np.abs(slope).sum(axis=0).argmax()]
    orders = tape.command_high if sign > 0 else -tape.command_low
    reach = np.column_stack([tape.least[here, surface, 0], tape.greatest[here, surface, 0]])[:, ::sign] * sign
    command_range = np.maximum(0.0, (command[:, None] - reach) * (1.0, -1.0)) * (not single_instant)
    actuator = tape.last.diagnosis.surface_fault_types[surface].actuator
    stops = np.sort(sign * np.array([actuator.travel_low_rad, actuator.travel_high_rad]))
    next_frames = slice(here.start + 1, here.stop + 1)
    max_order = np.maximum(
        orders[next_frames, surface, 2], orders[next_frames, surface, 2 if single_instant else 1]
    )
    is_unexplained = history.is_unexplained(frames)
    return SurfaceBounds(
        alarm_frame, sign, lower, upper, command, axis_commands, command_range, is_unexplained, max_order,
        stops, slowest_rad_s,
    )  # fmt: skip


def _statement(found: Exclusion, bounds: SurfaceBounds, held: Hypothesis) -> Document:
    """The fields of a statement of what a rule has found."""
    i, j = found.lower_frames[0], found.upper_frame
    axis = int(bounds.lower[i].argmax()) if found.axis is None else found.axis
    if j is None:  # an oscillation: theta is the distance from the command
        held = replace(held, offset=np.zeros_like(held.offset))
    said = [_bound_fields(bounds, held, found.lower_frames, axis, 1)]
    if j is not None:
        said.append(_bound_fields(bounds, held, range(j, j + 1), int(bounds.upper[j].argmin()), -1))
    sides = [[float(value) for value in column] for column in zip(*found.pairs, strict=True)]
    return {"theta": "course", **found.fields, "bounds": said, "sides": sides}


def _bound_fields(bounds: SurfaceBounds, held: Hypothesis, frames: range, axis: int, side: int) -> Document:
    """Fields of frames that bound the surface by an axis: from below (side 1), or above (-1)."""
    first, last = bounds.first_frame + frames[0], bounds.first_frame + frames[-1]
    rows, direction = slice(first - held.first_frame, last + 1 - held.first_frame), np.zeros(3)
    direction[axis] = side * bounds.sign * np.sign(held.slope[rows.start, axis])
    effect = {
        "h": held.offset[rows] @ direction,
        "Z": bounds.sign * held.slope[rows] @ direction,
        "r": held.spread[rows] @ np.abs(direction),
    }
    said = {"d": direction.tolist(), "first": first, "frame": last}
    return said | {name: values.tolist() for name, values in effect.items()}
