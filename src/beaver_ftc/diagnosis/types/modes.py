"""What the law does about each surface at fault: its mode of accommodation, with what the mode needs.

GIVE_UP, SCALE_COMMAND, WAIT_FOR_SURFACE    serve some types each (`FaultType.accommodation_mode`)
SUBTRACT_OFFSET                             serves the other types, and all while the mode is open

presumed    the surface that the law acts on while none is isolated
lead        the surface, and its mode, that the supervisor of the law follows (control/accommodation.py)
silent      a fault with whose deflection error the last frame does not agree

types       record of `fault_types_dtype`; layout: of `isolation.layout_dtype`
s, srf      surface, and its record (records.py)
kind        a type, TYPE_UNDECIDED or NO_TYPE (remaining.py)
sole        the only surface, or type, that remains
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.isolation import PITCH_GROUP
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    registry,
    set_middle,
)
from beaver_ftc.diagnosis.types.observations import last_error
from beaver_ftc.diagnosis.types.registry import (
    END_TYPE,
    ERROR_TYPES,
    MODE,
    N_CONSTANT,
    SERVES,
    VARYING_OF_MODE,
)
from beaver_ftc.diagnosis.types.remaining import any_remains, constant_remains, type_remains
from beaver_ftc.diagnosis.types.verdict import NO_SURFACE, can_be_faulty, sole_surface

MAX_SILENCE_S = 0.2  # a fault that has been silent for as long is taken for gone
_TIME_TOLERANCE_S = 1e-9


@kernel
def choose_mode(srf):
    """The mode of accommodation for a surface at fault, by the types that remain on it:

        a constant type      the first of GIVE_UP, SCALE_COMMAND, WAIT_FOR_SURFACE that `serves_constants`
        varying types alone  the first of SCALE_COMMAND, WAIT_FOR_SURFACE, GIVE_UP that one of them has
        otherwise            SUBTRACT_OFFSET

    SUBTRACT_OFFSET subtracts the `deflection_error`. It serves a type of another mode meanwhile, and it moves
    the command. A surface that does not follow its command then shows this in the next frame.
    """
    if constant_remains(srf):
        for mode in (GIVE_UP, SCALE_COMMAND, WAIT_FOR_SURFACE):
            if serves_constants(srf, mode):
                return mode
    else:
        for mode in (SCALE_COMMAND, WAIT_FOR_SURFACE, GIVE_UP):
            if any_remains(srf, VARYING_OF_MODE[mode]):
                return mode
    return SUBTRACT_OFFSET


@kernel
def serves_constants(srf, mode):
    """Whether a mode is that of some constant type that remains, and serves all of them. A type that becomes
    another at the end of its range (`END_TYPE`) is also served by a mode that serves that other one, while
    both remain."""
    is_used = False
    for h in range(N_CONSTANT):
        if type_remains(srf, h):
            is_used = is_used or MODE[h] == mode
            serves_end = END_TYPE[h] >= 0 and type_remains(srf, END_TYPE[h]) and SERVES[mode, END_TYPE[h]]
            if not (SERVES[mode, h] or serves_end):
                return False
    return is_used


@kernel
def presumed_surface(types, layout):
    """The surface that the law acts on while no surface is isolated (with pairs: none of pitch, and there is
    an alarm in pitch), or NO_SURFACE.

        the only one on which a constant type remains, or else
        single faults    the first surface of pitch that can be faulty
        pairs            the main surface of pitch

    The law acts before the surface is certain, because it can undo its action. It does not matter whether it
    presumes elevator or flap as long as both follow their commands: the moment is the same.
    """
    pair = types.pair
    if pair.enabled and not pair.group_alarm[PITCH_GROUP]:
        return NO_SURFACE
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated and (layout.group[s] == PITCH_GROUP or not pair.enabled):
            return NO_SURFACE
    sole = sole_surface(types.surface, True)
    if sole >= 0:
        return sole
    for s, srf in enumerate(types.surface):
        may_serve = s == layout.main[PITCH] if pair.enabled else can_be_faulty(srf)
        if layout.group[s] == PITCH_GROUP and may_serve:
            return s
    return NO_SURFACE


@kernel
def clear_modes(surfs):
    """Let the law act on no surface."""
    for srf in surfs:
        srf.accommodation.mode = -1


@kernel
def accommodate(types, layout):
    """Set the mode of each isolated or presumed surface whose fault has been silent for less than
    MAX_SILENCE_S, and -1 for the others; return the lead and its mode. A presumed surface that cannot be
    faulty has SUBTRACT_OFFSET.

    The lead is the first such surface, unless the main surface of pitch is one that another can replace
    (SCALE_COMMAND or GIVE_UP): it then leads.
    """
    lead = NO_SURFACE
    lead_mode = -1
    presumed = presumed_surface(types, layout)
    clear_modes(types.surface)
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated or s == presumed:
            possible = srf.status.is_isolated == 1 or can_be_faulty(srf)
            mode = choose_mode(srf) if possible else SUBTRACT_OFFSET
            count_silence(srf, mode, possible)
            if srf.accommodation.n_silent * types.config.dt < MAX_SILENCE_S - _TIME_TOLERANCE_S:
                srf.accommodation.mode = mode
                leads = s == layout.main[PITCH] and mode in (SCALE_COMMAND, GIVE_UP)
                if lead == NO_SURFACE or leads:
                    lead = s
                    lead_mode = mode
    return lead, lead_mode


@kernel
def count_silence(srf, mode, possible):
    """Count the frames in which the fault of a surface has been silent, n_silent. A frame agrees with the
    fault if u + `deflection_error` is a position that the surface can have had. If the mode scales the
    command, every frame counts as agreeing.

    possible: whether the surface can be faulty.
    """
    last = srf.last
    acc = srf.accommodation
    p = deflection_error(srf, possible) + last.u
    agrees = last.lo <= p <= last.hi or mode == SCALE_COMMAND
    acc.n_silent = 0 if agrees else acc.n_silent + 1


@kernel
def deflection_error(srf, possible):
    """The deflection error p - u of a surface, rad: of the first type in ERROR_TYPES that remains, if the
    surface can be faulty (possible) and this type knows its error; else as the last frame shows it."""
    if possible:
        for h in ERROR_TYPES:
            if type_remains(srf, h):
                e = registry.deflection_error(h, srf, h)
                if np.isfinite(e):
                    return e
                break
    return last_error(srf)


@kernel
def remaining_effectiveness(types, layout, est, s):
    """Remaining effectiveness 1 + theta of surface s, without unit: theta of the isolation estimator of its
    loss (`est`, which every surface has when all types are diagnosed).

    The estimator fits both axes of a surface, which a second fault may move. So where pairs are diagnosed,
    the middle of the set of a constant loss is used while that loss remains.
    """
    srf = types.surface[s]
    if types.pair.enabled and can_be_faulty(srf):
        for h in range(N_CONSTANT):
            if MODE[h] == SCALE_COMMAND and type_remains(srf, h):
                return set_middle(srf, h)
    return 1.0 + est[layout.loss[s]].theta[layout.dominant_axis[s]]
