"""The diagnosis scheme, one frame of it: predict, compare, raise the alarm, exclude, decide.

fdi: dtype DIAGNOSIS, belief: dtype of belief.py, measured: MEASURED. effectiveness, offset (n,): what the law
takes each surface for, so that what is known of a fault is no surprise; offset in rad. k: frame number, t s.
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, unanticipated_pitch
from beaver_ftc.diagnosis import (
    across,
    air,
    bank,
    detection,
    forces,
    instruments,
    isolation,
    statistical,
)
from beaver_ftc.diagnosis.bank import BANK
from beaver_ftc.diagnosis.belief import begin_frame, look
from beaver_ftc.diagnosis.bounds.worst_case import bound_dtype
from beaver_ftc.diagnosis.detection import FDAE
from beaver_ftc.diagnosis.isolation import ISOLATION
from beaver_ftc.diagnosis.state import (
    CONFIG,
    NOT_ISOLATED,
    STATISTICS,
    WORST_CASE,
    conclusion_dtype,
    layout_dtype,
)
from beaver_ftc.diagnosis.statistical import STATISTICAL
from beaver_ftc.diagnosis.types import examine, pairs, verdict
from beaver_ftc.diagnosis.types.registry import types_dtype
from beaver_ftc.diagnosis.watch import WATCH


@lru_cache
def diagnosis_dtype(n: int) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces."""
    fields = [
        ("config", CONFIG), ("bound", bound_dtype(n)), ("bank", BANK), ("fdae", FDAE),
        ("verdict", conclusion_dtype(n)), ("layout", layout_dtype(n)), ("isolation", ISOLATION),
        ("types", types_dtype(n)), ("statistical", STATISTICAL), ("watch", WATCH),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@kernel
def diagnose(fdi, belief, measured, effectiveness, offset, k, t):
    """The built-in diagnosis of this frame; `belief.look_back` has been called for it."""
    conclude(fdi, belief, measured, effectiveness, offset, k, t)
    ready(fdi, belief, measured, k)


@kernel
def conclude(fdi, belief, measured, effectiveness, offset, k, t):
    """From prediction to verdict; with scheme `none`, nothing."""
    if k == 0:
        detection.begin(fdi.fdae, fdi.bank, fdi.bound.noise, measured.x)
    if fdi.config.enabled:
        if k > 0:
            predict(fdi, belief, measured, effectiveness, offset, k, t)
        else:
            bank.align(fdi.isolation, belief.G)
        decide(fdi, measured, t)


@kernel
def predict(fdi, belief, measured, effectiveness, offset, k, t):
    """Bring the estimators from the frame before to this one."""
    x, x_then, mean, dt = measured.x, belief.x_then, belief.means, fdi.config.dt
    expected = belief.expected
    expected[:] = mean.acceleration
    bank.innovate(fdi.bank, fdi.bound, x, x_then, expected, dt)
    if fdi.statistical.tests.enabled:
        compare_likelihoods(fdi, belief, measured, k, t)
    isolation.suppose_all(
        fdi.isolation, fdi.bank, fdi.bound, fdi.config, fdi.verdict.detected, mean.G, mean.Gu, mean.Gu_spread
    )
    if fdi.config.every_type:
        examine.note_orders(fdi.types, belief.commanded, mean)
    if fdi.verdict.detected:
        isolation.predict_all(fdi.isolation, fdi.bound, x_then, expected, dt)
        expect_known_faults(expected, mean, effectiveness, offset, fdi.config.every_type)
    if fdi.statistical.tests.enabled:
        for i in range(3):
            belief.surprise[i] = (x[i] - x_then[i]) / dt - expected[i]
        chances = fdi.statistical
        statistical.follow_rest(chances.block, chances.air, belief.surprise, dt)
    leaking = fdi.verdict.isolated >= 0 or fdi.verdict.lead >= 0
    detection.predict(fdi.fdae, fdi.bound, x_then, expected, fdi.verdict.detected, leaking, dt)


@kernel
def expect_known_faults(expected, mean, effectiveness, offset, offsets_count):
    """Take off `expected` (3,) rad/s2 what the surfaces have lost, as known; add what they give unasked."""
    for s in range(effectiveness.size):
        lost = 1.0 - effectiveness[s]
        for i in range(3):
            expected[i] -= lost * mean.Gu[i, s]
    if offsets_count:
        for s in range(offset.size):
            for i in range(3):
                expected[i] += mean.G[i, s] * offset[s]


@apart
def compare_likelihoods(fdi, belief, measured, k, t):
    """Show the statistical detector the elapsed frame."""
    chances, mean, y = fdi.statistical, belief.means, measured.y
    tests, noise, blocks, forces_felt = chances.tests, chances.noise, chances.block, chances.forces
    seen, inertial, views = chances.air, chances.inertial_air, chances.views[: chances.n_views]
    air.elapse(seen, belief.share)
    if inertial.moving:
        air.elapse(inertial, belief.share)
    statistical.signatures(blocks, mean.Gu_foreseen, unanticipated_pitch(belief.design, y, 1.0))
    latched, ends = chances.alarm.detected_at_s >= 0.0, not fdi.config.abrupt
    statistical.observe(
        tests, noise.bounded, blocks, seen, fdi.bank.innovation, fdi.config.dt, k, latched, ends
    )
    across.face(views, forces_felt, seen, fdi.bound, mean.G_foreseen, mean.Gu_foreseen)
    across.compose(
        views, tests.tolerated, noise, blocks, forces_felt, seen, inertial, fdi.bank.innovation, y[AIRSPEED]
    )
    across.observe(views, tests, chances.listening, y, fdi.config.dt, k, latched)
    known = fdi.bound.error_map.outside == 0
    statistical.score(chances.alarm, tests, blocks, views, forces_felt, seen, t, known)


@kernel
def decide(fdi, measured, t):
    """From residuals to alarm, and from then on to a verdict.

    Where instruments are watched, a surface waits a frame after the alarm: that much later the attitude shows
    what a gyro did; a blurred one, later. Once an instrument is found broken, no surface is named.
    """
    if instruments.speaks(fdi.watch):
        return
    known = fdi.verdict.detected
    detection.form_residual(fdi.fdae, measured.x)
    detection.detect(fdi.bank, fdi.verdict, fdi.config.authority, fdi.statistical.alarm, t)
    if not fdi.verdict.detected:
        return
    if not known:
        begin_isolation(fdi, measured.x)
    if instruments.clears_surfaces(fdi.watch, known):
        isolate(fdi, measured.x, t, known)
    detection.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


@kernel
def begin_isolation(fdi, x):
    """Begin, at the measured x (3,) rad/s, with no knowledge of any fault."""
    isolation.start(fdi.isolation, fdi.bound.noise, x)
    if fdi.config.every_type:
        examine.start(fdi.types)


@kernel
def rules_out(fdi, fie, within):
    """Whether a fault is excluded by those in authority; `within`: it is possible in the worst case.

    Of faults of every type the sets know the course; chance, which axes are moved. Within the class, chance
    that has raised no alarm has nothing to say about the alarm of the sets.
    """
    if fdi.config.authority == WORST_CASE or (fdi.config.every_type and not within):
        return not within
    if fdi.config.every_type:
        chances, places = fdi.statistical, fdi.layout.position_of
        column = fdi.isolation.estimator[places[fie.surface]].effect.Z
        views = chances.views[: chances.n_views]
        return chances.tests.enabled and across.excludes(
            views, chances.tests, chances.forces, chances.air, fie.surface, column
        )
    if fdi.config.authority != STATISTICS and not within:
        return True
    tests, blocks, others, loss_of, s = (
        fdi.statistical.tests, fdi.statistical.block, fdi.isolation.estimator, fdi.layout.loss_of, fie.surface
    )  # fmt: skip
    if not tests.enabled or fie.shown or fdi.statistical.alarm.detected_at_s < 0.0:
        return False
    fie.shown = not fdi.config.abrupt and statistical.shows(
        tests, blocks, others, loss_of, s
    )  # later may be its end
    if fie.shown or not statistical.excludes(tests, blocks, others, loss_of, s, False, fdi.config.abrupt):
        return False
    fie.doubted = 1  # only the end of a loss that nobody saw would explain it
    return statistical.excludes(tests, blocks, others, loss_of, s, True, fdi.config.abrupt)


@kernel
def isolate(fdi, x, t, started):
    """Test every estimator against the measured x (3,) rad/s at time t (s), and decide; as `possible`."""
    for s in range(fdi.isolation.n):
        fie = fdi.isolation.estimator[s]
        if (
            rules_out(
                fdi,
                fie,
                isolation.possible(
                    fdi.isolation, fie, fdi.bank, fdi.bound.frame, fdi.config.abrupt, x, started
                ),
            )
            and not fie.excluded
        ):
            fie.excluded = 1
            fie.excluded_at_s = t
    if fdi.config.every_type:
        isolate_type(fdi, t, started)
    else:
        isolation.decide(fdi.isolation, fdi.verdict, t)


@apart
def isolate_type(fdi, t, started):
    """Of faults of every type, alone or two at a time, decide which it is."""
    types, layout, estimators = fdi.types, fdi.layout, fdi.isolation.estimator
    verdict.note_refuted(types.surface, layout, estimators)
    if types.pair.enabled:
        pairs.examine(types, layout, estimators, fdi.bank, fdi.bound.frame)
        pairs.decide(types, fdi.verdict, layout, t)
        return
    if started or fdi.isolation.memory:
        examine.examine(types, layout, estimators, fdi.bank.innovation, fdi.bound)
    verdict.decide(types, fdi.verdict, layout, estimators, t)


@kernel
def ready(fdi, belief, measured, k):
    """Make ready for the frame to come."""
    if fdi.statistical.tests.enabled:
        look_ahead(fdi, belief, measured, k)
    begin_frame(belief, fdi.bound, fdi.layout, fdi.config.every_type, measured)


@kernel
def weigh_forces(fdi, belief, measured, k):
    """Take in what the accelerometers say, and the air as it follows from them without the vanes."""
    known, seen, inertial = fdi.statistical.forces, fdi.statistical.air, fdi.statistical.inertial_air
    forces.look(known, seen, measured, belief.u, fdi.config.dt)
    seen.felt[:] = measured.force
    if inertial.moving:
        forces.without_vanes(known, inertial.rotation, measured.y)
        inertial.felt[:] = measured.force
        if k > 0:
            air.observe(inertial, known.y, measured.attitude, fdi.config.dt)
        else:
            air.begin(inertial, known.y, measured.attitude)
        air.effect(inertial, belief.design, measured.x, known.y, belief.u)
        air.begin_frame(inertial, known.y[AIRSPEED], fdi.config.dt)


@apart
def look_ahead(fdi, belief, measured, k):
    """Ready the statistical detector for the next frame: the air as the vanes see it, noise, coefficients."""
    if fdi.statistical.air.moving:
        if k > 0:
            air.observe(fdi.statistical.air, measured.y, measured.attitude, belief.share * fdi.config.dt)
        else:
            air.begin(fdi.statistical.air, measured.y, measured.attitude)
    if fdi.statistical.forces.known and not measured.inertial:
        forces.do_without(fdi.statistical.forces, fdi.statistical.air, fdi.statistical.inertial_air)
    if fdi.statistical.forces.known:
        weigh_forces(fdi, belief, measured, k)
    chances = fdi.statistical
    statistical.prepare(
        chances.tests, chances.noise, chances.block, chances.air, fdi.bound, belief.design, measured,
        belief.u, fdi.config.dt,
    )  # fmt: skip


@apart
def look_at_air(fdi, belief, measured):
    """Take in the gust that the vanes see by now, and what it does."""
    chances, dt = fdi.statistical, belief.share * fdi.config.dt
    statistical.look(
        chances.tests, chances.noise, chances.block, chances.air, fdi.bound, belief.design, measured,
        belief.u, dt,
    )  # fmt: skip


@kernel
def look_inside(fdi, belief, measured):
    """Take in an instant inside a frame: what is believed of it, and the gust that the vanes see by then."""
    if fdi.statistical.tests.enabled:
        look_at_air(fdi, belief, measured)
    look(belief, fdi.bound, fdi.layout, fdi.config.every_type, measured)


@kernel
def take_verdict(fdi, belief, measured, verdict, effectiveness, offset, k, t):
    """Take a plug-in's verdict (`verdict_dtype`), and bring the estimator that serves the laws up to date."""
    if k == 0:
        detection.begin(fdi.fdae, fdi.bank, fdi.bound.noise, measured.x)
    else:
        predict(fdi, belief, measured, effectiveness, offset, k, t)
    detection.form_residual(fdi.fdae, measured.x)
    note_verdict(fdi, verdict, t)
    if fdi.verdict.detected:
        detection.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])
    ready(fdi, belief, measured, k)


@kernel
def note_verdict(fdi, verdict, t):
    """Write a plug-in's verdict where the built-in one stands."""
    if verdict.detected and not fdi.verdict.detected:
        fdi.verdict.detected, fdi.verdict.detected_at_s, fdi.verdict.detected_axis = 1, t, verdict.axis
    isolated = verdict.isolated if fdi.verdict.detected else NOT_ISOLATED
    if isolated != fdi.verdict.isolated:
        fdi.verdict.isolated, fdi.verdict.isolated_at_s = isolated, t
    if isolated >= 0:
        fdi.isolation.estimator[isolated].theta[:] = verdict.theta
    fdi.verdict.estimates = verdict.estimates
    fdi.verdict.effectiveness[:] = verdict.effectiveness


@kernel
def isolated_surface(fdi):
    """The surface of the isolated fault, or -1."""
    return fdi.isolation.estimator[fdi.verdict.isolated].surface if fdi.verdict.isolated >= 0 else -1


@kernel
def likelihood_counts(fdi):
    """Whether the statistical detector's estimates are the ones to use."""
    return fdi.statistical.tests.enabled and fdi.config.authority != WORST_CASE


@kernel
def isolated_theta(fdi, s):
    """Estimated theta of the isolated loss of surface s: under noise, the most likely one."""
    if likelihood_counts(fdi):
        return statistical.estimated_loss(fdi.statistical.block, s)[0]
    return fdi.isolation.estimator[fdi.verdict.isolated].theta[fdi.layout.dominant_axis[s]]


@kernel
def unknown_acceleration(fdi, out):
    """Fill out (3,) rad/s2 with what goes on beyond the model and the known faults, as it is estimated."""
    if likelihood_counts(fdi):
        statistical.unknown_acceleration(fdi.statistical.block, fdi.statistical.air, out)
    else:
        detection.unknown_acceleration(fdi.fdae, fdi.bound.noise, out)


@kernel
def built_in_statistic(fdi):
    """The largest share of its threshold that the built-in detection reaches at this frame.

    Of two detectors, the worst-case one counts beyond its bound only: it has no rate of false alarms that a
    lower level could trade for power.
    """
    chances = likelihood_counts(fdi)
    likely = fdi.statistical.alarm.score if chances else 0.0
    if fdi.config.authority == STATISTICS:
        return likely
    certain = bank.largest_share(fdi.bank)
    return max(likely, certain) if certain > 1.0 or not chances else likely
