"""Accommodation of a fault: the mode that the law is in, and how effective it takes each surface to be.

*Mode of the supervisor* [Zhang2005, sec. VI]:

    nominal          until detection
    adaptive         until isolation: the law compensates an unknown fault; afterwards with the isolated
                     estimate, if no second surface can take over (aileron, rudder)
    reallocated      after isolation of an elevator fault: the flap takes over a part of the demand
    unanticipated    no known fault fits

*Surfaces.* The law assumes an effectiveness, an offset and a lag of each surface. They follow from the
assessment of the diagnosis: an isolated loss scales the command, a surface that does not follow its command
is parked, an offset is subtracted, and a slow surface is waited for. A law that is informed of the truth (an
oracle) takes the true faults of the instant instead; no other law reads them.

The laws divide by the effectiveness in `output`. Its rate is limited, so that a decision does not kick the
surfaces, except if the assessment applies at once (`start_of`), if a law's observer gives the surface up, or
if the law is informed. A surface whose effectiveness is below `least_effectiveness` is given up: nothing is
divided by it.

Records among the arguments, and the file that defines each:

    supervisor, surfaces (output, config)    this file
    verdict                                  diagnosis/conclusion.py
    assessment                               diagnosis/assessment.py
    faults, true faults of the instant       loop/frame.py
    config of a law                          control/state.py
    layout                                   control/allocation.py
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import apart, copy, fill, kernel, record, sized
from beaver_ftc.control.profile import clamp
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.diagnosis.conclusion import UNANTICIPATED
from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND
from beaver_ftc.scenario.diagnosis import MODES, ControlConfig

MODE_NOMINAL, MODE_ADAPTIVE, MODE_REALLOCATED, MODE_UNANTICIPATED = range(len(MODES))
MAX_EVENTS = 64  # number of modes, and of exits from the envelope, that a flight records

# mode: the present one; informed: whether the law in charge is informed. n_modes: number of modes so far;
# mode_at_s, mode_is: when each began, s, and which it was; the last place has the latest once they are full.
SUPERVISOR = record(mode=int, informed=int, n_modes=int, mode_at_s=MAX_EVENTS, mode_is=(int, MAX_EVENTS))


@kernel
def mode_from(config, layout, verdict, assessment):
    """The mode that follows from the diagnosis, by the first row that applies:

        the law does not use the verdict, or nothing is detected        nominal
        no surface, and the fault is outside the class                  unanticipated
        the main surface of pitch, a stand-in, and config.reallocates   reallocated
        otherwise                                                       adaptive

    surface: the isolated one; where all types are diagnosed, the target if its command is scaled or it is
    given up. A law that does not use the verdict has nothing to reconfigure.
    """
    if not config.uses_verdict or not verdict.detected:
        return MODE_NOMINAL
    surface = assessment.isolated_surface
    if assessment.diagnoses_all_types:
        replaced = verdict.accommodation_mode in (SCALE_COMMAND, GIVE_UP)
        surface = verdict.target if replaced else -1
    if surface < 0 and verdict.isolated_estimator == UNANTICIPATED:
        return MODE_UNANTICIPATED
    reallocates = config.reallocates and surface == layout.main[PITCH] and layout.stand_in >= 0
    return MODE_REALLOCATED if reallocates else MODE_ADAPTIVE


@kernel
def true_mode(config, layout, faults):
    """The mode for a law that is informed of the true fault when it occurs; config: as in `mode_from`.
    Cm_alpha3 is the coefficient of the fault outside the class [Zhang2005]."""
    elevator = layout.main[PITCH]
    if not faults.present:
        return MODE_NOMINAL
    if faults.Cm_alpha3 != 0.0:
        return MODE_UNANTICIPATED
    failed = faults.effectiveness[elevator] < 1.0 or faults.immovable[elevator]
    return MODE_REALLOCATED if failed and config.reallocates and layout.stand_in >= 0 else MODE_ADAPTIVE


@kernel
def supervise(supervisor, wanted, informed, t):
    """Change to the mode `wanted`, from nominal always by way of adaptive, and record every change at t s.

    An isolation in the frame of the alarm therefore takes effect one frame later. So the published sequence
    (compensate the unknown fault, then use the isolated one) holds however fast the diagnosis is. A law that
    is not informed begins as nominal after one that was.
    """
    nominal = supervisor.mode == MODE_NOMINAL or supervisor.informed > informed
    mode = MODE_ADAPTIVE if nominal and wanted != MODE_NOMINAL else wanted
    if mode != supervisor.mode or supervisor.n_modes == 0:
        last = min(supervisor.n_modes, MAX_EVENTS - 1)  # once the record is full, its last place
        supervisor.mode_at_s[last] = t
        supervisor.mode_is[last] = mode
        supervisor.n_modes += 1
    supervisor.mode = mode
    supervisor.informed = informed


# effectiveness_step: its largest change in a frame; least_effectiveness: the smallest that a law divides by.
CONFIG = record(effectiveness_step=float, least_effectiveness=float)


@sized
def output_dtype(n: int) -> np.dtype:
    """What the law assumes of n surfaces.

    target, effectiveness (n,)    effectiveness moves to target by at most a step a frame
    offset, lag (n,)              rad
    given_up (n,)                 whether the law's own observer withdraws the surface (laws/withdrawal.py)
    parked (n,)                   whether the surface is commanded to its trim
    authority_lost                whether a surface is slow or parked in this frame
    unknown (3,)                  rad/s2, acceleration that no known fault explains
    """
    return record(
        target=n, effectiveness=n, offset=n, lag=n, given_up=(int, n), parked=(int, n), authority_lost=int,
        unknown=3,
    )  # fmt: skip


@sized
def surfaces_dtype(n: int) -> np.dtype:
    """The stage's records for n surfaces."""
    return record(config=CONFIG, output=output_dtype(n))


def configure(surfaces: np.void, config: ControlConfig, informed: bool, dt_s: float) -> None:
    """Fill the record (`surfaces_dtype`); informed: whether the law receives the true faults. The step of an
    effectiveness is then not limited."""
    step = np.inf if informed else config.effectiveness_rate_per_s * dt_s
    fill(surfaces["config"], least_effectiveness=config.least_effectiveness, effectiveness_step=step)
    surfaces["output"]["effectiveness"] = 1.0


@apart
def accommodate(control, assessment, faults, prediction, measured):
    """Bring the estimates of all surfaces and of the unknown acceleration to this frame
    (control.CompiledLaw)."""
    surfaces = control.surfaces
    output = surfaces.output
    informed = control.config.informed
    begin_frame(output, assessment.lags and not informed)
    if informed:
        follow_truth(surfaces, faults, prediction.u)
    else:
        take_offsets(output, assessment)
        for s in range(output.target.size):
            approach(surfaces, s, start_of(output, assessment, s), assessment.effectiveness[s])
    estimate_unknown(output, control.config, assessment, faults, prediction, measured.y)


@kernel
def begin_frame(output, authority_lost):
    """Begin a frame with no surface given up or parked yet; authority_lost: whether a surface is slow."""
    output.given_up[:] = 0
    output.parked[:] = 0
    output.authority_lost = authority_lost


@kernel
def take_offsets(output, assessment):
    """Take offset and lag (n,) rad of all surfaces from the diagnosis."""
    copy(assessment.offset, output.offset)
    copy(assessment.lag, output.lag)


@kernel
def follow_truth(surfaces, faults, u):
    """Take effectiveness E_s, 0 if surface s does not move, and offset of all surfaces from the truth:

        offset_s = delta_s - E_s u_s        while a fault is present, else 0

    delta, u (n,) rad: effective deflections, and those of healthy surfaces.
    """
    output = surfaces.output
    output.offset[:] = 0.0
    output.lag[:] = 0.0
    for s in range(u.size):
        E = 0.0 if faults.immovable[s] else faults.effectiveness[s]
        approach(surfaces, s, output.effectiveness[s], E)
        if faults.present:
            output.offset[s] = faults.effective[s] - E * u[s]


@kernel
def start_of(output, assessment, s):
    """Effectiveness of surface s from which the step of this frame begins: the present one. If the assessment
    applies at once (a jam, or a precise estimate), the assessed one, which bypasses the rate limit."""
    return assessment.effectiveness[s] if assessment.at_once[s] else output.effectiveness[s]


@kernel
def approach(surfaces, s, start, target):
    """Move the effectiveness of surface s from `start` towards `target` by at most the step of a frame."""
    output = surfaces.output
    step = surfaces.config.effectiveness_step
    output.target[s] = target
    output.effectiveness[s] = start + clamp(target - start, step)


@kernel
def give_up(output, s):
    """Give up surface s: its effectiveness is 0 at once, without the limit on a step."""
    output.given_up[s] = 1
    output.target[s] = 0.0
    output.effectiveness[s] = 0.0


@kernel
def estimate_unknown(output, config, assessment, faults, prediction, y):
    """Fill output.unknown (3,) rad/s2: for an informed law the true pitch acceleration by Cm_alpha3, for
    others that use the verdict the estimate of the diagnosis, otherwise 0."""
    output.unknown[:] = 0.0
    if config.informed:
        output.unknown[PITCH] = unanticipated_pitch(prediction.design, y, faults.Cm_alpha3)
    elif config.uses_verdict:
        output.unknown = assessment.unknown_acceleration


@kernel
def usable_effectiveness(surfaces, s):
    """Effectiveness of surface s that a law divides by: 0 for a surface that is given up, below
    `least_effectiveness`."""
    effectiveness = surfaces.output.effectiveness[s]
    return 0.0 if effectiveness < surfaces.config.least_effectiveness else effectiveness


@kernel
def park_failed_surfaces(output, assessment, faults, informed):
    """Park each surface that does not follow its command: an informed law sees that it is immovable, the
    law's observer has withdrawn it, or the diagnosis gives it up and no effectiveness is left.

    A parked surface is commanded to its trim. If it comes loose, it moves there, which the diagnosis detects.
    Once a surface has been parked, the reference is governed (hedged and scaled, laws/reference.py).
    """
    for s in range(output.parked.size):
        immovable = informed and faults.immovable[s]
        is_held = assessment.accommodation_mode[s] == GIVE_UP and output.effectiveness[s] == 0.0
        output.parked[s] = immovable or output.given_up[s] or is_held
        if output.parked[s]:
            output.authority_lost = 1
