"""The reconfiguration supervisor: which mode the law is in [Zhang2005, sec. VI].

nominal until detection; adaptive until isolation, compensating an unknown fault; then reallocated
(elevator, whose demand the flap can take over), or still adaptive with the isolated estimate (aileron,
rudder: no second surface), or unanticipated (no known fault fits).
"""

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.state import PITCH, UNANTICIPATED
from beaver_ftc.diagnosis.types.contract import GIVE_UP, SCALE_COMMAND
from beaver_ftc.scenario.diagnosis import MODES

MODE_NOMINAL, MODE_ADAPTIVE, MODE_REALLOCATED, MODE_UNANTICIPATED = range(len(MODES))
MAX_EVENTS = 64

SUPERVISOR = record(mode=int, n_modes=int, mode_at_s=MAX_EVENTS, mode_is=(int, MAX_EVENTS))


@kernel
def next_mode(now, wanted):
    """The mode to go to from `now`: whatever is wanted, but never past `adaptive`.

    An isolation in the very frame of the alarm is acted upon one frame later, so that the published sequence
    (compensate the unknown, then use what is known of it) holds whatever the diagnosis is capable of.
    """
    return MODE_ADAPTIVE if now == MODE_NOMINAL and wanted != MODE_NOMINAL else wanted


@kernel
def mode_of(config, detected, isolated, relieved):
    """The mode for a law, given the diagnosis: detected 0/1, isolated (estimator index, -1 or -2), and
    whether another surface can relieve the one isolated. config: what the law is given (control/state.py).

    A law that does not use the verdict has nothing to reconfigure: it stays as it is.
    """
    if not config.uses_verdict or not detected:
        return MODE_NOMINAL
    if isolated == UNANTICIPATED:
        return MODE_UNANTICIPATED
    if config.reallocates and isolated >= 0 and relieved:
        return MODE_REALLOCATED
    return MODE_ADAPTIVE


@kernel
def mode_from(config, layout, verdict, assessment):
    """The mode that the diagnosis asks for; verdict: what it concludes; config: as in `mode_of`."""
    elevator, relievable = layout.main[PITCH], layout.stand_in >= 0
    if not assessment.every_type:
        relieved = assessment.named == elevator and relievable
        return mode_of(config, verdict.detected, verdict.isolated, relieved)
    replaced = verdict.lead_kind in (SCALE_COMMAND, GIVE_UP)
    relieved = replaced and verdict.lead == elevator and relievable
    isolated = verdict.lead if replaced else min(verdict.isolated, 0)
    return mode_of(config, verdict.detected, isolated, relieved)


@kernel
def true_mode(elevator, faults):
    """The mode for a law that knows the true fault the moment it occurs; elevator: the surface that leads
    pitch."""
    if not faults.present:
        return MODE_NOMINAL
    if faults.Cm_alpha3 != 0.0:
        return MODE_UNANTICIPATED
    if faults.effectiveness[elevator] < 1.0 or faults.immovable[elevator]:
        return MODE_REALLOCATED
    return MODE_ADAPTIVE


@kernel
def supervise(supervisor, wanted, t):
    """Go to the mode wanted, as far as that is allowed, and note every change; t s."""
    mode = next_mode(supervisor.mode, wanted)
    if mode != supervisor.mode or supervisor.n_modes == 0:
        last = min(supervisor.n_modes, MAX_EVENTS - 1)  # of more than there is room for, the latest stays
        supervisor.mode_at_s[last], supervisor.mode_is[last] = t, mode
        supervisor.n_modes += 1
    supervisor.mode = mode
