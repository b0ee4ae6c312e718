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
    network,
    statistical,
)
from beaver_ftc.diagnosis.belief import begin_frame, look
from beaver_ftc.diagnosis.bounds.worst_case import bound_dtype
from beaver_ftc.diagnosis.state import (
    BANK,
    CONFIG,
    FDAE,
    ISOLATION,
    NOT_ISOLATED,
    STATISTICS,
    WORST_CASE,
    conclusion_dtype,
    layout_dtype,
)
from beaver_ftc.diagnosis.statistical import STATISTICAL
from beaver_ftc.diagnosis.types import examine
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
        detection.begin(fdi, measured.x)
    if fdi.config.enabled:
        if k > 0:
            predict(fdi, belief, measured, effectiveness, offset, k, t)
        else:
            bank.align(fdi, belief.G)
        decide(fdi, measured, t)


@kernel
def predict(fdi, belief, measured, effectiveness, offset, k, t):
    """Bring the estimators from the frame before to this one."""
    x, x_then, mean = measured.x, belief.x_then, belief.means
    expected = belief.expected
    expected[:] = mean.acceleration
    bank.innovate(fdi, x, x_then, expected)
    if fdi.statistical.tests.enabled:
        compare_likelihoods(fdi, belief, measured, k, t)
    isolation.suppose_all(fdi, mean.G, mean.Gu, mean.Gu_spread)
    if fdi.config.every_type:
        examine.note_orders(fdi.types, belief.commanded, mean)
    if fdi.verdict.detected:
        isolation.predict_all(fdi, x_then, expected)
        expect_known_faults(expected, mean, effectiveness, offset, fdi.config.every_type)
    if fdi.statistical.tests.enabled:
        for i in range(3):
            belief.surprise[i] = (x[i] - x_then[i]) / fdi.config.dt - expected[i]
        chances = fdi.statistical
        statistical.follow_rest(chances.block, chances.air, belief.surprise, fdi.config.dt)
    detection.predict(fdi, x_then, expected, fdi.verdict.isolated >= 0 or fdi.verdict.lead >= 0)


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
    detection.detect(fdi, measured.x, t)
    if not fdi.verdict.detected:
        return
    if not known:
        isolation.start(fdi, measured.x)
    if instruments.clears_surfaces(fdi.watch, known):
        isolation.isolate(fdi, measured.x, t, known)
    network.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


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
        detection.begin(fdi, measured.x)
    else:
        predict(fdi, belief, measured, effectiveness, offset, k, t)
    for i in range(3):
        fdi.fdae.residual[i] = measured.x[i] - fdi.fdae.xhat[i]
    note_verdict(fdi, verdict, t)
    if fdi.verdict.detected:
        network.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])
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
        detection.unknown_acceleration(fdi, out)


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
    certain = bank.largest_share(fdi)
    return max(likely, certain) if certain > 1.0 or not chances else likely
