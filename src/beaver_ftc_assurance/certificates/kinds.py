"""Exclusions of fault types with a relation: the command and one parameter theta give the deflection
(`FaultType`).

A single frame excludes such a type if no theta explains the frame. If theta is constant while the fault
shows, two frames that no single theta explains exclude it, too. A type whose row names a course is excluded
by a comparison of many frames (courses.py). `reason_not_certified` says which exclusions have no certificate.
"""

from collections.abc import Iterator

import numpy as np

from beaver_ftc.diagnosis import DESCRIPTIONS_IN_TYPE_ORDER as WORDS
from beaver_ftc.diagnosis import TYPE_NAMES
from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc_assurance.certificates.check_certificate import COURSES, RELATIONS, Relation
from beaver_ftc_assurance.certificates.history import History
from beaver_ftc_assurance.certificates.inequality import ANY, CONSTANT_WHILE_SHOWN, Hypothesis
from beaver_ftc_assurance.certificates.tape import KEPT_AFTER_EVENT_S, MAX_FRAMES_AFTER_ALARM, Tape

EXCLUDED_BY_MANY_FRAMES = "frames of quiet excluded it, or what several say together"
OSCILLATION_AT_STOP = "of several instants a frame, a swing that a stop cuts off may keep its sign"
TOO_LATE = f"more than {MAX_FRAMES_AFTER_ALARM} frames after the alarm, or with another diagnosis restarted"
TYPE_TOO_LATE = (
    f"more than {KEPT_AFTER_EVENT_S:g} s after the alarm and all exclusions of surfaces, or {TOO_LATE}"
)
UNKNOWN_TYPE = "no certificate is known for this type"
RETURNING_SURFACE = "its actuator may be bringing the surface back"
STUCK = TYPE_NAMES.index("stuck")


def excluded_types(tape: Tape) -> Iterator[tuple[int, int, int]]:
    """(surface, type, first frame with the flag) of each type that is excluded at the end of the tape or of
    the flight, on surfaces whose position estimator is not excluded at the same end, nor at that of the tape.
    The frame is `tape.end` if the type was excluded after the tape."""
    layout = tape.alarm.diagnosis.layout
    remaining = np.flatnonzero(~tape.last.diagnosis.is_estimator_excluded)
    for s, surface in enumerate(tape.last.diagnosis.surface_fault_types):
        e = layout.position_estimator[s]
        if tape.excluded[-1][e]:
            continue
        flags = np.vstack([tape.types[:, s] > 0, surface.is_type_excluded & (e in remaining)])
        for kind in np.flatnonzero(flags[-2:].any(axis=0)):
            yield s, int(kind), tape.first + int(np.argmax(flags[:, kind]))


def reason_not_certified(tape: Tape, kind: int) -> str | None:
    """Why an exclusion of this type cannot be certified; None if it can.

    frames of several instants, and a type that shows itself    an oscillation may seem to keep its sign
    actuators that bring a surface back over several frames,    the surface may be on its way back
    and a type that holds the surface
    neither a course nor a relation                             no inequality is known
    """
    config = tape.alarm.diagnosis.types_config
    if TYPES[kind].has_shown is not None and not config.single_instant:
        return OSCILLATION_AT_STOP
    if config.returns_lagged and TYPES[kind].holds_surface:
        return RETURNING_SURFACE
    return None if TYPES[kind].frames_test or TYPES[kind].deflection_relation is not None else UNKNOWN_TYPE


def exclusion_name(surface: str, kind: int) -> str:
    """Words for the excluded type on a surface."""
    return f"{surface} {WORDS[kind]}"


def exclusion_column(surface: str, kind: int) -> str:
    """The column of the log with the flag of an exclusion."""
    return f"{exclusion_name(surface, kind).replace(' ', '_')}_excluded"


def travel_rad(tape: Tape, s: int) -> tuple[float, float]:
    """Low and high end of the travel of a surface, rad."""
    actuator = tape.alarm.diagnosis.surface_fault_types[s].actuator
    return actuator.travel_low_rad, actuator.travel_high_rad


def type_definition_columns(tape: Tape, surface: str, s: int, kind: int) -> dict[str, float]:
    """Name -> value of the columns of the log that define a type for the checker; none if the checker defines
    the type itself. A type with a course has the direction of its stop in a column whose name has the course;
    a type with a relation has the fields of `Relation`.
    """
    row = TYPES[kind]
    name = exclusion_name(surface, kind).replace(" ", "_")
    if WORDS[kind] in {*RELATIONS, *COURSES}:
        return {}
    if row.frames_test:
        return {f"{name}_course_{row.frames_test.replace(' ', '_')}": row.stop_direction}
    if row.deflection_relation is None:
        return {}
    type_relation = row.deflection_relation
    relation = Relation(
        type_relation.command_gain,
        type_relation.theta_is_share,
        row.has_constant_parameter,
        *type_relation.theta_span(*travel_rad(tape, s)),
    )
    return {f"{name}_{column}": float(value) for column, value in relation._asdict().items()}


def hypothesis_of_type(history: History, surface: int, fault_type: int) -> Hypothesis:
    """The effect G (p - u) on the innovation of a fault of this type on a surface; p: position of the
    surface, u: command in effect, rad; G: effectiveness. By the relation of the type

        p = gain u + theta           G (p - u) = (gain - 1) G u + theta G
        p = (gain + theta) u         G (p - u) = (gain - 1) G u + theta G u        if theta is a share

    For `STUCK`, theta is the position. The position estimator of the surface has -G u as its offset, and G as
    its slope.
    """
    row = TYPES[fault_type]
    tape = history.tape
    diagnosis = tape.alarm.diagnosis
    assert row.deflection_relation is not None
    gain, theta_is_share, theta_span = row.deflection_relation
    e = diagnosis.layout.position_estimator[surface]
    Gu = -tape.offset[:, e]
    G = tape.slope[:, e]
    spread = tape.spread[:, e]
    axes = diagnosis.estimators[e].active_axes
    if diagnosis.types_config.frames_per_block > 1:  # over a block, axes weigh a varying position differently
        axes = (diagnosis.layout.dominant_axis[surface],)
    low, high = theta_span(*travel_rad(tape, surface))
    offset = (gain - 1.0) * Gu
    slope = Gu if theta_is_share else G
    if low == high:  # theta is known
        offset = offset + low * slope
        slope = 0.0 * slope
        low = 0.0
        high = 0.0
    theta = CONSTANT_WHILE_SHOWN if row.has_constant_parameter else ANY
    return Hypothesis(history, offset, slope, spread, low, high, theta, axes)
