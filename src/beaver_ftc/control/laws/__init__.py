"""Our control laws, one in each file, and the steps that the laws share which invert the design model.

    prepare               decides which surfaces carry pitch
    the law's own demand
    command_surfaces      turns the demand into the command of each surface
    the law's own integrators
    complete              computes the shortfall of the demand, and leaves it to the engines

`control/state.py` has the table of the laws, reference.py the reference that they follow. Words for a surface
at fault:

    given up    a law divides by no effectiveness of it: less is left than `least_effectiveness`
    withdrawn   given up by the default law's own observer, perhaps for a while (withdrawal.py)
    parked      commanded to its trim, because it does not follow its command or is withdrawn
    lost        of pitch: no surface can give it (`pitch_is_lost`); of authority: a surface is slow or parked
"""

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import apart
from beaver_ftc.control import accommodation, allocation, authority, engines, power
from beaver_ftc.control.accommodation import MODE_REALLOCATED
from beaver_ftc.control.general_allocation import allocate_generally
from beaver_ftc.control.probe import advance_probe
from beaver_ftc.design.table import AIRSPEED

WITH_OBSERVER, WITHOUT_OBSERVER = True, False  # `by_observer` of command_surfaces


@apart
def prepare(control, assessment, prediction, mode, t):
    """Bring the effectiveness matrix, the hand-over of pitch and the probe to this frame, t s. mode: the
    supervisor's.

    Pitch is handed over at once if a surface is or was slow or parked (the reference is then governed,
    reference.py), or if the diagnosis of all types has found that the main surface is to be given up.
    """
    surfaces = control.surfaces
    config = control.config
    output = surfaces.output
    least = surfaces.config.least_effectiveness
    allocation.form_effectiveness_matrix(control.axes, prediction.G, surfaces, config.uses_verdict)
    remains = authority.remaining(control.layout, output.effectiveness, PITCH)
    given_up = remains < least and assessment.diagnoses_all_types
    at_once = control.reference.memory.active or output.authority_lost or given_up
    allocation.hand_over_pitch(control.allocation, mode == MODE_REALLOCATED, at_once, remains, least)
    wanted = assessment.pitch_undecided and config.uses_verdict and not config.informed
    advance_probe(control.probe, wanted, t)


@apart
def command_surfaces(control, assessment, faults, prediction, by_observer):
    """Turn the law's demand, in control.axes, into the command u (n,) rad of each surface:

        demand <- demand - G offset         if the law uses the verdict
        G u = demand                        as far as the travels allow
        u = trim                            for a surface that is parked

    by_observer: whether the law has an observer, which finds what a surface does not do. The stand-in then
    carries only what the main surface has lost. If the allocation is not general and the law uses the
    verdict, the flap takes from the alarm on what an elevator at its stop leaves.
    """
    axes = control.axes
    layout = control.layout
    surfaces = control.surfaces
    out = control.allocation.output
    uses_verdict = control.config.uses_verdict
    effectiveness = surfaces.output.effectiveness
    if uses_verdict:
        allocation.subtract_offsets(axes, surfaces.output.offset, prediction.G)
    share = out.transfer_share if by_observer else allocation.smoothstep(out.hand_over)
    probe = control.probe.memory.deflection
    if layout.general:
        allocate_generally(axes, control.allocation, layout, effectiveness, prediction, share, probe)
    else:
        allocation.allocate(axes, out, layout, effectiveness, share, probe)
        if by_observer and uses_verdict and assessment.detected:
            allocation.spill_to_flap(axes, out, layout)
    accommodation.park_failed_surfaces(surfaces.output, assessment, faults, control.config.informed)
    allocation.park(out, layout, surfaces.output.parked)


@apart
def complete(control, assessment, measured, t):
    """Fill the shortfall of the demand, and leave it to the engines in pitch and yaw, at t s.

    engines_serve: whether engines may act: while the alarm stands, and at any time for a law that is informed
    of the truth. power_stage: the common lever; engine_stage: the engines that are effectors.
    """
    out = control.allocation.output
    axes = control.axes
    layout = control.layout
    power_stage = control.power
    engine_stage = control.engines
    config = engine_stage.config
    output = engine_stage.output
    engines_serve = assessment.detected or control.config.informed
    authority.note_shortfall(axes, out.command, layout, control.surfaces.output.lag, output.authority)
    if power_stage.config.enabled:
        lost = power.pitch_is_lost(layout, control.surfaces, out.saturated, axes.shortfall)
        power.steer_by_power(power_stage, control.reference, measured.x, measured.y, engines_serve, lost, t)
    if config.n > 0:
        if engines_serve:
            engines.steer_by_engines(control, measured.y[AIRSPEED])
        else:
            engines.release_engines(engine_stage)
        power.move_differences(power_stage, output.difference, config.n, config.step)
