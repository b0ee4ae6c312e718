"""Hold every type against the elapsed frame, or block of frames: where was each surface, was anything wrong?

A frame is judged one frame later: with several JSBSim frames in one of ours a fault may begin or end within a
frame, which then shows a part of it; such a frame, next to a healthy one, is skipped.

Where the noise of a gyro makes single frames uninformative, frames are examined in blocks. Summed over a
block the innovation holds the noise of its two ends alone, n[k+N] - n[k]. So the mean over N frames has the
bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

which gives the mean position of the surface, weighted by its effectiveness G, whose sign stays. The weighted
mean of a constant position, offset or effectiveness is exact; that of a varying one lies between its
extremes. To the types a block is like a frame that consists of several JSBSim frames: a block next to a
healthy one is skipped.

types: of `types_dtype`. estimators: those of the isolation, by the layout. bound: of `bound_dtype`.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.types import contract
from beaver_ftc.diagnosis.types.contract import GIVE_UP, REST_AGREES, REST_EXCLUDES
from beaver_ftc.diagnosis.types.registry import (
    AT_REST,
    N_KEPT_BLOCKS,
    N_TYPES,
    begin_each,
    fill_each,
    judge_each,
    on_frame_each,
    on_release_each,
    on_skipped_frame_each,
    propagate_release_each,
    restore_each,
)


@kernel
def restart_types(types):
    """Nothing is known of any surface yet."""
    for surface in types.surface:
        restart_surface(surface)


@kernel
def restart_surface(surface):
    """Nothing is known of this surface yet."""
    contract.begin_sets(surface)
    fill_each(surface)
    contract.begin_observation(surface)
    surface.evidence.started_at = -1
    surface.evidence.frames = surface.evidence.rest_frames = surface.evidence.unhidden_frames = 0
    begin_each(surface)


@kernel
def record_commands(types, commanded, means):
    """Add a frame to the orders of the surfaces: commanded (n,) rad; positions of healthy surfaces and their
    least and greatest effectiveness within it: means of a `belief.means_dtype`.
    """
    length = types.config.length
    for s, surface in enumerate(types.surface):
        commands = surface.commands
        if types.block.filled == 0:
            for age in range(N_KEPT_BLOCKS - 1, 0, -1):
                commands.given[age, :length] = commands.given[age - 1, :length]
                commands.low[age], commands.high[age] = commands.low[age - 1], commands.high[age - 1]
            commands.low[0], commands.high[0] = np.inf, -np.inf
            commands.least[1], commands.greatest[1] = commands.least[0], commands.greatest[0]
            commands.least[0], commands.greatest[0] = np.inf, -np.inf
            commands.G_least, commands.G_most = np.inf, -np.inf
        order = min(max(commanded[s], surface.actuator.travel_low), surface.actuator.travel_high)
        commands.given[0, types.block.filled] = order
        commands.low[0], commands.high[0] = min(commands.low[0], order), max(commands.high[0], order)
        commands.least[0] = min(commands.least[0], means.u_least[s])
        commands.greatest[0] = max(commands.greatest[0], means.u_most[s])
        commands.G_least = min(commands.G_least, means.G_least[s])
        commands.G_most = max(commands.G_most, means.G_most[s])


@kernel
def observe_frame(types, layout, estimators, innovation, bound):
    """Find where each surface was in the elapsed frame, or block, if it alone is at fault.

    bound (3,): on its innovation (3,) without a fault, rad/s2.
    """
    anomalous = not isolation.is_healthy(innovation, bound)
    for s, surface in enumerate(types.surface):
        contract.shift_observations(surface)
        contract.set_anomalous(surface, anomalous)
        fie, axis = estimators[layout.position_estimator[s]], layout.dominant_axis[s]
        effect = fie.block_effect if types.config.length > 1 else fie.effect
        contract.locate_surface(types.config, surface, fie, axis, innovation, bound, effect)


@kernel
def count_evidence(surface):
    """Count a frame as evidence, and as evidence since a stop could last hide a swing (`judge_frame`)."""
    surface.evidence.frames += 1
    surface.evidence.unhidden_frames += 1


@kernel
def judge_surface(config, surface, k):
    """Hold every type of one surface against the frame before the elapsed one: something was wrong in it."""
    evidence, seen = surface.evidence, surface.judged
    if seen.low > seen.high:
        return
    if evidence.started_at < 0:
        evidence.started_at, evidence.start_low, evidence.start_high = k, seen.low, seen.high
    judge_each(config, surface, k)


@kernel
def judge_frame(types):
    """Judge the frame before the elapsed one."""
    config, k = types.config, types.frame - 1
    for s, surface in enumerate(types.surface):
        on_frame_each(config, surface)
        if config.released_returns and types.frame > 0:
            on_release_each(config, surface, k)
        if config.abrupt and surface.accommodation.mode == GIVE_UP and not surface.judged.anomalous:
            count_rest(types, s)
        elif surface.judged.anomalous and (
            config.whole or (surface.earlier.anomalous and surface.elapsed.anomalous)
        ):
            count_evidence(surface)
            judge_surface(config, surface, k)
        else:
            on_skipped_frame_each(config, surface, k)
        if config.released_returns and types.frame > 0:
            restore_each(surface)
            propagate_release_each(config, surface)
        if surface.judged.stop_hides[0] or surface.judged.stop_hides[1]:
            surface.evidence.unhidden_frames = 0
    types.frame += 1


@kernel
def examine_frame(types, layout, estimators, innovation, bound):
    """Observe the elapsed frame, or the block that it completes, and judge the one before."""
    if types.config.length > 1:
        examine_block(types, layout, estimators, innovation, bound)
        return
    observe_frame(types, layout, estimators, innovation, bound.frame)
    judge_frame(types)


@kernel
def begin_block(types, layout, estimators, noise_before):
    """Begin a block with the elapsed frame; noise_then (3,): as it began."""
    block = types.block
    block.innovation[:], block.bound[:] = 0.0, 0.0
    block.noise[:] = noise_before
    for e in layout.position_estimator:
        isolation.clear_mean_effect(estimators[e].block_effect)


@kernel
def add_to_block(types, layout, estimators, innovation, eta_bar):
    """Add the elapsed frame to the means over the block."""
    block, share = types.block, 1.0 / types.config.length
    for i in range(3):
        block.innovation[i] += share * innovation[i]
        block.bound[i] += share * eta_bar[i]
    for e in layout.position_estimator:
        isolation.add_to_mean_effect(estimators[e].block_effect, estimators[e].effect, share)


@kernel
def examine_block(types, layout, estimators, innovation, bound):
    """Add the elapsed frame to its block; with the last frame, observe the block and judge the one before."""
    config, block = types.config, types.block
    if block.filled == 0:
        begin_block(types, layout, estimators, bound.noise_before)
    add_to_block(types, layout, estimators, innovation, bound.eta_bar)
    block.filled += 1
    if block.filled < config.length:
        return
    block.filled = 0
    for i in range(3):
        block.bound[i] += (block.noise[i] + bound.noise[i]) / config.block_s
    observe_frame(types, layout, estimators, block.innovation, block.bound)
    judge_frame(types)


@kernel
def count_rest(types, s):
    """A surface given up, and commanded to where it happens to be, shows by its quiet that it does not swing.

    That is evidence against the other surfaces too, as far as only one of them all is in question. It takes a
    fault that is declared to stay: of one that may go, the quiet may be that of health.
    """
    surface = types.surface[s]
    if not agrees_with_rest(surface):
        return
    for i, other in enumerate(types.surface):
        if i == s or (surface.status.is_candidate and other.status.is_candidate):
            count_evidence(other)
    surface.evidence.rest_frames += 1
    if surface.evidence.rest_frames > types.config.half_cycle_frames and not types.config.has_surface_errors:
        for kind in range(N_TYPES):
            if AT_REST[kind] == REST_EXCLUDES:
                contract.exclude_type(surface, kind)


@kernel
def agrees_with_rest(surface):
    """Whether the judged frame agrees with where the surface is known to stand."""
    for kind in range(N_TYPES):
        low, high = surface.feasible.low[kind], surface.feasible.high[kind]
        apart = surface.judged.low > high or surface.judged.high < low
        if AT_REST[kind] == REST_AGREES and apart:
            return False
    return True
