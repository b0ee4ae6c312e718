"""Signatures: the acceleration that each hypothesis would have caused in the elapsed frame, per unit of
theta.

loss of surface s     G_s u_s              theta in [-1, 0]
step on an axis       1 rad/s2             theta any
pitching moment       that of one unit of the coefficient on alpha^3
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.likelihood import STEP
from beaver_ftc.diagnosis.state import SIDE


@kernel
def sign_blocks(blocks, Gu, cubic):
    """Fill the signatures of the blocks of the rates, rad/s2.

    Gu (3, surfaces) rad/s2: what each surface gave, mean over the frame; cubic rad/s2: a pitching moment on
    alpha^3.
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
def sign_view(view, forces, Gu):
    """Fill the signatures along the direction of a view, rad/s2: a step, and losses; Gu (3, n) rad/s2."""
    block, m = view.block, view.mix
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        s = hypothesis.surface
        hypothesis.signature[0] = 1.0
        if hypothesis.kind != STEP:
            moment = m[0] * Gu[0, s] + m[1] * Gu[1, s] + m[2] * Gu[2, s]
            for f in range(2):
                moment += m[SIDE + f] * forces.component[f].moment[s]
            hypothesis.signature[0] = moment
