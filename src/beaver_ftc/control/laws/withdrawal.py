"""Withdrawing a surface: the default law uses it no longer, perhaps for a while.

A surface at its stop does not show why it does not follow its command: jams, offsets and losses look alike
there. In trim the reason shows. So a surface that is of doubtful use (`is_doubtful`) and stays at its stop is
commanded to its trim (`withdraw`). If another surface takes its place, it is tried again later.

    layout      record of `allocation.layout_dtype`
    memory      record of `rejecting.memory_dtype`: withdrawn, at_stop_s and out_of_use_s (n,)
    s           surface
"""

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel
from beaver_ftc.control.laws.evidence import is_effective

# A doubtful surface is withdrawn after this time at its stop: PATIENCE_S if another surface takes its place.
PATIENCE_S, LONG_PATIENCE_S = 0.5, 1.0
RETRY_S = 20.0  # If another surface takes its place, a withdrawn one is used again after this time.
# A frame off the stop takes STOP_RECOVERY - 1 frames from the time at the stop: a command that swings leaves
# the stop only briefly.
STOP_RECOVERY = 1.5


@kernel
def is_replaced(layout, s):
    """Whether another surface can take the place of surface s."""
    return layout.stand_in >= 0 and (s == layout.main[PITCH] or s == layout.stand_in)


@kernel
def is_doubtful(assessment, sums, layout, s, target, least):
    """Whether surface s, which the diagnosis has named, may be of no use. Either condition suffices:

    - Another surface can take its place.
    - Its type is open, or its effectiveness `target` is below `least`; and the observer does not see it act
      either (`is_effective`; sums: those of evidence.py).
    """
    if is_replaced(layout, s):
        return True
    is_open = assessment.diagnoses_all_types and assessment.accommodation_mode[s] < 0
    return (is_open or target < least) and not is_effective(sums, layout.main, s, least)


@kernel
def withdraw(memory, layout, s, saturated, suspected, dt):
    """Withdraw surface s if it is suspected of a fault and has stood at its stop for a while.

    T, s: at_stop_s, the time at the stop; t, s: out_of_use_s, the time in trim since it was withdrawn.

        state       condition                               T                      t          next state
        any         not suspected                           0                      0          in use
        withdrawn   t > RETRY_S, another takes its place    0                      0          in use
        withdrawn   otherwise                               0                      t + dt     withdrawn
        in use      not saturated                           max(T + dt - k dt, 0)  0          in use
        in use      saturated, T > patience                 0                      0          withdrawn
        in use      saturated, otherwise                    T + dt                 0          in use

    T, t in a condition count this frame. patience: PATIENCE_S if another surface takes its place, else
    LONG_PATIENCE_S. k: STOP_RECOVERY.
    """
    T = memory.at_stop_s
    t = memory.out_of_use_s
    if not suspected:
        memory.withdrawn[s] = 0
        T[s] = 0.0
        t[s] = 0.0
    elif memory.withdrawn[s]:
        t[s] += dt
        if t[s] > RETRY_S and is_replaced(layout, s):
            memory.withdrawn[s] = 0
            t[s] = 0.0
    else:
        T[s] += dt
        if not saturated:
            T[s] = max(T[s] - STOP_RECOVERY * dt, 0.0)
        elif T[s] > (PATIENCE_S if is_replaced(layout, s) else LONG_PATIENCE_S):
            memory.withdrawn[s] = 1
            T[s] = 0.0
