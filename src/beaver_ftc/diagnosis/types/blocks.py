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
    fdi.block.innovation[:], fdi.block.bound[:] = 0.0, 0.0
    fdi.block.noise[:] = fdi.bound.noise_then
    for s in range(fdi.surface.size):
        effect = fdi.estimator[fdi.layout.position_of[s]].block_effect
        effect.offset[:], effect.Z[:], effect.spread[:] = 0.0, 0.0, 0.0


@kernel
def add(fdi):
    """Add the elapsed frame to the means over the block."""
    share = 1.0 / fdi.block.length
    for i in range(3):
        fdi.block.innovation[i] += share * fdi.innovation[i]
        fdi.block.bound[i] += share * fdi.bound.eta_bar[i]
    for s in range(fdi.surface.size):
        fie = fdi.estimator[fdi.layout.position_of[s]]
        frame, mean = fie.effect, fie.block_effect
        for i in range(3):
            mean.offset[i] += share * frame.offset[i]
            mean.Z[i] += share * frame.Z[i]
            mean.spread[i] += share * frame.spread[i]


@kernel
def examine(fdi):
    """Take in the elapsed frame; with the last one of a block, take in the block and judge the one before."""
    if fdi.block.filled == 0:
        begin(fdi)
    add(fdi)
    fdi.block.filled += 1
    if fdi.block.filled < fdi.block.length:
        return
    fdi.block.filled = 0
    for i in range(3):
        fdi.block.bound[i] += (fdi.block.noise[i] + fdi.bound.noise[i]) / fdi.block.span_s
    note_wrong(fdi, fdi.block.innovation, fdi.block.bound)
    for s in range(fdi.surface.size):
        effect = fdi.estimator[fdi.layout.position_of[s]].block_effect
        locate(fdi, s, fdi.block.innovation, fdi.block.bound, effect)
    judge_all(fdi)
