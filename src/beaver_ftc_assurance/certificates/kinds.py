"""Exclusions of fault types whose parameter one number is: two frames that no such number explains.

Stuck p = c, floating p = 0, a loss p = (1 + theta) u: so is a surface at fault in frames that health does not
explain. The others are excluded by their course over many frames (courses.py). What an actuator brings back
by and by is not certified.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf

import numpy as np

from beaver_ftc.diagnosis.types import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis.types import TYPE_WORDS as WORDS
from beaver_ftc.diagnosis.types import kind_of
from beaver_ftc_assurance.certificates.inequality import (
    History,
    Hypothesis,
    Term,
    constant_pair,
    of_one_frame,
)
from beaver_ftc_assurance.certificates.tape import Tape

COURSE = "frames of quiet excluded it, or what several say together"
SWING = "of several instants a frame, a swing that a stop cuts off may keep its sign"
UNKNOWN = "no certificate is known for this type"
RETURN = "its actuator may be bringing the surface back"
CONSTANT_LOSS, STUCK, FLOAT, BIAS = map(kind_of, ("loss_of_effectiveness", "stuck", "float", "bias"))
VARYING_LOSS = kind_of("loss_of_effectiveness", constant=False)
BY_FRAMES = (CONSTANT_LOSS, VARYING_LOSS, STUCK, FLOAT)  # what single frames can exclude


def excluded_types(tape: Tape) -> Iterator[tuple[int, int, int]]:
    """(surface, type, frame) of each type excluded on a surface that can be at fault."""
    layout = tape.alarm.diagnosis.layout
    for s, kinds in enumerate(tape.types[-1]):
        if tape.excluded[-1][layout.position_estimator[s]]:
            continue
        for kind in np.flatnonzero(kinds):
            yield s, int(kind), tape.first + int(np.argmax(tape.types[:, s, kind] > 0))


def why_not(tape: Tape, kind: int) -> str | None:
    """Why an exclusion of this type cannot be certified, None if it can."""
    config = tape.alarm.diagnosis.types_config
    if TYPES[kind].has_shown is not None and not config.single_instant:
        return SWING
    return RETURN if config.returns and TYPES[kind].on_release is not None else None


def name_of(surface: str, kind: int) -> str:
    """What is excluded, in words."""
    return f"{surface} {WORDS[kind]}"


def column_of(surface: str, kind: int) -> str:
    """The column of the log that says whether it is excluded."""
    return f"{name_of(surface, kind).replace(' ', '_')}_excluded"


def row_of(tape: Tape, s: int, kind: int) -> int:
    """The row from which on a type that is excluded at the end has been."""
    clear = np.flatnonzero(~(tape.types[:, s, kind] > 0))
    return tape.first + (int(clear[-1]) + 1 if len(clear) else 0)


def hypothesis(tape: Tape, s: int, kind: int) -> Hypothesis:
    """What a fault of this type on surface s adds to the innovation."""
    diagnosis = tape.alarm.diagnosis
    e = diagnosis.layout.position_estimator[s]
    Gu, G, spread = -tape.offset[:, e], tape.slope[:, e], tape.spread[:, e]
    asked = diagnosis.estimators[e].axes
    if diagnosis.types_config.block_frames > 1:  # blocks: the axis on which no effect changes its sign
        asked = (diagnosis.layout.dominant_axis[s],)
    actuator = diagnosis.surfaces[s].actuator
    low, high = actuator.travel_low_rad, actuator.travel_high_rad
    if kind == STUCK:
        return Hypothesis(tape.first, -Gu, G, spread, low, high, True, True, asked)
    if kind == FLOAT:
        neutral = min(max(0.0, low), high)
        return Hypothesis(tape.first, neutral * G - Gu, 0.0 * G, spread, 0.0, 0.0, True, True, asked)
    if kind == BIAS:  # away from the stops
        return Hypothesis(tape.first, 0.0 * G, G, spread, low - high, high - low, True, True, asked)
    loss = Hypothesis(tape.first, 0.0 * G, Gu, spread, -1.0, 0.0, True, True, asked)
    return loss if kind == CONSTANT_LOSS else replace(loss, constant=False, shown=False)


def candidates(of: Hypothesis, history: History, alarm: int, k: int) -> Iterator[list[Term]]:
    """Inequalities that may exclude it by frame k."""
    if not of.constant:
        for frame in (k - 1, k):
            yield from of_one_frame(frame, of)
        return
    frames = np.arange(alarm, k + 1)
    frames = frames[wrong(history, frames)]
    if of.slope.any():
        yield constant_pair(of, history, frames)
    for frame in frames[-3:].tolist():
        yield from ([Term(sign * d, inf, frame - 1, frame)] for d in np.eye(3) for sign in (1.0, -1.0))


def wrong(history: History, frames: np.ndarray) -> np.ndarray:
    """In which frames health explains nothing; of several instants, nor in those beside them."""
    rows = slice(int(frames[0]) - 1, min(int(frames[-1]) + 2, len(history.x)))
    innovation, bound = history.innovation(rows), history.frame_bound(rows)
    beyond = (np.abs(innovation) > bound).any(axis=1)
    beside = np.r_[beyond, np.zeros(len(frames) + 2 - len(beyond), bool)]
    if history.share == 1.0:
        return np.asarray(beside[1:-1])
    return np.asarray(beside[:-2] & beside[1:-1] & beside[2:])
