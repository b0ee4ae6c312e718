"""Frames examined in blocks, where a gyro's noise makes a single frame say little.

Summed over a block the innovation holds the noise of its two ends alone, n[k+N] - n[k].
So the mean over N frames has the bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

and with it says where the surface was in the mean, weighted by its effectiveness G, whose sign stays. Of a
constant position, offset or effectiveness the weighted mean is exact; of what varies it lies between the
extremes. A block is then to the types what a frame is that consists of several JSBSim frames: one next to a
healthy one is passed over.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import fault_types, membership
from beaver_ftc.diagnosis.fault_types import POSITION_FIRST


@kernel
def begin(fdi):
    """Begin a block with the elapsed frame."""
    fdi.block_innovation[:], fdi.block_eta[:] = 0.0, 0.0
    fdi.block_noise[:] = fdi.noise_then
    for s in range(4):
        fie, surface = fdi.estimator[POSITION_FIRST + s], fdi.surface[s]
        fie.block_offset[:], fie.block_Z[:], fie.block_spread[:] = 0.0, 0.0, 0.0
        surface.least_command[1], surface.greatest_command[1] = (
            surface.least_command[0],
            surface.greatest_command[0],
        )
        surface.least_command[0], surface.greatest_command[0] = np.inf, -np.inf


@kernel
def add(fdi):
    """Add the elapsed frame to the block."""
    share = 1.0 / fdi.block
    for i in range(3):
        fdi.block_innovation[i] += share * fdi.innovation[i]
        fdi.block_eta[i] += share * fdi.eta_bar[i]
    for s in range(4):
        fie, surface = fdi.estimator[POSITION_FIRST + s], fdi.surface[s]
        for i in range(3):
            fie.block_offset[i] += share * fie.offset[i]
            fie.block_Z[i] += share * fie.Z[i]
            fie.block_spread[i] += share * fie.spread[i]
        axis = membership.dominant(fie)
        command = -fie.offset[axis] / fie.Z[axis]
        surface.least_command[0] = min(surface.least_command[0], command)
        surface.greatest_command[0] = max(surface.greatest_command[0], command)


@kernel
def exchange(one, other):
    """Exchange the values of two arrays (3,)."""
    for i in range(3):
        one[i], other[i] = other[i], one[i]


@kernel
def exchange_all(fdi):
    """Put the means over the block where those over a frame stand, or back."""
    exchange(fdi.innovation, fdi.block_innovation)
    exchange(fdi.frame_bound, fdi.block_eta)
    for s in range(4):
        fie = fdi.estimator[POSITION_FIRST + s]
        exchange(fie.offset, fie.block_offset)
        exchange(fie.Z, fie.block_Z)
        exchange(fie.spread, fie.block_spread)


@kernel
def examine(fdi):
    """Take in the elapsed frame; with the last one of a block, examine the block."""
    if fdi.in_block == 0:
        begin(fdi)
    add(fdi)
    fdi.in_block += 1
    if fdi.in_block < fdi.block:
        return
    fdi.in_block = 0
    for i in range(3):
        fdi.block_eta[i] += (fdi.block_noise[i] + fdi.noise[i]) / fdi.span_s
    exchange_all(fdi)
    fault_types.examine(fdi)
    exchange_all(fdi)
