"""What the law takes each surface for: effectiveness, offset and lag, moved smoothly.

From the diagnosis (`assessment_dtype`): an isolated loss scales the command, a surface that does not follow
is given up, one that is off is corrected, a slow one is left to its pace. The oracle has it from the truth:
its true faults of this instant are filled in by the loop, and no other law reads them.

What becomes of it is the effectiveness that the laws divide by. It is rate limited, so that a decision never
kicks the surfaces, and projected: a surface weaker than `least_effectiveness` is given up.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.control.laws import ORACLE, REJECTING, rejecting
from beaver_ftc.control.laws.answering import effectiveness_of
from beaver_ftc.diagnosis.types.contract import FIXED
from beaver_ftc.scenario.control import ControlConfig


@sized
def surfaces_dtype(n: int) -> np.dtype:
    """What n surfaces are taken for: effectiveness, on its way to target by at most a step a frame; offset
    and lag, rad."""
    return record(
        target=n, effectiveness=n, effectiveness_step=float, least_effectiveness=float, offset=n, lag=n,
    )  # fmt: skip


@sized
def true_faults_dtype(n: int) -> np.dtype:
    """present: 1 from the first fault on. effectiveness (n,): 1 healthy. immovable (n,): does not follow its
    command. effective (n,) rad: the deflection that acts. Cm_alpha3: the unanticipated pitching moment."""
    return record(present=int, Cm_alpha3=float, effectiveness=n, immovable=(int, n), effective=n)


def configure(surfaces: np.void, config: ControlConfig, law: int, dt_s: float) -> None:
    """Fill the record (`surfaces_dtype`); law: what use is made of the verdict."""
    surfaces["effectiveness"], surfaces["least_effectiveness"] = 1.0, config.least_effectiveness
    surfaces["effectiveness_step"] = config.effectiveness_rate_per_s * dt_s if law != ORACLE else np.inf


@kernel
def accommodate(law, inner, assessment, surfaces, rejection, layout, saturated, faults, u):
    """Bring effectiveness, offset and lag (n,) to this frame.

    faults: `true_faults_dtype`, looked at by the oracle alone. u (n,) rad: where healthy surfaces would be.
    """
    learns = inner == REJECTING and law != ORACLE
    if learns:
        rejecting.look_for_losses(rejection, layout, assessment.detected)
    for s in range(surfaces.target.size):
        surfaces.target[s], surfaces.offset[s], surfaces.lag[s] = 1.0, 0.0, 0.0
        if law == ORACLE:
            take_truth(surfaces, faults, s, u[s])
        else:
            take_assessment(surfaces, assessment, s)
        if learns:
            if assessment.unknown and rejection.answering.listening:
                surfaces.target[s] = effectiveness_of(rejection.answering, s)
            elif assessment.measure[s] != FIXED:
                rejecting.believe_larger(rejection, surfaces, layout, s)
            named = assessment.detected and s == assessment.named
            suspected = named and is_doubtful(assessment, surfaces, rejection, layout, s)
            rejecting.withdraw(rejection, surfaces, layout, s, saturated[s], suspected)
    approach(surfaces)


@kernel
def take_truth(surfaces, faults, s, u):
    """Take the true effectiveness of surface s, none if it does not move, and what it is off besides.

    u rad: where it would be if healthy.
    """
    surfaces.target[s] = 0.0 if faults.immovable[s] else faults.effectiveness[s]
    if faults.present:
        surfaces.offset[s] = faults.effective[s] - surfaces.target[s] * u


@kernel
def take_assessment(surfaces, assessment, s):
    """Take surface s for what the diagnosis says. Jams bypass the rate limit, as does what is well known."""
    surfaces.target[s] = assessment.effectiveness[s]
    surfaces.offset[s], surfaces.lag[s] = assessment.offset[s], assessment.lag[s]
    if assessment.at_once[s]:
        surfaces.effectiveness[s] = surfaces.target[s]


@kernel
def is_doubtful(assessment, surfaces, rejection, layout, s):
    """Whether surface s, which is named, may be of no use: another can take its place, or its type is open or
    nothing of it seems to be left, and the law's observer sees nothing of it either."""
    if rejecting.is_replaced(layout, s):
        return True
    least = surfaces.least_effectiveness
    is_open = assessment.every_type and assessment.measure[s] < 0
    useless = is_open or surfaces.target[s] < least
    return useless and not rejecting.acts(rejection.found, layout.main, s, least)


@kernel
def approach(surfaces):
    """Move the effectiveness the law uses towards its target by at most one step."""
    step = surfaces.effectiveness_step
    for s in range(surfaces.target.size):
        change = surfaces.target[s] - surfaces.effectiveness[s]
        surfaces.effectiveness[s] += min(max(change, -step), step)


@kernel
def allow_for_offsets(axes, offset, G):
    """Take off the demand what the surfaces give unasked: G (3, n) rad/s2 per rad times the offsets (n,)."""
    for i in range(3):
        for s in range(G.shape[1]):
            axes.demand[i] -= G[i, s] * offset[s]
            axes.hold[i] -= G[i, s] * offset[s]


@kernel
def believed_effectiveness(surfaces, G, G_believed):
    """Fill G_believed (3, n): G with each column scaled by its surface's effectiveness, or given up."""
    for s in range(G.shape[1]):
        effectiveness = surfaces.effectiveness[s]
        if effectiveness < surfaces.least_effectiveness:
            effectiveness = 0.0
        for i in range(3):
            G_believed[i, s] = G[i, s] * effectiveness


@kernel
def give_up(law, assessment, surfaces, withdrawn, faults, layout, allocation, reference):
    """Command a surface that does not follow to its trim: should it come loose, that is where it goes, and it
    shows. From then on the reference is bent to what is left. withdrawn (n,): by the law's observer."""
    for s in range(layout.trim.size):
        truly = faults.immovable[s] and law == ORACLE
        fixed = assessment.measure[s] == FIXED
        if truly or withdrawn[s] or (fixed and surfaces.effectiveness[s] == 0.0):
            allocation.command[s] = layout.trim[s]
            allocation.saturated[s] = 0
            reference.hedging = 1
