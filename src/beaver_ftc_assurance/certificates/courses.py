"""Exclusions of fault types by their course: bounds of single frames on the surface's position, compared.

Each frame that health does not explain bounds the surface's position from below, or above; a fault type
forbids some pairs of such bounds. A rule takes the bounds (`SurfaceBounds`), and returns what it can state:
pairs (greater, less), where the type requires greater <= less. docs/explanation/certificates.md, "Types that
pairs exclude", has the pairs of each rule, in order.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np

from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis import Actuator, FaultTypesConfig
from beaver_ftc.scenario import Scenario
from beaver_ftc_assurance.certificates.history import Document, History
from beaver_ftc_assurance.certificates.inequality import Hypothesis, theta_bounds_by_frame
from beaver_ftc_assurance.certificates.kinds import STUCK, hypothesis_of_type, travel_rad
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
    frame. stops (2,): low and high end of travel. held: the hypothesis by which a frame bounds the position.
    slowest_rad_s: of an oscillation.
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
    held: Hypothesis
    actuator: Actuator
    config: FaultTypesConfig
    slowest_rad_s: float

    def runs_beyond(self, reference: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """By axis: the axis; how far each frame shows the surface beyond `reference` (n,), rad; the first
        frame of the unbroken run of frames beyond that ends with frame k, k + 1 if k is none of them."""
        places = np.arange(len(reference))
        for axis, lower in enumerate(self.lower.T):
            beyond = self.is_unexplained & (lower > reference + MIN_POSITION_DIFFERENCE_RAD)
            yield axis, lower - reference, np.maximum.accumulate(np.where(beyond, 0, places + 1))

    def statement(
        self, lower: range, upper: int | None, pairs: list[Pair], fields: Document, axis: int | None = None
    ) -> Document:
        """What is stated of lower bounds, by number from first_frame on, that are compared with the upper
        bound of a frame, None if there is none. axis: of the lower bounds, None for that of the largest;
        fields: further ones of the statement."""
        held = self.held
        if upper is None:  # an oscillation: theta is the distance from the command
            held = replace(held, offset=np.zeros_like(held.offset))
        axis = int(self.lower[lower[0]].argmax()) if axis is None else axis
        said = [self._bound_fields(held, lower, axis, 1)]
        if upper is not None:
            of_upper = int(self.upper[upper].argmin())
            said.append(self._bound_fields(held, range(upper, upper + 1), of_upper, -1))
        return {"theta": "course", **fields, "bounds": said, "sides": np.array(pairs, float).T.tolist()}

    def _bound_fields(self, held: Hypothesis, frames: range, axis: int, side: int) -> Document:
        """Fields of frames that bound the surface by an axis: from below (side 1), or above (-1)."""
        first = self.first_frame + frames[0]
        last = self.first_frame + frames[-1]
        d = np.zeros(3)
        d[axis] = side * self.sign * np.sign(held.slope[first - held.first_frame, axis])
        h, Z, r = held.along(d, slice(first, last + 1))
        effect = {"h": h.tolist(), "Z": (self.sign * Z).tolist(), "r": r.tolist()}
        return {"d": d.tolist(), "first": first, "frame": last} | effect


def _exclude_offset(bounds: SurfaceBounds, grows: bool = False) -> Document | None:
    """Exclude a constant offset: its lower bound by one frame exceeds its upper bound by another. Exclude an
    offset that grows and keeps its sign: a positive one is smaller in a later frame.

        lower = least - command,    upper = most - command,    excluded if lower[i] > upper[j]

    least, most (n,): bounds on the position p, rad, of the axis that bounds it most. At a stop the position
    says nothing about the offset. The range of the command in a frame of several instants brings both stops
    nearer."""
    least = bounds.lower.max(axis=1)
    most = bounds.upper.min(axis=1)
    low_stop = bounds.stops[0] + bounds.command_range[:, 0]
    high_stop = bounds.stops[1] - bounds.command_range[:, 1]
    above_stop = bounds.is_unexplained & (least > low_stop + MIN_POSITION_DIFFERENCE_RAD)
    below_stop = bounds.is_unexplained & (most < high_stop - MIN_POSITION_DIFFERENCE_RAD)
    lower = np.where(above_stop, least - bounds.command, -np.inf)
    upper = np.where(below_stop, most - bounds.command, np.inf)
    if (frames := (_first_smaller if grows else _farthest)(lower, upper)) is None:
        return None
    i, j = frames
    greater = least[i] - bounds.axis_commands[i, bounds.lower[i].argmax()]
    less = most[j] - bounds.axis_commands[j, bounds.upper[j].argmin()]
    pairs = [(greater, less), (least[i], low_stop[i]), (high_stop[j], most[j])]
    if grows:
        pairs = [(greater, 0.0), *pairs, (bounds.first_frame + j, bounds.first_frame + i)]
    if not all(more > limit for more, limit in pairs):  # by the commands of single axes
        return None
    stops = [float(low_stop[i]), float(high_stop[j])]
    return bounds.statement(range(i, i + 1), j, pairs, {"stops": stops})


def _farthest(lower: np.ndarray, upper: np.ndarray) -> tuple[int, int] | None:
    """The frames with the greatest lower and the least upper bound, if these contradict one another."""
    i = int(np.argmax(lower))
    j = int(np.argmin(upper))
    return (i, j) if lower[i] > upper[j] + MIN_POSITION_DIFFERENCE_RAD else None


def _first_smaller(lower: np.ndarray, upper: np.ndarray) -> tuple[int, int] | None:
    """The frame with the greatest lower bound so far, if it is positive, and the first one later whose upper
    bound contradicts it."""
    for j in np.flatnonzero(upper < np.inf).tolist():
        i = int(np.argmax(lower[: j + 1]))
        if i < j and lower[i] > max(upper[j], 0.0) + MIN_POSITION_DIFFERENCE_RAD:
            return i, j
    return None


def _exclude_runaway(bounds: SurfaceBounds) -> Document | None:
    """Exclude a runaway at its least rate or faster: a later frame shows less travel.

        excluded if least[i] + step (j - i - late_frames) > most[j],    step = rate dt

    In a frame of several instants the lower bound may hold only in the last one: late_frames, the way of one
    frame, is then not counted."""
    rate = bounds.actuator.min_runaway_rate_rad_s
    high_stop = bounds.stops[1]
    step = rate * bounds.config.block_duration_s
    late_frames = int(not bounds.config.single_instant)
    least = bounds.lower.max(axis=1)
    most = bounds.upper.min(axis=1)
    # lower bound of each frame, traced back to frame 0 at the least rate
    traced_back = np.where(bounds.is_unexplained, least - step * np.arange(len(least)), -np.inf)
    below_stop = most < high_stop - MIN_POSITION_DIFFERENCE_RAD
    for j in np.flatnonzero(bounds.is_unexplained & below_stop).tolist():
        if j <= late_frames:
            continue
        i = int(np.argmax(traced_back[: j - late_frames]))
        reached = least[i] + step * (j - i - late_frames)
        if bounds.is_unexplained[i] and reached > most[j] + MIN_POSITION_DIFFERENCE_RAD:
            frames = bounds.first_frame + j, bounds.first_frame + i
            pairs = [(high_stop, most[j]), frames, (reached, most[j])]
            fields = {"stops": [float(high_stop)], "pace_rad_s": rate}
            return bounds.statement(range(i, i + 1), j, pairs, fields)
    return None


def _exclude_oscillation(bounds: SurfaceBounds) -> Document | None:
    """Exclude an oscillation about the command: the surface is on one side of the command for longer than
    half of the slowest period."""
    for axis, beyond, starts in bounds.runs_beyond(bounds.command):
        for k in np.flatnonzero(np.arange(len(starts)) - starts > bounds.config.half_blocks)[:1].tolist():
            run = range(int(starts[k]), k + 1)
            half_period_frames = pi / bounds.slowest_rad_s / bounds.config.dt_s
            pairs = [(k - run[0], half_period_frames), *_positive_pairs(beyond, run)]
            return bounds.statement(run, None, pairs, {"slowest_rad_s": bounds.slowest_rad_s}, axis)
    return None


def _exclude_rate_limit(bounds: SurfaceBounds) -> Document | None:
    """Exclude a reduced rate limit: such a surface approaches its order by at least the least step in each
    instant, until it is so near that its lag makes the steps smaller. In a run of frames i ... k beyond all
    orders, a later frame shows a position farther away:

        excluded if lower[k] > max(most[i] - min_approach (k - i - 1), near)
    """
    actuator = bounds.actuator
    config = bounds.config
    min_approach = config.n_substeps * config.frames_per_block * actuator.slow_step_rad  # of a frame, rad
    orders = bounds.max_order
    most = bounds.upper.min(axis=1)
    # upper bound of each frame, traced back to frame 0 at the least approach
    traced_back = most + min_approach * np.arange(len(most))
    for axis, beyond, starts in bounds.runs_beyond(orders):
        for k in np.flatnonzero(starts < np.arange(len(starts))).tolist():
            i = int(starts[k]) + int(np.argmin(traced_back[starts[k] : k]))
            run = range(i, k + 1)
            upper = most[i] - min_approach * (k - i - 1)
            reached = bounds.lower[k, axis]
            near = float(orders[i : k + 1].max()) + actuator.lag_distance_rad
            if reached > max(upper, near) + MIN_POSITION_DIFFERENCE_RAD:
                fields = {"ordered": orders[i : k + 1].tolist(), "near": near}
                fields |= {"step": min_approach} if k - i > 1 else {}
                pairs = [*_positive_pairs(beyond, run), (reached, upper), (reached, near), (1.0, 0.0)]
                return bounds.statement(run, i, pairs, fields, axis)
    return None


def _positive_pairs(distance: np.ndarray, run: range) -> list[Pair]:
    """Pairs that hold if the distance is positive in every frame of the run: the smallest, and the sum."""
    of_run = distance[run[0] : run[-1] + 1]
    return [(of_run.min(), 0.0), (of_run.sum(), 0.0)]


# By the course that a type's row names.
RULES: dict[str, Callable[[SurfaceBounds], Document | None]] = {
    "runaway": _exclude_runaway, "offset": _exclude_offset,
    "growing offset": partial(_exclude_offset, grows=True), "swing": _exclude_oscillation,
    "approach": _exclude_rate_limit,
}  # fmt: skip


def evidence(
    scenario: Scenario, tape: Tape, history: History, surface: int, fault_type: int, alarm_frame: int
) -> Document | None:
    """The fields of the statement that excludes a fault type on a surface by its course; None if there is no
    such statement."""
    held = hypothesis_of_type(tape, surface, STUCK)
    row = TYPES[fault_type]
    for sign in (row.stop_direction,) if row.stop_direction else (1, -1):
        bounds = _surface_bounds(scenario, tape, history, held, surface, alarm_frame, sign)
        found = RULES[row.frames_test](bounds)
        if found is not None:
            return history.statement_fields | found
    return None


def _surface_bounds(
    scenario: Scenario,
    tape: Tape,
    history: History,
    held: Hypothesis,
    surface: int,
    alarm_frame: int,
    sign: int,
) -> SurfaceBounds:
    """The bounds of the frames from the alarm on in which the diagnosis has tested types. held: hypothesis by
    which a frame bounds the position: theta is the position p, so that its offset is -G u and its slope G,
    and the command u = -offset / slope.

    reach (n, 2): least and greatest position of a healthy surface in each frame; orders (n, 3): orders to the
    surface, of which a frame of one instant has the last alone.
    """
    frames = np.arange(alarm_frame, tape.end - 1)
    several = not history.has_single_instants
    diagnosis = tape.last.diagnosis
    here = slice(alarm_frame - tape.first, tape.end - 1 - tape.first)
    lower, upper, _ = theta_bounds_by_frame(held, history, frames)
    if sign < 0:
        lower, upper = -upper, -lower
    slope = held.slope[here]
    axis_commands = -sign * held.offset[here] / np.where(slope == 0.0, np.inf, slope)
    command = axis_commands[:, np.abs(slope).sum(axis=0).argmax()]
    reach = np.column_stack([tape.least[here, surface, 0], tape.greatest[here, surface, 0]])[:, ::sign] * sign
    command_range = np.maximum(0.0, (command[:, None] - reach) * (1.0, -1.0)) * several
    orders = (tape.command_high if sign > 0 else -tape.command_low)[here.start + 1 : here.stop + 1, surface]
    return SurfaceBounds(
        alarm_frame, sign, lower, upper, command, axis_commands, command_range,
        is_unexplained=history.is_unexplained(frames),
        max_order=np.maximum(orders[:, 2], orders[:, 1 if several else 2]),
        stops=np.sort(sign * np.array(travel_rad(tape, surface))), held=held,
        actuator=diagnosis.surface_fault_types[surface].actuator, config=diagnosis.types_config,
        slowest_rad_s=scenario.fdi.slowest_oscillation_rad_s,
    )  # fmt: skip
