"""The built-in law, one frame of it: accommodate, demand, allocate, give back what cannot be had."""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.control import adaptive, allocation, authority, nominal, power, probing
from beaver_ftc.control.accommodation import accommodate, give_up
from beaver_ftc.control.laws import rejecting
from beaver_ftc.control.laws.state import INDI, LQR, REJECTING
from beaver_ftc.control.rivals import compiled
from beaver_ftc.control.state import NOMINAL, ORACLE
from beaver_ftc.control.supervisor import MODE_REALLOCATED
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH


@kernel
def in_doubt(control, fdi):
    """Whether elevator or flap is at fault and it has long been open which."""
    open_question = fdi.config.every_type and fdi.verdict.detected and fdi.verdict.isolated == NOT_ISOLATED
    long = fdi.types.surface[control.main[PITCH]].evidence >= fdi.types.config.patience
    return open_question and long and control.law not in (NOMINAL, ORACLE)


@kernel
def advance_hand_over(control, every_type, mode):
    """Hand the pitch demand to the flap, or back. What a jammed elevator no longer carries goes at once."""
    left = control.effectiveness[control.main[PITCH]]
    if mode == MODE_REALLOCATED:
        control.hand_over = min(control.hand_over + control.hand_over_step, 1.0)
        if control.hedging or (left < control.least_effectiveness and every_type):
            control.hand_over = max(control.hand_over, 1.0 - left)
    elif every_type or control.hands_back:
        control.hand_over = max(control.hand_over - control.hand_over_step, 0.0)
    rejecting.hand_over(control, left)


@apart
def command_as_rival(control, belief, measured):
    """The command of a compiled rival."""
    compiled.command(control, belief.G, measured.x)


@kernel
def command(control, fdi, belief, measured, faults, mode, t):
    """Fill control.command (n,) rad by the law chosen. t s."""
    accommodate(control, fdi, belief, measured, faults)
    if control.inner in (INDI, LQR):
        command_as_rival(control, belief, measured)
        return
    if control.law == NOMINAL:
        control.G[:] = belief.G
    else:
        adaptive.believed_effectiveness(control, belief.G, control.G)
    advance_hand_over(control, fdi.config.every_type, mode)
    if control.probe_frames > 0:
        probing.advance(control, in_doubt(control, fdi), t)
    if control.inner == REJECTING:
        rejecting.demand(control, belief, measured)
    else:
        nominal.demand(control, measured.x, belief.f, control.fhat)
    if control.law != NOMINAL:
        adaptive.allow_for_offsets(control, belief.G)
    allocation.allocate(control, control.G, control.command)
    if control.inner == REJECTING and control.law != NOMINAL and fdi.verdict.detected:
        allocation.relieve(control, control.G, control.command)
    give_up(control, fdi, faults)
    if control.inner != REJECTING:
        nominal.integrate(control, measured.x, control.G, control.command)
    if faults.present or control.hedging or (control.power.enabled and fdi.verdict.detected):
        authority.note_shortfall(control, control.G, control.command)
    if control.power.enabled:
        power.steer(control, measured.x, measured.y, fdi.verdict.detected, t)
    if control.inner == REJECTING:
        rejecting.hurry(control, belief.u)


@kernel
def take_command(control, deflections):
    """Take a plug-in's command (n,) rad, within the travel of each surface."""
    for s in range(deflections.size):
        limited = min(max(deflections[s], control.low[s]), control.high[s])
        control.saturated[s] = limited != deflections[s]
        control.command[s] = limited
