"""The examination of a frame by every fault type.

In each frame: where was each surface, and was anything wrong? A frame is judged one frame later. In a frame
of several JSBSim steps, a fault may begin or end within the frame, which then shows only a part of the fault.
Such a frame, next to a healthy one, is skipped.

Where the noise of a gyro makes single frames uninformative, frames are examined in blocks (frame_blocks.py),
and "frame" below means a block. To the types a block is like a frame of several JSBSim steps: a block next to
a healthy one is skipped.

    types           record of `fault_types_dtype`; c: its configuration
    s, srf          surface, and its record (records.py); ev: its `evidence`
    h, k            number of a type, judged frame
    est, fie        estimators of the isolation, whose numbers the layout has, and one of them
    nu, bound       innovation (3,) rad/s2, record of `bound_dtype`
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import estimators
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    REST_EXCLUDES_TYPE,
    REST_POSITION_IS_PARAMETER,
    frame_blocks,
    intersect_set,
    put_set,
    release,
)
from beaver_ftc.diagnosis.types.observations import observe_surface
from beaver_ftc.diagnosis.types.registry import (
    HOLDS,
    N_TYPES,
    REST,
    STOP_SIDE,
    consistent_interval,
    deflection_range,
    parameter_range,
    reset_memory,
    see_frame,
)


@kernel
def restart_surface(srf):
    """Restart the diagnosis of one surface: every type remains, with its whole range, and no evidence counts.
    The observations and released types stay, until the next frames replace them."""
    srf.sets.excluded[:] = 0
    srf.last.lo = srf.actuator.reach_lo
    srf.last.hi = srf.actuator.reach_hi
    ev = srf.evidence
    ev.k_first = -1
    ev.n_anomalous = 0
    ev.n_rest = 0
    ev.n_unhidden = 0
    for h in range(N_TYPES):
        put_set(srf, h, parameter_range(h, srf, h))
        reset_memory(h, srf, h)
        release.allow_before(srf, h)


@kernel
def observe_surfaces(types, layout, est, nu, nu_max):
    """Find where each surface was in the elapsed frame, or block, if it alone is at fault."""
    anomalous = not estimators.eta_explains(nu, nu_max)
    for s, srf in enumerate(types.surface):
        fie = est[layout.position[s]]
        axis = layout.dominant_axis[s]
        eff = fie.mean_effect if types.config.frames_per_block > 1 else fie.effect
        observe_surface(types.config, srf, fie, axis, nu, nu_max, eff, anomalous)


@kernel
def count_anomaly(srf):
    """Count a frame as evidence, and as evidence since a stop could last hide a swing (`judge_frame`)."""
    srf.evidence.n_anomalous += 1
    srf.evidence.n_unhidden += 1


@kernel
def judge_types(c, srf, k):
    """Test every type of one surface with the judged frame, in which something was wrong."""
    ev = srf.evidence
    judged = srf.judged
    if judged.lo > judged.hi:  # no position explains the frame: this refutes the surface, and no single type
        return
    if ev.k_first < 0:
        ev.k_first = k
        ev.first_lo = judged.lo
        ev.first_hi = judged.hi
    for h in range(N_TYPES):
        if HOLDS[h]:
            intersect_set(srf, h, release.held_set(c, srf, h, *deflection_range(h, c, srf, h, k)))
        else:
            intersect_set(srf, h, consistent_interval(h, c, srf, h, k))


@kernel
def judge_frame(types):
    """Judge the frame before the elapsed one, k, of each surface (`judge_surface`). After that of all
    surfaces, a frame in which a stop may hide a swing restarts `n_unhidden`."""
    for s in range(types.surface.size):
        judge_surface(types, s, types.frame_index - 1)
    for srf in types.surface:
        if srf.judged.hides[0] or srf.judged.hides[1]:
            srf.evidence.n_unhidden = 0
    types.frame_index += 1


@kernel
def judge_surface(types, s, k):
    """Judge frame k of surface s in these steps:

        1  Every type sees the frame: its memory widens before it is compared.
        2  If a repaired surface returns late, a type that holds the surface may release it. It takes the sets
           as they were before this frame is judged, and where the type holds the surface as the release
           begins: in frame k if a frame has one instant, else in frame k - 1.
        3  rests: `count_rest`. counts: count the anomaly, and test every type with the releases of step 2.
        4  Returns after a release that step 3 has left move on to the end of the frame.

    rests: the surface is given up, nothing is wrong in the frame, and the fault is declared to stay. counts:
    something is wrong in the frame and, with several instants a frame, also in the one before and after it.
    """
    c = types.config
    srf = types.surface[s]
    judged = srf.judged
    returns = c.returns_lagged and k >= 0
    rests = c.abrupt and srf.accommodation.mode == GIVE_UP and not judged.anomalous
    counts = judged.anomalous and (c.single_instant or (srf.earlier.anomalous and srf.last.anomalous))
    for h in range(N_TYPES):
        see_frame(h, c, srf, h, k, not (rests or counts))
        if returns and HOLDS[h]:
            lo, hi = deflection_range(h, c, srf, h, k if c.single_instant else k - 1)
            release.begin_release(c, srf, h, lo, hi, STOP_SIDE[h])
    if rests:
        count_rest(types, s)
    if counts:
        count_anomaly(srf)
        judge_types(c, srf, k)
    for h in range(N_TYPES):
        if returns and HOLDS[h]:
            release.advance_returns(c, srf, h)


@kernel
def observe_frame(types, layout, est, nu, bound):
    """Observe the elapsed frame, or the block that it completes, and judge the one before."""
    if types.config.frames_per_block == 1:
        observe_surfaces(types, layout, est, nu, bound.nu_max)
    elif frame_blocks.extend_block(types, layout, est, nu, bound):
        observe_surfaces(types, layout, est, types.block.nu, types.block.nu_bound)
    else:
        return
    judge_frame(types)


@kernel
def count_rest(types, s):
    """Count a frame at rest of surface s, which is given up and commanded to where it happens to be: its
    quiet shows that it does not swing. The fault must be declared to stay: of one that may go, the quiet may
    be that of health.

        surface agrees (`agrees_at_rest`)             the frame counts as an anomaly of it
        and another surface, each may be the sole     it counts as an anomaly of the other: with one fault,
        one at fault                                  that rest is this fault's
        and has rested in more than half_frames       a fault that swings would have shown: types of
        (half of the slowest cycle)                   REST_EXCLUDES_TYPE are excluded, unless errors of the
                                                      surfaces' effects (has_eG) could hide the swing
    """
    srf = types.surface[s]
    if not agrees_at_rest(srf):
        return
    for i, other in enumerate(types.surface):
        if i == s or (srf.status.may_be_sole and other.status.may_be_sole):
            count_anomaly(other)
    srf.evidence.n_rest += 1
    if srf.evidence.n_rest > types.config.half_frames and not types.config.has_eG:
        for h in range(N_TYPES):
            if REST[h] == REST_EXCLUDES_TYPE:
                srf.sets.excluded[h] = 1


@kernel
def agrees_at_rest(srf):
    """Whether the judged frame agrees with where the surface stands: with the set of each type whose
    parameter is that position."""
    for h in range(N_TYPES):
        outside = srf.judged.lo > srf.sets.high[h] or srf.judged.hi < srf.sets.low[h]
        if REST[h] == REST_POSITION_IS_PARAMETER and outside:
            return False
    return True
