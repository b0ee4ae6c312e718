"""Exclusions of fault types by their *course*, i.e. the surface's position over several frames.

Each frame that health does not explain bounds the position of the surface from below, or from above. A fault
type forbids some pairs of such bounds. A rule takes the bounds (`SurfaceBounds`), and returns the statement
of an exclusion, with pairs (greater, less): the type requires greater <= less in at least one of them, and in
the flight greater > less in all. docs/explanation/certificates.md, "Types that pairs exclude", has the pairs
of each rule, in order. Each rule is written for the sign 1; for the sign -1, positions are multiplied by -1.

Words: the *command* is the position of a healthy surface; an *order* is a command before the actuator. A
*frame* here is a block of frames if types are tested by blocks; dt is its length, s.
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
from beaver_ftc_assurance.certificates.inequality import Hypothesis
from beaver_ftc_assurance.certificates.kinds import STUCK, hypothesis_of_type, travel_rad
from beaver_ftc_assurance.certificates.search import theta_bounds_by_frame

MIN_POSITION_DIFFERENCE_RAD = 1e-9  # a smaller difference between two positions is rounding
Pair = tuple[float, float]  # greater, less: rad, or frames


@dataclass(frozen=True)
class SurfaceBounds:
    """Bounds on a surface's position p, and its commands, in n frames first_frame, first_frame + 1, ...; rad.

    For sign -1 all positions, commands and stops are multiplied by -1, so that a type needs one rule. Columns
    are the axes of roll, pitch and yaw:

    lower, upper (n, 3): bounds on p by the innovation of one axis; infinite where that axis bounds nothing.
    command (n,): position of a healthy surface, as the axis on which the surface acts most has it.
    axis_commands (n, 3): the same as each axis has it; they differ if the effectiveness changes in a frame.
    command_range (n, 2): how far below and above `command` the commands of the frame's instants reach, >= 0.
    is_unexplained (n,): health does not explain the frame. max_order (n,): largest order in effect in the
    frame. stops (2,): low and high end of travel. held: hypothesis by which a frame bounds the position.
    slowest_rad_s: frequency of the slowest oscillation.
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
        """For each axis: the axis; distance (n,) by which each frame shows the surface beyond `reference`
        (n,), rad; and starts (n,). A frame is *beyond* if this distance is more than rounding and health does
        not explain the frame. starts[k]: first frame of the unbroken run of frames beyond that ends with
        frame k; k + 1 if frame k is not beyond."""
        numbers = np.arange(len(reference))
        for axis, lower in enumerate(self.lower.T):
            beyond = self.is_unexplained & (lower > reference + MIN_POSITION_DIFFERENCE_RAD)
            yield axis, lower - reference, np.maximum.accumulate(np.where(beyond, 0, numbers + 1))

    def statement(
        self, lower: range, upper: int | None, pairs: list[Pair], fields: Document, axis: int | None = None
    ) -> Document:
        """The fields of a statement. lower: numbers, from first_frame on, of the frames whose lower bounds
        are compared with the upper bound of frame `upper`, None if there is none. axis: of the lower bounds;
        if None, the axis with the largest bound in the first of these frames. fields: further fields of the
        statement."""
        held = self.held
        if upper is None:  # an oscillation: theta is the distance from the command
            held = replace(held, offset=np.zeros_like(held.offset))
        axis = int(self.lower[lower[0]].argmax()) if axis is None else axis
        entries = [self._bound_fields(held, lower, axis, side=1)]
        if upper is not None:
            upper_axis = int(self.upper[upper].argmin())
            entries.append(self._bound_fields(held, range(upper, upper + 1), upper_axis, side=-1))
        return {"theta": "course", **fields, "bounds": entries, "sides": np.array(pairs, float).T.tolist()}

    def _bound_fields(self, held: Hypothesis, frames: range, axis: int, side: int) -> Document:
        """The entry of frames that bound the position by an axis, from below (side 1) or above (-1):
        direction d along which Z has the sign of `side`, first and last frame, and h, Z, r of the hypothesis
        along d. Z is for positions that are multiplied by the sign of these bounds."""
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

    least, most (n,): bounds on the position p, rad, by the axis that bounds it most. The lower bound counts
    only above the low stop, the upper bound only below the high stop: a surface at a stop may have any larger
    offset. The range of the command in a frame of several instants brings both stops nearer. With grows, j
    must be later than i, and the offset positive.
    """
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
    # The pairs use the commands of single axes, so one may fail.
    if not all(more > limit for more, limit in pairs):
        return None
    stops = [float(low_stop[i]), float(high_stop[j])]
    return bounds.statement(range(i, i + 1), j, pairs, {"stops": stops})


def _farthest(lower: np.ndarray, upper: np.ndarray) -> tuple[int, int] | None:
    """The frames with the greatest lower and the least upper bound, if these contradict one another."""
    i = int(np.argmax(lower))
    j = int(np.argmin(upper))
    return (i, j) if lower[i] > upper[j] + MIN_POSITION_DIFFERENCE_RAD else None


def _first_smaller(lower: np.ndarray, upper: np.ndarray) -> tuple[int, int] | None:
    """(i, j): frame i has the greatest lower bound so far, which is positive, and j is the first later frame
    whose upper bound is less; None if there is none.
    """
    for j in np.flatnonzero(upper < np.inf).tolist():
        i = int(np.argmax(lower[: j + 1]))
        if i < j and lower[i] > max(upper[j], 0.0) + MIN_POSITION_DIFFERENCE_RAD:
            return i, j
    return None


def _exclude_runaway(bounds: SurfaceBounds) -> Document | None:
    """Exclude a runaway: a surface that runs away from frame i at its least rate, or faster, would be farther
    in frame j.

        excluded if least[i] + step (j - i - late_frames) > most[j],    step = rate dt

    In a frame of several instants, the lower bound may hold only in the last instant. late_frames: 1 then,
    otherwise 0. The surface must not be at its high stop in frame j."""
    rate = bounds.actuator.min_runaway_rate_rad_s
    high_stop = bounds.stops[1]
    step = rate * bounds.config.block_duration_s
    late_frames = int(not bounds.config.single_instant)
    least = bounds.lower.max(axis=1)
    most = bounds.upper.min(axis=1)
    # The lower bound of each frame, traced back to frame 0 at the least rate.
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
    """Exclude an oscillation about the command: the surface is on one side of the command from frame i to
    frame k, for longer than half of the slowest period: k - i > pi / (slowest_rad_s dt). The right side is
    rounded up where the run is chosen, as in the diagnosis."""
    half_period = pi / bounds.slowest_rad_s / bounds.config.block_duration_s
    for axis, beyond, starts in bounds.runs_beyond(bounds.command):
        for k in np.flatnonzero(np.arange(len(starts)) - starts > np.ceil(half_period))[:1].tolist():
            run = range(int(starts[k]), k + 1)
            pairs = [(k - run[0], half_period), *_positive_pairs(beyond, run)]
            return bounds.statement(run, None, pairs, {"slowest_rad_s": bounds.slowest_rad_s}, axis)
    return None


def _exclude_rate_limit(bounds: SurfaceBounds) -> Document | None:
    """Exclude a reduced rate limit. Such a surface approaches its order by at least the least step in each
    instant, until it is so near that its lag makes the steps smaller. In a run of frames i ... k beyond all
    orders, frame k shows a position farther away:

        excluded if lower[k] > max(most[i] - min_approach (k - i - 1), near),
        near = max(orders[i..k]) + lag distance

    most (n,): least upper bound of each frame. min_approach: least approach in a frame, rad.
    """
    actuator = bounds.actuator
    config = bounds.config
    min_approach = config.n_substeps * config.frames_per_block * actuator.slow_step_rad  # in a frame, rad
    orders = bounds.max_order
    most = bounds.upper.min(axis=1)
    # The upper bound of each frame, traced back to frame 0 at the least approach.
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
                # the last pair is always met: it belongs to the format of the certificate
                pairs = [*_positive_pairs(beyond, run), (reached, upper), (reached, near), (1.0, 0.0)]
                return bounds.statement(run, i, pairs, fields, axis)
    return None


def _positive_pairs(distance: np.ndarray, run: range) -> list[Pair]:
    """Pairs with greater > less if the distance (n,) is positive in every frame of the run: for the smallest
    distance, and for the sum."""
    of_run = distance[run[0] : run[-1] + 1]
    return [(of_run.min(), 0.0), (of_run.sum(), 0.0)]


# Course in the row of a type (`FaultType.frames_test`) -> rule.
RULES: dict[str, Callable[[SurfaceBounds], Document | None]] = {
    "runaway": _exclude_runaway, "offset": _exclude_offset,
    "growing offset": partial(_exclude_offset, grows=True), "swing": _exclude_oscillation,
    "approach": _exclude_rate_limit,
}  # fmt: skip


def evidence(scenario: Scenario, history: History, surface: int, fault_type: int) -> Document | None:
    """The fields of the statement that excludes a fault type on a surface by its course; None if there is no
    such statement. Both signs are tried, unless the type has a direction of its own."""
    held = hypothesis_of_type(history, surface, STUCK)
    fault_type_row = TYPES[fault_type]
    for sign in (fault_type_row.stop_direction,) if fault_type_row.stop_direction else (1, -1):
        bounds = _surface_bounds(scenario, held, surface, sign)
        statement = RULES[fault_type_row.frames_test](bounds)
        if statement is not None:
            return history.statement_fields | statement
    return None


def _surface_bounds(scenario: Scenario, held: Hypothesis, surface: int, sign: int) -> SurfaceBounds:
    """The bounds of the frames from the alarm on in which the diagnosis has tested types. held: hypothesis by
    which a frame bounds the position: theta is the position p, its offset is -G u and its slope G, so that
    the command is u = -offset / slope. sign: 1 or -1, by which positions are multiplied.
    """
    history = held.history
    tape = history.tape
    frames = np.arange(history.alarm, tape.end - 1)
    diagnosis = tape.last.diagnosis
    tape_rows = slice(history.alarm - tape.first, tape.end - 1 - tape.first)
    lower, upper, _ = theta_bounds_by_frame(held, frames)
    if sign < 0:
        lower, upper = -upper, -lower
    slope = held.slope[tape_rows]
    axis_commands = -sign * held.offset[tape_rows] / np.where(slope == 0.0, np.inf, slope)
    command = axis_commands[:, np.abs(slope).sum(axis=0).argmax()]
    # least and greatest position of a healthy surface in each frame (n, 2)
    reach = np.column_stack([tape.least[tape_rows, surface, 0], tape.greatest[tape_rows, surface, 0]])
    reach = (sign * reach)[:, ::sign]
    # in a frame of one instant, the commands have no range
    single = history.has_single_instants
    command_range = np.maximum(0.0, (command[:, None] - reach) * (1.0, -1.0)) * (not single)
    # largest orders to the surface (n, 3), from the row after each frame: in a frame of one instant only the
    # last one is in effect, otherwise the last two
    orders = (tape.command_high if sign > 0 else -tape.command_low)[
        tape_rows.start + 1 : tape_rows.stop + 1, surface
    ]
    return SurfaceBounds(
        history.alarm, sign, lower, upper, command, axis_commands, command_range,
        is_unexplained=history.is_unexplained(frames),
        max_order=orders[:, 2 if single else 1 :].max(axis=1),
        stops=np.sort(sign * np.array(travel_rad(tape, surface))), held=held,
        actuator=diagnosis.surface_fault_types[surface].actuator, config=diagnosis.types_config,
        slowest_rad_s=scenario.fdi.slowest_oscillation_rad_s,
    )  # fmt: skip
