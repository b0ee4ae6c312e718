"""The parity views as they follow from an aircraft and from what a scenario declares.

Letters as in parity.py; d: a `ParityDirection`; b: the block of a view.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_TERMS_OF_ONE
from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.forces import (
    FORCE_NAMES,
    MAX_FORCE_REGRESSORS,
    NORMAL_INDEX,
    SIDE_INDEX,
    terms_of_force,
)
from beaver_ftc.diagnosis.detection.likelihood import (
    LATERAL_BLOCK,
    N_INPUT_READINGS,
    PITCH_BLOCK,
    STEP_FAULT,
    BlockCapacity,
)
from beaver_ftc.diagnosis.detection.parity import AXIS_VIEW, VANE_VIEW, StatisticalSize
from beaver_ftc.diagnosis.detection.rows import INERTIAL, RAW, VANED, VANELESS, set_columns
from beaver_ftc.diagnosis.deviations import moment_axis
from beaver_ftc.diagnosis.state import LOSS, NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW, fill

PITCH_PLANE = (PITCH, NORMAL_FORCE)
ROLL_YAW_PLANE = (ROLL, YAW)
YAW_PLANE = (YAW, SIDE_FORCE)


class ParityDirection(NamedTuple):
    """A parity direction as it is set up.

    nulled: the surface to whose column it is orthogonal, VANE_VIEW + the index of a force, or AXIS_VIEW; m_0:
    ones on the rates and forces that it sees, which `turn_view` replaces in flight unless it is an axis;
    plane_pair: the two rows that it combines; tested_losses: indices of surfaces; by_inertia: the force is
    that at the flow angle from inertial motion.
    """

    nulled: int
    m_0: tuple[float, ...]
    plane_pair: tuple[int, int]
    tested_losses: list[int]
    by_inertia: bool = False
    uses_vane_gust: bool = False  # for the gust estimate in moving air, which has no rolling component


def list_directions(aircraft: Aircraft, with_forces: bool = False) -> Iterator[ParityDirection]:
    """The parity directions of an aircraft: each axis, and in roll and yaw across each surface's column.

    With accelerometers also, in the plane of a rate and its force, across the column of each surface that
    moves both and across that of the vane; and the force at the flow angle from inertial motion.
    """
    pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield ParityDirection(AXIS_VIEW, _ones_at((PITCH,)), PITCH_PLANE, pitch, uses_vane_gust=True)
    yield ParityDirection(AXIS_VIEW, _ones_at((ROLL,)), ROLL_YAW_PLANE, lateral)
    yield ParityDirection(AXIS_VIEW, _ones_at((YAW,)), ROLL_YAW_PLANE, lateral, uses_vane_gust=True)
    for s in lateral:
        rolls = aircraft.dominant_axis[s] == ROLL
        others = [other for other in lateral if other != s]
        yield ParityDirection(s, _ones_at((ROLL,)), ROLL_YAW_PLANE, others, uses_vane_gust=rolls)
    if not with_forces:
        return
    for i, plane, tested in ((NORMAL_INDEX, PITCH_PLANE, pitch), (SIDE_INDEX, YAW_PLANE, lateral)):
        separable = aircraft.separated_by_force(FORCE_NAMES[i])
        for s in separable:
            pair = aircraft.dominant_axis[s], plane[1]
            yield ParityDirection(s, _ones_at(pair), pair, [other for other in tested if other != s])
        if separable:
            yield ParityDirection(VANE_VIEW + i, _ones_at(plane), plane, tested)
            yield ParityDirection(AXIS_VIEW, _ones_at(plane[1:]), plane, tested, by_inertia=True)


def _ones_at(ones: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(float(i in ones) for i in range(NORMAL_FORCE + 1))


def required_size(aircraft: Aircraft) -> StatisticalSize:
    """The capacities that the records of an aircraft need."""
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
    """Fill the views of a statistical record whose rows, blocks and forces are already set up."""
    forces = stat["forces"]
    gusty = bool(stat["gust"]["output"]["gusty"])
    subtracts = forces["in_use"] and gusty and all(aircraft.separated_by_force(name) for name in FORCE_NAMES)
    directions = list(list_directions(aircraft, bool(forces["in_use"])))
    stat["n_views"] = len(directions)
    for view, d in zip(stat["views"][: len(directions)], directions, strict=True):
        may_alarm = d.nulled == AXIS_VIEW  # and no alarm rests on accelerometers that may break
        vaned = subtracts and d.uses_vane_gust and not (may_alarm and stat["vaned"]["output"]["gusty"])
        _configure_view(view, d, gusty, vaned)
        rates = stat["block"][PITCH_BLOCK if d.plane_pair == PITCH_PLANE else LATERAL_BLOCK]
        _configure_filter(view["block"], d, rates)
        _configure_columns(view, d, rates, stat["rows"], forces)
        _configure_hypotheses(view["block"], d, gusty)


def _configure_view(view: np.void, d: ParityDirection, gusty: bool, vaned: bool) -> None:
    """Fill the rows that a view combines, the axis that its alarm names, and which errors it does not see.

    vaned: whether the gust estimate by vanes is subtracted, although it sees no force.
    """
    is_axis, across_vane, by_force = d.nulled == AXIS_VIEW, d.nulled >= VANE_VIEW, any(d.m_0[SIDE_FORCE:])
    i, j = d.plane_pair
    across_gust = across_vane and d.plane_pair == YAW_PLANE and gusty
    source = VANED if vaned or by_force else RAW
    if d.by_inertia or across_vane:
        source = INERTIAL if d.by_inertia else VANELESS
    view["block"]["source"] = source
    fill(
        view, nulled=d.nulled, by_force=by_force, places=(ROLL, YAW, j) if across_gust else (i, -1, j),
        alarm_axis=d.m_0.index(1.0) if is_axis and not d.by_inertia else i,
        confirmer=(NORMAL_FORCE if j == NORMAL_FORCE else SIDE_FORCE) if by_force or vaned else 0,
    )  # fmt: skip


def _configure_filter(b: np.void, d: ParityDirection, rates: np.void) -> None:
    """Fill direction and filter of a view's block from the block of the rates that the view combines."""
    same = {name: rates[name] for name in ("alarm_level", "noise_share", "eta_rate")}
    fill(b, n=1, a=1.0, Q_scale=1.0, any_position=1, **same)
    b["m"][0], b["P_xx"][0, 0], b["P_dd"][0, 0] = d.m_0, rates["R_y"].max(), likelihood.DRIFT_PRIOR_RAD_S2**2


def _configure_columns(
    view: np.void, d: ParityDirection, rates: np.void, rows: np.void, forces: np.void
) -> None:
    """Fill the regressors that a view sees: those of its rates, of its force, of the flow angle from inertial
    motion, and the leak, which is worked out in flight.
    """
    b, columns = view["block"], list(rates["columns"][: rates["n_Z"]])
    if not columns and not view["by_force"]:
        return
    if view["by_force"]:
        i = d.plane_pair[1] - SIDE_FORCE
        first = int(rows["first"][i])
        columns += range(first, first + int(forces["component"][i]["n_Z"]) + d.by_inertia)
    set_columns(b, rows, columns)
    if d.nulled != AXIS_VIEW:
        b["tol"][b["n_Z"]] = 1.0
        b["n_Z"] += 1


def _configure_hypotheses(b: np.void, d: ParityDirection, gusty: bool) -> None:
    """Fill the hypotheses of a view: a step of its innovation, and a loss of each surface that it tests."""
    # A law that uses the vanes reacts to a gust before the gyros measure its pitching effect, and these
    # views do not use the vanes. The elevator's effect then correlates with the noise: no loss is tested.
    lost = [] if gusty and d.m_0[PITCH] else d.tested_losses
    kinds = [STEP_FAULT, *(LOSS for _ in lost)]
    b["n_h"] = len(kinds)
    hyps = b["hypothesis"][: len(kinds)]
    hyps["kind"], hyps["surface"], hyps["signature"][0, 0] = kinds, [-1, *lost], 1.0
    likelihood.set_signs(b, kinds)
