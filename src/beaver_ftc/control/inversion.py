"""What the laws that invert the design model have in common: which surfaces carry pitch, from a demand to the
command, and what is missing then.

    prepare -> the law's own demand -> command_surfaces -> the law's own integrators -> complete
"""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.control import accommodation, allocation, engines, power
from beaver_ftc.control.supervisor import MODE_REALLOCATED
from beaver_ftc.design.model import AIRSPEED
from beaver_ftc.diagnosis.state import PITCH


@apart
def prepare(control, assessment, belief, mode, t):
    """Bring the effectiveness matrix, the hand-over of pitch and the probe to this frame, t s. mode: the
    supervisor's."""
    surfaces, config = control.surfaces, control.config
    allocation.form_effectiveness_matrix(control.axes, belief.G, surfaces, config.uses_verdict)
    remains = allocation.remaining(control.layout, surfaces.output.effectiveness, PITCH)
    least, reallocated = surfaces.config.least_effectiveness, mode == MODE_REALLOCATED
    at_once = is_governed(control) or (remains < least and assessment.every_type)
    allocation.hand_over_pitch(control.allocation, reallocated, at_once, remains, least)
    if control.probe.config.frames > 0:
        wanted = assessment.pitch_undecided and config.uses_verdict and not config.informed
        allocation.advance_probe(control.probe, wanted, t)


@kernel
def is_governed(control):
    """Whether the reference is governed from this frame on: authority has been lost."""
    return control.reference.memory.active or control.surfaces.output.authority_lost


@apart
def command_surfaces(control, demand, hold, disturbance, assessment, faults, belief, by_observer):
    """From the law's demand to the command of each surface; demand, hold, disturbance (3,) rad/s2: see
    `allocation.form_demand`.

    by_observer: whether the law's observer finds what a surface does not do; the stand-in then carries what
    the main surface has lost, and the flap takes what an elevator at its stop leaves.
    """
    axes, layout, surfaces, out = control.axes, control.layout, control.surfaces, control.allocation.output
    uses_verdict, effectiveness = control.config.uses_verdict, surfaces.output.effectiveness
    allocation.form_demand(axes, demand, hold, disturbance, surfaces.output.offset, belief.G, uses_verdict)
    share = out.transfer_share if by_observer else allocation.smooth(out.hand_over)
    probe = control.probe.memory.deflection
    if layout.general:
        allocation.allocate_generally(axes, control.allocation, layout, effectiveness, belief, share, probe)
    else:
        allocation.allocate(axes, out, layout, effectiveness, share, probe)
    if not layout.general and by_observer and uses_verdict and assessment.detected:
        allocation.spill_to_flap(axes, out, layout)
    accommodation.park_failed_surfaces(surfaces.output, assessment, faults, control.config.informed)
    allocation.park(out, layout, surfaces.output.parked)


@apart
def complete(control, assessment, faults, measured, t):
    """Note whether the demand is met; what is missing in pitch and yaw is left to the engines, at t s."""
    detected, out, surfaces = assessment.detected, control.allocation.output, control.surfaces
    axes, layout, lever, engine = control.axes, control.layout, control.power, control.engines
    used = detected and (lever.config.enabled or engine.config.n > 0)
    if faults.present or is_governed(control) or used:
        lag, by_engines = surfaces.output.lag, engine.output.authority
        allocation.note_shortfall(axes, out.command, layout, lag, by_engines)
    if lever.config.enabled:
        watched = detected or control.config.informed
        lost = watched and power.pitch_is_lost(layout, surfaces, out.saturated, axes.shortfall)
        power.steer(lever, control.reference, measured.x, measured.y, watched, lost, t)
    if engine.config.n > 0 and detected:
        engines.steer(engine, lever, axes, layout, out.saturated, surfaces, measured.y[AIRSPEED])
        power.move_differences(lever, engine.output.difference, engine.config.n, engine.config.step)
        engines.note_use(engine, lever.output, t)
