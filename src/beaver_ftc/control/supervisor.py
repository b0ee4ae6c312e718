"""Who is in charge: the reconfiguration supervisor [Zhang2005, sec. VI].

nominal until detection; adaptive until isolation, compensating an unknown fault; then reallocated
(elevator, whose demand the flap can take over), or still adaptive with the isolated estimate (aileron,
rudder: no second surface), or unanticipated (no known fault fits).
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.control.state import FAULT_TOLERANT, NOMINAL
from beaver_ftc.design.model import ELEVATOR
from beaver_ftc.diagnosis.state import UNANTICIPATED

MODES = ("nominal", "adaptive", "reallocated", "unanticipated")
MODE_NOMINAL, MODE_ADAPTIVE, MODE_REALLOCATED, MODE_UNANTICIPATED = range(4)


@kernel
def next_mode(now, wanted):
    """The mode to go to from `now`: whatever is wanted, but never past `adaptive`.

    An isolation in the very frame of the alarm is acted upon one frame later, so that the published sequence
    (compensate the unknown, then use what is known of it) holds whatever the diagnosis is capable of.
    """
    return MODE_ADAPTIVE if now == MODE_NOMINAL and wanted != MODE_NOMINAL else wanted


@kernel
def mode_of(law, detected, isolated, surface):
    """The mode for a law, given the diagnosis: detected 0/1, isolated (estimator index, -1 or -2) and its
    surface.

    The nominal law has nothing to reconfigure: it stays in charge.
    """
    if law == NOMINAL or not detected:
        return MODE_NOMINAL
    if isolated == UNANTICIPATED:
        return MODE_UNANTICIPATED
    if law == FAULT_TOLERANT and isolated >= 0 and surface == ELEVATOR:
        return MODE_REALLOCATED
    return MODE_ADAPTIVE
