"""The examination of a frame by every fault type.

In each frame, or block of frames: where was each surface, and was anything wrong? A frame is judged one frame
later. In a frame of several JSBSim steps, a fault may begin or end within the frame, which then shows only a
part of the fault. Such a frame, next to a healthy one, is skipped.

Where the noise of a gyro makes single frames uninformative, frames are examined in blocks. Summed over a
block the innovation holds the noise of its two ends alone, n[k+N] - n[k]. So the mean over N frames has the
bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

It gives the mean position of the surface, weighted by its effectiveness G, whose sign stays. The weighted
mean of a constant position, offset or effectiveness is exact; that of a varying one lies between its
extremes. To the types a block is like a frame of several JSBSim steps: a block next to a healthy one is
skipped.

types: of `fault_types_dtype`. est: the estimators of the isolation; the layout has their numbers. bound: of
`bound_dtype`. Other symbols: types/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel
from beaver_ftc.diagnosis import estimators, isolation
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    REST_EXCLUDES_TYPE,
    REST_POSITION_IS_PARAMETER,
    clip_travel,
    copy_observation,
    intersect_set,
    observe_surface,
    put_set,
    release,
    set_anomalous,
)
from beaver_ftc.diagnosis.types.records import N_KEPT
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
    srf.last.lo, srf.last.hi = srf.actuator.reach_lo, srf.actuator.reach_hi
    ev = srf.evidence
    ev.k_first, ev.n_anomalous, ev.n_rest, ev.n_unhidden = -1, 0, 0, 0
    for h in range(N_TYPES):
        put_set(srf, h, parameter_range(h, srf, h))
        reset_memory(h, srf, h)
        release.allow_before(srf, h)


@kernel
def record_commands(types, commands, ext):
    """Add a frame to the record of the commands (n,) rad. With the first frame of a block, the record moves
    on by a block: index 1 is then the block before. `extend_block` counts the frames of a block.

    cmd: command of a surface, limited by its stops, rad. ext: of a `model_prediction.frame_means_dtype`: the
    extremes, within the frame, of u, where a healthy surface was, rad, and of G, rad/s2 per rad.
    """
    n = types.config.frames_per_block
    for s, srf in enumerate(types.surface):
        stored = srf.commands
        if types.block.n_so_far == 0:
            for b in range(N_KEPT - 1, 0, -1):
                copy(stored.history[b - 1, :n], stored.history[b, :n])
                for ends in (stored.cmd_min, stored.cmd_max):
                    ends[b] = ends[b - 1]
            for ends in (stored.u_min, stored.u_max):
                ends[1] = ends[0]
            stored.cmd_min[0] = stored.u_min[0] = stored.G_min = np.inf
            stored.cmd_max[0] = stored.u_max[0] = stored.G_max = -np.inf
        cmd = clip_travel(srf, commands[s])
        stored.history[0, types.block.n_so_far] = cmd
        stored.cmd_min[0], stored.cmd_max[0] = (min(stored.cmd_min[0], cmd), max(stored.cmd_max[0], cmd))
        stored.u_min[0] = min(stored.u_min[0], ext.u_min[s])
        stored.u_max[0] = max(stored.u_max[0], ext.u_max[s])
        stored.G_min = min(stored.G_min, ext.G_min[s])
        stored.G_max = max(stored.G_max, ext.G_max[s])


@kernel
def observe_surfaces(types, layout, est, nu, nu_max):
    """Find where each surface was in the elapsed frame, or block, if it alone is at fault. The observations
    move on by one: judged becomes earlier, last becomes judged."""
    anomalous = not estimators.eta_explains(nu, nu_max)
    for s, srf in enumerate(types.surface):
        copy_observation(srf.earlier, srf.judged)
        copy_observation(srf.judged, srf.last)
        set_anomalous(srf, anomalous)
        fie, axis = est[layout.position[s]], layout.dominant_axis[s]
        eff = fie.mean_effect if types.config.frames_per_block > 1 else fie.effect
        observe_surface(types.config, srf, fie, axis, nu, nu_max, eff)


@kernel
def count_anomaly(srf):
    """Count a frame as evidence, and as evidence since a stop could last hide a swing (`judge_frame`)."""
    srf.evidence.n_anomalous += 1
    srf.evidence.n_unhidden += 1


@kernel
def judge_types(c, srf, k):
    """Test every type of one surface with the judged frame, in which something was wrong."""
    ev, judged = srf.evidence, srf.judged
    if judged.lo > judged.hi:  # no position explains the frame: this refutes the surface, and no single type
        return
    if ev.k_first < 0:
        (ev.k_first, ev.first_lo, ev.first_hi) = (k, judged.lo, judged.hi)
    for h in range(N_TYPES):
        if HOLDS[h]:
            intersect_set(srf, h, release.held_set(c, srf, h, *deflection_range(h, c, srf, h, k)))
        else:
            intersect_set(srf, h, consistent_interval(h, c, srf, h, k))


@kernel
def judge_frame(types):
    """Judge the frame before the elapsed one, k, of each surface in these steps:

        1  Every type sees the frame: its memory widens before it is compared.
        2  If a repaired surface returns late, a type that holds the surface may release it. It takes the sets
           as they were before this frame is judged, and where the type holds the surface as the release
           begins: in frame k if a frame has one instant, else in frame k - 1.
        3  rests: `count_rest`. counts: count the anomaly, and test every type with the releases of step 2.
        4  Returns after a release that step 3 has left move on to the end of the frame.
        5  After these steps of all surfaces: a frame in which a stop may hide a swing restarts `n_unhidden`.

    rests: the surface is given up, nothing is wrong in the frame, and the fault is declared to stay. counts:
    something is wrong in the frame and, with several instants a frame, also in the one before and after it.
    """
    c, k = types.config, types.frame_index - 1
    returns = c.returns_lagged and types.frame_index > 0
    for s, srf in enumerate(types.surface):
        judged = srf.judged
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
        # The judgement needs positions at the beginning of the judged frame; from here on those at its end.
        for h in range(N_TYPES):
            if returns and HOLDS[h]:
                release.advance_returns(c, srf, h)
    for srf in types.surface:
        if srf.judged.hides[0] or srf.judged.hides[1]:
            srf.evidence.n_unhidden = 0
    types.frame_index += 1


@kernel
def observe_frame(types, layout, est, nu, bound):
    """Observe the elapsed frame, or the block that it completes, and judge the one before."""
    if types.config.frames_per_block > 1:
        extend_block(types, layout, est, nu, bound)
        return
    observe_surfaces(types, layout, est, nu, bound.nu_max)
    judge_frame(types)


@kernel
def extend_block(types, layout, est, nu, bound):
    """Add the elapsed frame to the means over its block; with the last frame, observe the block and judge
    the one before:

    nu_bound = mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)
    """
    c, block = types.config, types.block
    share = 1.0 / c.frames_per_block
    if block.n_so_far == 0:
        block.nu[:] = block.nu_bound[:] = 0.0
        block.n_start = bound.n_old
    for j in layout.position:
        isolation.add_to_mean(est[j].mean_effect, est[j].effect, share, block.n_so_far == 0)
    block.n_so_far += 1
    for i in range(3):
        block.nu[i] += share * nu[i]
        block.nu_bound[i] += share * bound.eta_bar[i]
    if block.n_so_far == c.frames_per_block:
        for i in range(3):
            block.nu_bound[i] += (block.n_start[i] + bound.n_gyro[i]) / c.block_duration_s
        block.n_so_far = 0
        observe_surfaces(types, layout, est, block.nu, block.nu_bound)
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
