"""The control laws of ours, one a file, and what those that invert the design model share: which surfaces
carry pitch, from a demand to the command, and what is missing then.

    prepare -> the law's own demand -> command_surfaces -> the law's own integrators -> complete

`control/state.py` has the table of the laws, reference.py what they follow.
"""

from beaver_ftc.compiled import apart
from beaver_ftc.control import accommodation, allocation, engines, power
from beaver_ftc.control.accommodation import MODE_REALLOCATED
from beaver_ftc.control.probe import advance_probe
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis.state import PITCH


@apart
def prepare(control, assessment, prediction, mode, t):
    """Bring the effectiveness matrix, the hand-over of pitch and the probe to this frame, t s. mode: the
    supervisor's.

    Pitch is handed over at once where a surface is or was slow or parked (the reference is governed,
    reference.py), or where the diagnosis of all types has found that less than least_effectiveness is left of
    the main surface.
    """
    surfaces, config = control.surfaces, control.config
    output, least = surfaces.output, surfaces.config.least_effectiveness
    allocation.form_effectiveness_matrix(control.axes, prediction.G, surfaces, config.uses_verdict)
    remains = allocation.remaining(control.layout, output.effectiveness, PITCH)
    useless = remains < least and assessment.diagnoses_all_types
    at_once = control.reference.memory.active or output.authority_lost or useless
    allocation.hand_over_pitch(control.allocation, mode == MODE_REALLOCATED, at_once, remains, least)
    if control.probe.config.frames > 0:
        wanted = assessment.pitch_undecided and config.uses_verdict and not config.informed
        advance_probe(control.probe, wanted, t)


@apart
def command_surfaces(control, assessment, faults, prediction, by_observer):
    """From the law's demand, in control.axes, to the command u (n,) rad of each surface:

        demand <- demand - G offset         if the law uses the verdict
        G u = demand                        as far as the travels allow
        u = trim                            of a surface that is parked

    by_observer: whether the law's observer finds what a surface does not do; the stand-in then carries what
    the main surface has lost, and the flap takes what an elevator at its stop leaves.
    """
    axes, layout, surfaces, out = control.axes, control.layout, control.surfaces, control.allocation.output
    uses_verdict, effectiveness = control.config.uses_verdict, surfaces.output.effectiveness
    if uses_verdict:
        allocation.subtract_offsets(axes, surfaces.output.offset, prediction.G)
    share = out.transfer_share if by_observer else allocation.smoothstep(out.hand_over)
    probe = control.probe.memory.deflection
    if layout.general:
        allocation.allocate_generally(
            axes, control.allocation, layout, effectiveness, prediction, share, probe
        )
    else:
        allocation.allocate(axes, out, layout, effectiveness, share, probe)
        if by_observer and uses_verdict and assessment.detected:
            allocation.spill_to_flap(axes, out, layout)
    accommodation.park_failed_surfaces(surfaces.output, assessment, faults, control.config.informed)
    allocation.park(out, layout, surfaces.output.parked)


@apart
def complete(control, assessment, measured, t):
    """Note whether the demand is met; what is missing in pitch and yaw is left to the engines, at t s.

    engines_serve: whether they may, from the alarm on, and at any time for a law that is informed of the
    truth.
    """
    out, surfaces, axes, layout = control.allocation.output, control.surfaces, control.axes, control.layout
    lever, engine = control.power, control.engines
    engines_serve = assessment.detected or control.config.informed
    allocation.note_shortfall(axes, out.command, layout, surfaces.output.lag, engine.output.authority)
    if lever.config.enabled:
        lost = power.pitch_is_lost(layout, surfaces, out.saturated, axes.shortfall)
        power.steer_by_power(lever, control.reference, measured.x, measured.y, engines_serve, lost, t)
    if engine.config.n > 0:
        if engines_serve:
            airspeed = measured.y[AIRSPEED]
            engines.steer_by_engines(engine, lever, axes, layout, out.saturated, surfaces, airspeed)
        else:
            engines.release_engines(engine)
        power.move_differences(lever, engine.output.difference, engine.config.n, engine.config.step)
