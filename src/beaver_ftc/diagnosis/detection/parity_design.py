"""The parity views as they follow from an aircraft and from what a scenario declares.

Letters as in parity.py; d: a `ParityDirection`; b: the block of a view.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_TERMS_OF_ONE
from beaver_ftc.compiled import fill
from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.forces import (
    FORCE_NAMES,
    NORMAL_INDEX,
    SIDE_INDEX,
    terms_of_force,
)
from beaver_ftc.diagnosis.detection.likelihood import (
    LATERAL_BLOCK,
    PITCH_BLOCK,
    STEP_FAULT,
    BlockCapacity,
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
from beaver_ftc.diagnosis.state import LOSS, NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW
from beaver_ftc.diagnosis.tolerances import moment_axis

PITCH_PLANE = (PITCH, NORMAL_FORCE)
ROLL_YAW_PLANE = (ROLL, YAW)
YAW_PLANE = (YAW, SIDE_FORCE)


class ParityDirection(NamedTuple):
    """A parity direction as it is set up.

    nulled: the index of the surface to whose column of G the direction is orthogonal;
    VANE_VIEW + i if it is orthogonal to the effect of an error of the vane of force i, SIDE_INDEX or
    NORMAL_INDEX (`across_vane`); AXIS_VIEW if it is one row by itself (`is_axis`).
    rows: the rows on which the direction is 1 at the start (ROLL, PITCH, YAW, SIDE_FORCE, NORMAL_FORCE). The
    first `turn_view` in flight replaces this start, unless `is_axis`: a view across a lateral surface starts
    on roll alone, and then combines roll and yaw.
    plane_pair: the two rows in whose plane the direction lies: two rates, or a rate and a force.
    tested_losses: the indices of the surfaces for whose loss the view tests.
    by_inertia: the force is that at the flow angle from inertial motion.
    uses_vane_gust: a view of rates alone may subtract the gust estimate of the vanes. It is false if the
    direction is roll, or mainly roll, because the vanes measure no rolling gust.
    """

    nulled: int
    rows: tuple[int, ...]
    plane_pair: tuple[int, int]
    tested_losses: list[int]
    by_inertia: bool = False
    uses_vane_gust: bool = False

    @property
    def is_axis(self) -> bool:
        """Whether the direction is one row by itself."""
        return self.nulled == AXIS_VIEW

    @property
    def across_vane(self) -> bool:
        """Whether the direction is orthogonal to the effect of an error of a vane."""
        return self.nulled >= VANE_VIEW

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
    yield ParityDirection(AXIS_VIEW, (PITCH,), PITCH_PLANE, pitch, uses_vane_gust=True)
    yield ParityDirection(AXIS_VIEW, (ROLL,), ROLL_YAW_PLANE, lateral)
    yield ParityDirection(AXIS_VIEW, (YAW,), ROLL_YAW_PLANE, lateral, uses_vane_gust=True)
    for s in lateral:
        rolls = aircraft.dominant_axis[s] == ROLL  # then the direction across its column is mainly yaw
        others = [other for other in lateral if other != s]
        yield ParityDirection(s, (ROLL,), ROLL_YAW_PLANE, others, uses_vane_gust=rolls)
    if not with_forces:
        return
    for i, plane, tested in ((NORMAL_INDEX, PITCH_PLANE, pitch), (SIDE_INDEX, YAW_PLANE, lateral)):
        separable = aircraft.separated_by_force(FORCE_NAMES[i])
        for s in separable:
            pair = aircraft.dominant_axis[s], plane[1]
            yield ParityDirection(s, pair, pair, [other for other in tested if other != s])
        if separable:
            yield ParityDirection(VANE_VIEW + i, plane, plane, tested)
            yield ParityDirection(AXIS_VIEW, plane[1:], plane, tested, by_inertia=True)


def required_size(aircraft: Aircraft) -> StatisticalSize:
    """The capacities that the records of an aircraft need.

    regressors    block of rates    readings + terms of its moments
                  view              the same + terms of a force + further constants of a force (forces.py:
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
        vaned = subtracts and d.uses_vane_gust and not (d.is_axis and accelerometers_may_break)
        _configure_view(view, d, gusty, vaned)
        rates = stat["block"][PITCH_BLOCK if d.plane_pair == PITCH_PLANE else LATERAL_BLOCK]
        _configure_filter(view["block"], d, rates)
        _configure_columns(view, d, rates, stat["rows"], forces)
        _configure_hypotheses(view["block"], d, gusty)


def _configure_view(view: np.void, d: ParityDirection, gusty: bool, vaned: bool) -> None:
    """Fill the rows that a view combines, the axis that its alarm names, what is subtracted from its rates
    (`source`), and the force of the views that confirm it.

    vaned: whether the gust estimate of the vanes is subtracted from a view that sees no force. A view that
    sees a force always has it subtracted, unless it uses no vane (across a vane's column, or by inertia).
    """
    first, second = d.plane_pair
    if d.by_inertia:
        source = INERTIAL
    elif d.across_vane:
        source = VANELESS
    else:
        source = VANED if vaned or d.by_force else RAW
    view["block"]["source"] = source
    places = first, -1, second
    if d.across_vane and d.plane_pair == YAW_PLANE and gusty:
        # In moving air a view across the error of the side vane is orthogonal to the rolling gust as well.
        places = ROLL, YAW, second
    alarm_axis = d.rows[0] if d.is_axis and not d.by_inertia else first  # a force alone names its rate's axis
    # The force of the view's own plane confirms it; the side force confirms a view of roll and yaw.
    force = SIDE_FORCE if d.plane_pair == ROLL_YAW_PLANE else second
    confirmer = force if d.by_force or vaned else -1
    fill(
        view, nulled=d.nulled, by_force=d.by_force, places=places, alarm_axis=alarm_axis, confirmer=confirmer,
    )  # fmt: skip


def _configure_filter(b: np.void, d: ParityDirection, rates: np.void) -> None:
    """Fill direction and filter of a view's block from the block of the rates that the view combines."""
    rate_fields = {name: rates[name] for name in ("alarm_level", "noise_share", "eta_rate")}
    fill(b, n=1, a=1.0, Q_scale=1.0, any_position=1, **rate_fields)
    b["m"][0, d.rows], b["P_xx"][0, 0] = 1.0, rates["R_y"].max()
    b["P_dd"][0, 0] = likelihood.DRIFT_PRIOR_RAD_S2**2


def _configure_columns(
    view: np.void, d: ParityDirection, rates: np.void, rows: np.void, forces: np.void
) -> None:
    """Fill the regressors that a view sees: those of its rates, of its force, of the flow angle from inertial
    motion, and the leak, which is worked out in flight. A view of rates without regressors has no leak.
    """
    b = view["block"]
    columns = list(rates["columns"][: rates["n_Z"]])
    if not columns and not d.by_force:
        return
    if d.by_force:
        i = d.plane_pair[1] - SIDE_FORCE
        first = int(rows["first"][i])
        columns += range(first, first + int(forces["component"][i]["n_Z"]) + d.by_inertia)
    set_columns(b, rows, columns)
    if not d.is_axis:
        b["tol"][b["n_Z"]] = 1.0
        b["n_Z"] += 1


def _configure_hypotheses(b: np.void, d: ParityDirection, gusty: bool) -> None:
    """Fill the hypotheses of a view: a step of its innovation, and a loss of each surface that it tests."""
    # In moving air a view that sees the pitch rate tests no loss. A law that uses the vanes reacts to a gust,
    # and to the noise of the vanes, before the gyros measure a pitching effect. The effect of the elevator
    # then correlates with the noise of the view: with the whole gust, or, if the gust estimate of the vanes
    # is subtracted, with the noise of that estimate and the gust that it leaves.
    lost = [] if gusty and PITCH in d.rows else d.tested_losses
    kinds = [STEP_FAULT, *(LOSS for _ in lost)]
    b["n_h"] = len(kinds)
    hyps = b["hypothesis"][: len(kinds)]
    hyps["kind"], hyps["surface"], hyps["signature"][0, 0] = kinds, [-1, *lost], 1.0
    likelihood.set_signs(b, kinds)
