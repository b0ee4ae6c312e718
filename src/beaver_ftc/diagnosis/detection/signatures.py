"""Signatures: the acceleration, rad/s2, of each hypothesis in the elapsed frame per unit of its theta.

hypothesis            signature                             theta
loss of surface s     G_s u_s, predicted                    in [-1, 0]
step on an axis       1 rad/s2                              any
pitching moment       that of a coefficient 1 of alpha^3    any
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.likelihood import STEP
from beaver_ftc.diagnosis.state import SIDE


@kernel
def fill_block_signatures(blocks, Gu, cubic):
    """Fill the signatures of the blocks of the rates, rad/s2.

    Gu (3, n) rad/s2: effect of each surface, mean over the frame; cubic rad/s2: pitch acceleration of a
    coefficient 1 of alpha^3.
    """
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            for i in range(block.n):
                if hypothesis.surface >= 0:
                    hypothesis.signature[i] = Gu[block.axis[i], hypothesis.surface]
                elif hypothesis.kind == STEP:
                    hypothesis.signature[i] = 1.0 if hypothesis.axis == block.axis[i] else 0.0
                else:
                    hypothesis.signature[i] = cubic


@kernel
def fill_view_signatures(view, forces, Gu):
    """Fill the projections of the signatures on the direction of a view: of a step, and of losses.

    Gu (3, n) rad/s2: effect of each surface, mean over the frame.
    """
    block, m = view.block, view.direction
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        s = hypothesis.surface
        hypothesis.signature[0] = 1.0
        if hypothesis.kind != STEP:
            moment = m[0] * Gu[0, s] + m[1] * Gu[1, s] + m[2] * Gu[2, s]
            for f in range(2):
                moment += m[SIDE + f] * forces.component[f].effect[s]
            hypothesis.signature[0] = moment
