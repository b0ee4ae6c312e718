"""What the law takes each surface for, from the verdict: effectiveness, offset, lag, and the unknown.

An isolated loss scales the command, a surface that does not follow is given up, one that is off is corrected,
a slow one is left to its pace.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.control import adaptive
from beaver_ftc.control.laws import rejecting
from beaver_ftc.control.laws.state import REJECTING
from beaver_ftc.control.oracle import true_surface
from beaver_ftc.control.state import NOMINAL, ORACLE
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.diagnosis import statistical
from beaver_ftc.diagnosis.scheme import (
    isolated_surface,
    isolated_theta,
    likelihood_counts,
    unknown_acceleration,
)
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.diagnosis.types import candidates, verdict
from beaver_ftc.diagnosis.types.examine import FIXED, LAGS, LOSES, SHIFTED

SURE = 400.0  # one over the variance of an effectiveness known to 0.05


@kernel
def accommodate(control, fdi, belief, measured, faults):
    """Bring control.effectiveness, offset, lag (n,) and fhat (3,) rad/s2 to this frame.

    faults: dtype of oracle.py, looked at by the oracle alone.
    """
    surface = isolated_surface(fdi)
    for s in range(control.target.size):
        control.target[s], control.offset[s], control.lag[s] = 1.0, 0.0, 0.0
        if control.law == ORACLE:
            true_surface(control, faults, s, belief.u[s])
        elif fdi.verdict.estimates and fdi.verdict.detected:
            control.target[s] = fdi.verdict.effectiveness[s]
        elif fdi.config.every_type and fdi.types.surface[s].measure >= 0:
            act_on_type(control, fdi, s)
        elif s == surface and not fdi.config.every_type:
            act_on_loss(control, fdi, s)
        if control.inner == REJECTING and control.law != ORACLE:
            if not (fdi.config.every_type and fdi.types.surface[s].measure == FIXED):
                rejecting.hesitate(control, s)
            suspected = fdi.verdict.detected and s == surface and is_doubtful(control, fdi, s)
            rejecting.abandon(control, s, suspected)
    adaptive.approach(control, control.target)
    compensate(control, fdi, belief, measured, faults)


@kernel
def is_doubtful(control, fdi, s):
    """Whether surface s, which is named, may be of no use: another can take its place, or its type is open or
    nothing of it seems to be left, and the law's observer sees nothing of it either."""
    if rejecting.is_replaced(control, s):
        return True
    is_open = fdi.config.every_type and fdi.types.surface[s].measure < 0
    return (is_open or control.target[s] < control.least_effectiveness) and not rejecting.acts(control, s)


@kernel
def act_on_loss(control, fdi, s):
    """Surface s has lost effectiveness; what is known well need not be eased in."""
    control.target[s] = 1.0 + isolated_theta(fdi, s)
    if likelihood_counts(fdi) and statistical.estimated_loss(fdi.statistical.block, s)[1] > SURE:
        control.effectiveness[s] = control.target[s]


@kernel
def act_on_type(control, fdi, s):
    """What the diagnosis of every type makes of surface s. Jams bypass the rate limit."""
    surface, at_fault = fdi.types.surface[s], candidates.possible(fdi, s)
    if surface.measure == LOSES:
        control.target[s] = verdict.effectiveness_left(fdi, s)
    elif surface.measure == FIXED:
        control.target[s] = control.effectiveness[s] = 0.0
        control.offset[s] = surface.command + verdict.deflection_error(surface, at_fault)
    elif surface.measure == SHIFTED:
        control.offset[s] = verdict.deflection_error(surface, at_fault)
    elif surface.measure == LAGS:
        control.lag[s] = 0.5 * (surface.low + surface.high) - surface.command
        control.hedging = 1


@kernel
def compensate(control, fdi, belief, measured, faults):
    """Fill control.fhat (3,) rad/s2: what the law takes the unknown for."""
    control.fhat[:] = 0.0
    if control.inner == REJECTING:
        return  # its observer finds what is unknown
    if control.law == ORACLE:
        control.fhat[PITCH] = unanticipated_pitch(belief.design, measured.y, faults.Cm_alpha3)
    elif control.law != NOMINAL and fdi.verdict.detected:
        unknown_acceleration(fdi, control.fhat)
        if fdi.verdict.lead >= 0 and fdi.verdict.lead_kind == LAGS:
            control.fhat[:] = 0.0  # to ask a slow surface for what it lacks would only wind the command up


@kernel
def give_up(control, fdi, faults):
    """Command a surface that does not follow to its trim: should it come loose, that is where it goes, and it
    shows. From then on the reference is bent to what is left."""
    for s in range(control.trim.size):
        truly = faults.immovable[s] and control.law == ORACLE
        fixed = fdi.config.every_type and fdi.types.surface[s].measure == FIXED
        abandoned = control.rejection.abandoned[s]
        if truly or abandoned or (fixed and control.effectiveness[s] == 0.0):
            control.command[s] = control.trim[s]
            control.saturated[s] = 0
            control.hedging = 1
