"""Frames examined in blocks, where a gyro's noise makes a single frame say little.

Summed over a block the innovation holds the noise of its two ends alone, n[k+N] - n[k].
So the mean over N frames has the bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

and with it says where the surface was in the mean, weighted by its effectiveness G, whose sign stays. Of a
constant position, offset or effectiveness the weighted mean is exact; of what varies it lies between the
extremes. A block is then to the types what a frame is that consists of several JSBSim frames: one next to a
healthy one is passed over.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types.examine import judge_all, locate, note_wrong


@kernel
def begin(fdi):
    """Begin a block with the elapsed frame."""
    fdi.types.block.innovation[:], fdi.types.block.bound[:] = 0.0, 0.0
    fdi.types.block.noise[:] = fdi.bound.noise_then
    for s in range(fdi.types.surface.size):
        effect = fdi.isolation.estimator[fdi.layout.position_of[s]].block_effect
        effect.offset[:], effect.Z[:], effect.spread[:] = 0.0, 0.0, 0.0


@kernel
def add(fdi):
    """Add the elapsed frame to the means over the block."""
    share = 1.0 / fdi.types.config.length
    for i in range(3):
        fdi.types.block.innovation[i] += share * fdi.bank.innovation[i]
        fdi.types.block.bound[i] += share * fdi.bound.eta_bar[i]
    for s in range(fdi.types.surface.size):
        fie = fdi.isolation.estimator[fdi.layout.position_of[s]]
        frame, mean = fie.effect, fie.block_effect
        for i in range(3):
            mean.offset[i] += share * frame.offset[i]
            mean.Z[i] += share * frame.Z[i]
            mean.spread[i] += share * frame.spread[i]


@kernel
def examine(fdi):
    """Take in the elapsed frame; with the last one of a block, take in the block and judge the one before."""
    if fdi.types.block.filled == 0:
        begin(fdi)
    add(fdi)
    fdi.types.block.filled += 1
    if fdi.types.block.filled < fdi.types.config.length:
        return
    fdi.types.block.filled = 0
    for i in range(3):
        fdi.types.block.bound[i] += (fdi.types.block.noise[i] + fdi.bound.noise[i]) / fdi.types.config.span_s
    note_wrong(fdi, fdi.types.block.innovation, fdi.types.block.bound)
    for s in range(fdi.types.surface.size):
        effect = fdi.isolation.estimator[fdi.layout.position_of[s]].block_effect
        locate(fdi, s, fdi.types.block.innovation, fdi.types.block.bound, effect)
    judge_all(fdi)
