"""Blocks of frames: what each surface was commanded, and the means of innovation and bound.

Where the noise of a gyro makes single frames uninformative, frames are examined in blocks. Summed over a
block the innovation holds the noise of its two ends alone, n[k+N] - n[k]. So the mean over N frames has the
bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

It gives the mean position of the surface, weighted by its effectiveness G, whose sign stays. The weighted
mean of a constant position, offset or effectiveness is exact; that of a varying one lies between its
extremes. Without noise a block is one frame, and its commands are recorded all the same.

    types    of `fault_types_dtype`; N: frames_per_block
    s, srf   surface, and its record (records.py)
    cmd      COMMANDS_RECORD of a surface; index 0 is the elapsed block, 1 the one before it
    u        deflection of a healthy surface, rad
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.types import clip_travel
from beaver_ftc.diagnosis.types.records import N_KEPT


@kernel
def record_commands(types, commands, ext):
    """Add a frame to the record of the commands (n,) rad, each limited by the stops of its surface. The first
    frame of a block moves the record on. `extend_block` counts the frames of a block.

    ext: of a `model_prediction.frame_means_dtype`: the extremes, within the frame, of u, where a healthy
    surface was, rad, and of G, rad/s2 per rad.
    """
    for s, srf in enumerate(types.surface):
        cmd = srf.commands
        u_c = clip_travel(srf, commands[s])
        if types.block.n_so_far == 0:
            begin_commands(cmd, types.config.frames_per_block)
        cmd.history[0, types.block.n_so_far] = u_c
        cmd.cmd_min[0] = min(cmd.cmd_min[0], u_c)
        cmd.cmd_max[0] = max(cmd.cmd_max[0], u_c)
        cmd.u_min[0] = min(cmd.u_min[0], ext.u_min[s])
        cmd.u_max[0] = max(cmd.u_max[0], ext.u_max[s])
        cmd.G_min = min(cmd.G_min, ext.G_min[s])
        cmd.G_max = max(cmd.G_max, ext.G_max[s])


@kernel
def begin_commands(cmd, N):
    """Move the record of a surface on by a block of N frames; the extremes of the new block are empty."""
    for b in range(N_KEPT - 1, 0, -1):
        copy(cmd.history[b - 1, :N], cmd.history[b, :N])
        for ends in (cmd.cmd_min, cmd.cmd_max):
            ends[b] = ends[b - 1]
    for ends in (cmd.u_min, cmd.u_max):
        ends[1] = ends[0]
    cmd.cmd_min[0] = cmd.u_min[0] = cmd.G_min = np.inf
    cmd.cmd_max[0] = cmd.u_max[0] = cmd.G_max = -np.inf


@kernel
def extend_block(types, layout, est, nu, bound):
    """Add the elapsed frame to the means over its block; returns whether the block is complete. Its bound is
    then

    nu_bound = mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)
    """
    c = types.config
    block = types.block
    begins = block.n_so_far == 0
    share = 1.0 / c.frames_per_block
    if begins:
        block.nu[:] = block.nu_bound[:] = 0.0
        block.n_start = bound.n_old
    for j in layout.position:
        isolation.add_to_mean(est[j].mean_effect, est[j].effect, share, begins)
    for i in range(3):
        block.nu[i] += share * nu[i]
        block.nu_bound[i] += share * bound.eta_bar[i]
    block.n_so_far += 1
    if block.n_so_far < c.frames_per_block:
        return False
    for i in range(3):
        block.nu_bound[i] += (block.n_start[i] + bound.n_gyro[i]) / c.block_duration_s
    block.n_so_far = 0
    return True
