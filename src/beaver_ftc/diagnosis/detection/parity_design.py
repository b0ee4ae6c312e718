"""The parity views as they follow from an aircraft and from what a scenario declares.

d: a `ParityDirection`; b: the block of a view (blocks.py); m: its direction on the five rows of rows.py.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import PITCH, ROLL, YAW, Aircraft
from beaver_ftc.aircraft.schema import MAX_TERMS_OF_ONE
from beaver_ftc.compiled import fill
from beaver_ftc.diagnosis.detection.block_design import ROLL_YAW_PLANE, Entry, configure_block
from beaver_ftc.diagnosis.detection.blocks import (
    LATERAL_BLOCK,
    LOSS,
    N_ROWS,
    NORMAL_FORCE,
    PITCH_BLOCK,
    SIDE_FORCE,
    STEP_FAULT,
    BlockCapacity,
)
from beaver_ftc.diagnosis.detection.forces import (
    FORCE_NAMES,
    NORMAL_INDEX,
    SIDE_INDEX,
    terms_of_force,
)
from beaver_ftc.diagnosis.detection.parity import AXIS_VIEW, VANE_VIEW, StatisticalSize
from beaver_ftc.diagnosis.detection.rows import (
    INERTIAL,
    MAX_FORCE_REGRESSORS,
    N_INPUT_READINGS,
    RAW,
    VANED,
    VANELESS,
    set_columns,
)
from beaver_ftc.diagnosis.tolerances import moment_axis

PITCH_PLANE = (PITCH, NORMAL_FORCE)
YAW_PLANE = (YAW, SIDE_FORCE)


class ParityDirection(NamedTuple):
    """A parity direction as it is set up.

    nulled: the index of the surface to whose column of G the direction is orthogonal; VANE_VIEW + i if it is
    orthogonal to the effect of an error of the vane of force i, SIDE_INDEX or NORMAL_INDEX; AXIS_VIEW if it
    is one row by itself (`is_axis`).
    rows: the rows on which the direction is 1 at the start (ROLL, PITCH, YAW, SIDE_FORCE, NORMAL_FORCE). The
    first `turn_view` in flight replaces this start, unless `is_axis`: a view across a lateral surface starts
    on roll alone, and then combines roll and yaw.
    plane_pair: the two rows in whose plane the direction lies: two rates, or a rate and a force.
    tested_losses: the indices of the surfaces for whose loss the view tests.
    source: what is subtracted from its rates (rows.py). A view of rates alone is RAW if its direction is
    roll, or mainly roll, because the vanes measure no rolling gust; if it is VANED here, it may become RAW
    (`configure_parity_views`).
    """

    nulled: int
    rows: tuple[int, ...]
    plane_pair: tuple[int, int]
    tested_losses: list[int]
    source: int

    @property
    def is_axis(self) -> bool:
        """Whether the direction is one row by itself."""
        return self.nulled == AXIS_VIEW

    @property
    def by_force(self) -> bool:
        """Whether the view sees a force, which is then the last of its rows."""
        return self.rows[-1] >= SIDE_FORCE


def list_directions(aircraft: Aircraft, with_forces: bool) -> Iterator[ParityDirection]:
    """The parity directions of an aircraft:

        each axis by itself
        in the plane of roll and yaw    across the column of each lateral surface

    and with accelerometers, for each force that separates surfaces:

        in the plane of the force and   across the column of each surface that it separates; the rate is that
        a rate                          of the surface's dominant axis
        in the plane of the force and   across the column of an error of its vane
        its own rate, pitch or yaw
        the force by itself             at the flow angle from inertial motion
    """
    pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield ParityDirection(AXIS_VIEW, (PITCH,), PITCH_PLANE, pitch, VANED)
    yield ParityDirection(AXIS_VIEW, (ROLL,), ROLL_YAW_PLANE, lateral, RAW)
    yield ParityDirection(AXIS_VIEW, (YAW,), ROLL_YAW_PLANE, lateral, VANED)
    for s in lateral:
        # across the column of a surface that rolls, the direction is mainly yaw
        source = VANED if aircraft.dominant_axis[s] == ROLL else RAW
        others = [other for other in lateral if other != s]
        yield ParityDirection(s, (ROLL,), ROLL_YAW_PLANE, others, source)
    if not with_forces:
        return
    for i, plane, tested in ((NORMAL_INDEX, PITCH_PLANE, pitch), (SIDE_INDEX, YAW_PLANE, lateral)):
        separable = aircraft.separated_by_force(FORCE_NAMES[i])
        for s in separable:
            pair = aircraft.dominant_axis[s], plane[1]
            yield ParityDirection(s, pair, pair, [other for other in tested if other != s], VANED)
        if separable:
            yield ParityDirection(VANE_VIEW + i, plane, plane, tested, VANELESS)
            yield ParityDirection(AXIS_VIEW, plane[1:], plane, tested, INERTIAL)


def required_size(aircraft: Aircraft) -> StatisticalSize:
    """The capacities that the records of an aircraft need.

    regressors    block of rates    readings + terms of its moments
                  view              the same + terms of a force + further constants of a force (rows.py:
                                    MAX_FORCE_REGRESSORS - MAX_TERMS_OF_ONE) + 2: the drift of the flow
                                    angle from inertial motion, and the leak
    hypotheses    block of rates    3 for each surface (loss, growing loss, end of a loss) + 2: a step on
                                    roll and on yaw, or in pitch a step and a moment in alpha^3
                  view              losses that it tests + 1 step
    """
    directions = list(list_directions(aircraft, aircraft.forces_separate_surfaces))
    n_rate = N_INPUT_READINGS + _largest_block([moment_axis(term) for term in aircraft.moments])
    n_force = (
        max(len(terms_of_force(aircraft, i)) for i in range(2)) + MAX_FORCE_REGRESSORS - MAX_TERMS_OF_ONE
    )
    lost = [aircraft.dominant_axis[aircraft.surfaces.index(name)] for name in aircraft.class_of_losses]
    n_tested = max(len(d.tested_losses) for d in directions)
    error_map = aircraft.file.model_error_map
    n_boxes = len(error_map.boxes) if error_map else 0
    return StatisticalSize(
        BlockCapacity(n_rate, 3 * _largest_block(lost) + 2),
        BlockCapacity(n_rate + n_force + 2, n_tested + 1),
        len(directions),
        n_boxes,
    )


def _largest_block(axes: list[int]) -> int:
    """How many of these axes the block of pitch or that of roll and yaw has, whichever has more."""
    return max(axes.count(PITCH), len(axes) - axes.count(PITCH))


def configure_parity_views(stat: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record, whose rows, blocks, forces and gust estimates are already set
    up."""
    forces = stat["forces"]
    gusty = bool(stat["gust"]["output"]["gusty"])
    # Rates subtract the gust estimate of the vanes only if both forces are used and separate surfaces
    # (parity.py).
    subtracts = forces["in_use"] and gusty and all(aircraft.separated_by_force(name) for name in FORCE_NAMES)
    # The views have a gust estimate of their own, `vaned`, only if accelerometers may break.
    accelerometers_may_break = stat["vaned"]["output"]["gusty"]
    directions = list(list_directions(aircraft, bool(forces["in_use"])))
    stat["n_views"] = len(directions)
    for view, d in zip(stat["views"][: len(directions)], directions, strict=True):
        # The view of an axis may raise an alarm, and the gust estimate uses accelerometers: no alarm may
        # depend on accelerometers that may break.
        keeps = d.by_force or (subtracts and not (d.is_axis and accelerometers_may_break))
        view["block"]["source"] = RAW if d.source == VANED and not keeps else d.source
        _configure_view(view, d, gusty)
        _configure_block(view, d, gusty, stat)


def _configure_view(view: np.void, d: ParityDirection, gusty: bool) -> None:
    """Fill the rows that a view combines, the axis that its alarm names, and the force of the views that
    confirm it."""
    first, second = d.plane_pair
    places = first, -1, second
    if d.source == VANELESS and d.plane_pair == YAW_PLANE and gusty:
        # In moving air a view across the error of the side vane is orthogonal to the rolling gust as well.
        places = ROLL, YAW, second
    alarm_axis = first if d.source == INERTIAL else d.rows[0]  # a force alone names its rate's axis
    # The force of the view's own plane confirms it; the side force confirms a view of roll and yaw.
    confirmer = SIDE_FORCE if d.plane_pair == ROLL_YAW_PLANE else second
    fill(
        view, nulled=d.nulled, by_force=d.by_force, places=places, alarm_axis=alarm_axis, confirmer=confirmer,
    )  # fmt: skip


def _configure_block(view: np.void, d: ParityDirection, gusty: bool, stat: np.void) -> None:
    """Fill the block of a view from the block of the rates that it combines. Its hypotheses: a step of its
    innovation, and a loss of each surface that it tests. Its regressors: those of its rates, of its force, of
    the flow angle from inertial motion, and the leak, which is worked out in flight. A view of rates without
    regressors has no leak.
    """
    b = view["block"]
    rows = stat["rows"]
    rates = stat["block"][PITCH_BLOCK if d.plane_pair == PITCH_PLANE else LATERAL_BLOCK]
    axis = int(view["alarm_axis"])
    # In moving air a view that sees the pitch rate tests no loss. A law that uses the vanes reacts to a gust,
    # and to the noise of the vanes, before the gyros measure a pitching effect. The effect of the elevator
    # then correlates with the noise of the view: with the whole gust, or, if the gust estimate of the vanes
    # is subtracted, with the noise of that estimate and the gust that it leaves.
    losses = [] if gusty and PITCH in d.rows else d.tested_losses
    entries = [Entry(STEP_FAULT, -1, axis), *(Entry(LOSS, s, axis) for s in losses)]
    m = np.eye(N_ROWS)[list(d.rows)].sum(axis=0)
    level = {name: rates[name] for name in ("alarm_level", "noise_share", "eta_rate")}
    configure_block(b, [axis], m, rates["R_y"].max(keepdims=True), entries, any_position=1, **level)
    columns = list(rates["columns"][: rates["n_Z"]])
    if d.by_force:
        i = d.plane_pair[1] - SIDE_FORCE
        first = int(rows["first"][i])
        columns += range(first, first + int(stat["forces"]["component"][i]["n_Z"]) + (d.source == INERTIAL))
    if columns:
        set_columns(b, rows, columns)
        if not d.is_axis:
            b["tol"][b["n_Z"]] = 1.0
            b["n_Z"] += 1
