"""The predicted acceleration f + G u of the designer's model: at this instant, and its mean over a frame.

    F = f(x, y) + G(x, y) u,    x rates (3,) rad/s, y measurements, u surfaces (n,) rad, F (3,) rad/s2

The order of evaluation is that of JSBSim. After `run()` number k the rates are x[k] and the accelerations
a[k] = F(x[k], u[k]), where u[k] is the command written before that run. The next run adds dt a[k] to the
rates. If a frame has n JSBSim steps (instants), the rates first change by dt/n a[k], under the old command,
and then by the accelerations of the other instants, under u[k+1]. The mean over a frame is therefore a left
sum over its n instants, the first of them under the old command.
"""

from math import pi

import numpy as np

from beaver_ftc.compiled import copy, fill, kernel, record, sized
from beaver_ftc.design.actuators import actuators_dtype, move, move_ends
from beaver_ftc.design.model import design_dtype, design_of, response
from beaver_ftc.diagnosis.bounds import fill_bound, n_gyro
from beaver_ftc.diagnosis.error_map import extra_bound
from beaver_ftc.scenario.declared import Declared

DEFAULT_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default


@sized
def frame_sums_dtype(n: int) -> np.dtype:
    """Means over the instants of a frame so far, of n surfaces, to which each instant adds its share w: F,
    G u, bounds eta_bar, rad/s2; G, rad/s2 per rad; u, rad; eG, eGu as in `bound_dtype`."""
    return record(
        F=3, G=(3, n), Gu=(3, n), u=n, eta_bar=3, eG=(3, n), eGu=(3, n),
        Gu_first=(3, n),  # w G u of the first instant alone
        G_min=n, G_max=n,  # extremes of G on each surface's dominant axis
        u_min=n, u_max=n,  # extremes of the position, rad
    )  # fmt: skip


@sized
def frame_means_dtype(n: int) -> np.dtype:
    """Means over the elapsed frame, of an aircraft with n surfaces."""
    return record(
        G=(3, n), Gu=(3, n),  # rad/s2 per rad; rad/s2
        e_Gu=(3, n),  # error of Gu if a fault changes within the frame, rad/s2: `fill_change_tolerance`
        F=3,  # f + G u, rad/s2
        u=n,  # rad
        # G of the frame before. It does not depend on the measurement noise of this frame, to which the
        # control law reacts: with G of this frame that reaction would correlate with the noise.
        G_old=(3, n),
        # If faults of every type are examined, extremes within the frame: of G on each surface's dominant
        # axis, and of the position of the healthy surface, rad.
        G_min=n, G_max=n, u_min=n, u_max=n,
    )  # fmt: skip


@sized
def prediction_dtype(n: int) -> np.dtype:
    """The designer's model of an aircraft with n surfaces and its predictions, in rad, rad/s and rad/s2."""
    return record(
        design=design_dtype(n), actuators=actuators_dtype(n),
        w=float,  # one over the number of instants in a frame
        commanded=n,  # the command in effect
        u=n, u_old=n,  # positions of healthy surfaces under the command: now, before the last `move_healthy`
        # least and greatest position by the declared errors of the actuators, at the same two times
        u_lo=n, u_hi=n, u_lo_old=n, u_hi_old=n,
        f=3, G=(3, n),  # f and G at this instant
        x_before=3,  # rates measured at the start of the elapsed frame
        sums=frame_sums_dtype(n), means=frame_means_dtype(n),
        F_known=3,  # mean acceleration of the elapsed frame, known faults included
        nu_known=3,  # measured minus expected mean acceleration
    )  # fmt: skip


def servo_data(declared: Declared) -> dict[str, np.ndarray]:
    """The declared actuators and their errors, (surfaces,) each, by the names of `DeclaredErrors`: rad,
    rad/s, 1/s; the errors of bandwidth and rate limit are relative. 0 stands for no lag and for no limit."""
    names = declared.aircraft.surfaces
    servos = [getattr(declared.servos, name) for name in names]
    errors = [getattr(declared.servo_errors, name) for name in names]
    return {
        "bandwidth_rad_s": np.array([servo.bandwidth_rad_s for servo in servos]),
        "rate_limit_rad_s": np.radians([servo.rate_limit_deg_s for servo in servos]),
        "bandwidth_error": np.array([error.bandwidth for error in errors]),
        "rate_limit_error": np.array([error.rate_limit for error in errors]),
        "dead_band_rad": np.radians([error.dead_band_deg for error in errors]),
    }


def configure_prediction(pred: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill the design model and the declared actuators; travel (2, n) rad: the stops.

        approach = 1 - exp(-h omega)      step = h rate

    In an instant of h s, a surface covers the share `approach` of the distance to its command, and at most
    `step`. approaches, steps: the same for the slowest and the fastest actuator by the declared errors.
    omega rad/s, rate rad/s: 0 stands for no lag and for no limit.
    """
    servos = servo_data(declared)
    h = 1.0 / declared.rate_hz / declared.substeps
    slow_to_fast = np.array([-1.0, 0.0, 1.0])  # times the error: slowest, as declared, fastest
    omega = servos["bandwidth_rad_s"]
    rate = servos["rate_limit_rad_s"]
    approaches = 1.0 - np.exp(-h * omega[:, None] * (1.0 + np.outer(servos["bandwidth_error"], slow_to_fast)))
    approaches[omega == 0.0] = 1.0  # no lag
    step = np.where(rate > 0.0, rate * h, np.inf)
    steps = step[:, None] * (1.0 + np.outer(servos["rate_limit_error"], slow_to_fast))
    fill(pred, w=1.0 / declared.substeps, design=design_of(declared)[0])
    fill(
        pred["actuators"], real=not declared.servos.is_ideal, uncertain=not declared.servo_errors.is_none,
        low=travel[0], high=travel[1], approaches=approaches[:, ::2], approach=approaches[:, 1],
        step=step, steps=steps[:, ::2], band=servos["dead_band_rad"],
    )  # fmt: skip


@kernel
def evaluate_design(pred, meas):
    """Fill f (3,) rad/s2 and G (3, n) rad/s2 per rad of the design model at this instant."""
    response(pred.design, meas.x, meas.y, pred.f, pred.G)


@kernel
def add_to_sums(pred, bound, layout, all_types):
    """Add w times this instant to the means over the frame; for faults of all types, update the extremes:

    F <- F + w (f + sum_s G_s u_s)      Gu_s <- Gu_s + w G_s u_s      eGu_s <- eGu_s + w eG_s |u_s|
    G, u, eG, eta_bar likewise          extra_j <- extra_j + w extra_bound(j)      j: level of travel

    eG and eGu only with has_eG, extra only with one_free.
    """
    sums = pred.sums
    G = pred.G
    u = pred.u
    w = pred.w
    eG = bound.declared_errors.eG
    for s in range(u.size):
        sums.u[s] += w * u[s]
    for i in range(3):
        sums.F[i] += w * pred.f[i]
        sums.eta_bar[i] += w * bound.eta_now[i]
        for s in range(u.size):
            w_G = w * G[i, s]
            sums.G[i, s] += w_G
            sums.Gu[i, s] += w_G * u[s]
            sums.F[i] += w_G * u[s]
            if bound.has_eG:
                w_eG = w * eG[i, s]
                sums.eG[i, s] += w_eG
                sums.eGu[i, s] += w_eG * abs(u[s])
        if bound.error_map.one_free:
            for j in range(bound.error_map.n_levels):
                bound.extra[j, i] += w * extra_bound(bound.error_map, j, i)
    if all_types:
        for s, i in enumerate(layout.dominant_axis):
            sums.G_min[s] = min(sums.G_min[s], G[i, s])
            sums.G_max[s] = max(sums.G_max[s], G[i, s])
            sums.u_min[s] = min(sums.u_min[s], u[s])
            sums.u_max[s] = max(sums.u_max[s], u[s])


@kernel
def fill_means(pred, bound):
    """Copy the sums, which are complete, to the means over the elapsed frame: G, u, G u of each surface,
    F = f + G u, the extremes, and the bounds eta_bar, eG and eGu. G_old keeps the G of the frame before. With
    several instants a frame, fill e_Gu, too."""
    sums = pred.sums
    means = pred.means
    copy(means.G, means.G_old)
    copy(sums.G, means.G)
    copy(sums.Gu, means.Gu)
    copy(sums.u, means.u)
    means.F = sums.F
    copy(sums.G_min, means.G_min)
    copy(sums.G_max, means.G_max)
    copy(sums.u_min, means.u_min)
    copy(sums.u_max, means.u_max)
    bound.eta_bar = sums.eta_bar
    if bound.has_eG:
        copy(sums.eG, bound.eG)
        copy(sums.eGu, bound.eGu)
    if pred.w < 1.0:
        fill_change_tolerance(pred)


@kernel
def fill_change_tolerance(pred):
    """e_Gu = w |z0 - z|, (3, n) rad/s2: the error of the mean effect if a fault changes within the frame; it
    is r_s in isolation.md.

    A fault changes between frames, that is between the first JSBSim step of a frame and the others. z0 and z
    are the effects G u of a healthy surface in the first step, and its mean in the other n - 1 steps; w is
    1 / n. The mean effect of the fault over the frame then exceeds its extremes, which are computed with the
    mean of all steps, by at most |z0 - z| / n. Gu_first is w z0, and Gu - Gu_first is (1 - w) z.
    """
    w = pred.w
    Gu = pred.sums.Gu
    first = pred.sums.Gu_first
    for i in range(3):
        for s in range(pred.u.size):
            pred.means.e_Gu[i, s] = abs(first[i, s] - (Gu[i, s] - first[i, s]) * w / (1.0 - w))


@kernel
def evaluate_frame(pred, bound, meas, k, dt):
    """Fill the bound on the uncertainty at this instant, and the means over the elapsed frame, number k, of
    dt s. The order matters: the bound uses the errors of the deflections, and `fill_means` replaces the
    eta_bar that this instant has just set, but in the first frame, which has no sums."""
    bound.error_map.time_s = k * dt
    fill_deflection_errors(pred, bound.declared_errors)
    fill_bound(bound, pred.design, meas, pred.u)
    bound.eta_bar = bound.eta_now
    if bound.declared_errors.given:
        for i in range(3):
            bound.n_gyro[i] = n_gyro(bound.declared_errors, i, meas.x[i])
    if k > 0:
        fill_means(pred, bound)


@kernel
def begin_sums(pred, bound, layout, all_types, meas):
    """Restart the sums for the next frame with this instant, at which the old command is still in effect. Its
    rates and n_gyro become those of the start of the frame."""
    sums = pred.sums
    pred.x_before = meas.x
    bound.n_old = bound.n_gyro
    sums.F[:] = sums.eta_bar[:] = bound.extra[:] = 0.0
    sums.G[:] = sums.Gu[:] = sums.u[:] = sums.eG[:] = sums.eGu[:] = 0.0
    sums.G_min[:] = sums.u_min[:] = np.inf
    sums.G_max[:] = sums.u_max[:] = -np.inf
    add_to_sums(pred, bound, layout, all_types)
    copy(sums.Gu, sums.Gu_first)


@kernel
def redo_move(pred, command):
    """Take back the last `move_surfaces`, and move by the same JSBSim frame towards another command (n,) rad,
    which replaces it (`stepping.hold`)."""
    copy(pred.u_old, pred.u)
    copy(pred.u_lo_old, pred.u_lo)
    copy(pred.u_hi_old, pred.u_hi)
    move_surfaces(pred, command)


@kernel
def add_instant(pred, bound, layout, all_types, meas):
    """Add an instant inside the frame to its sums, and move the healthy surfaces on."""
    fill_deflection_errors(pred, bound.declared_errors)
    fill_bound(bound, pred.design, meas, pred.u)
    add_to_sums(pred, bound, layout, all_types)
    move_healthy(pred)


@kernel
def predict_known(pred, with_faults, effectiveness, bias, with_biases):
    """Fill F_known, (3,) rad/s2, over the elapsed frame:

        F_known = F - sum_s Gu_s (1 - effectiveness_s) + sum_s G_s bias_s

    effectiveness (n,), bias (n,) rad: estimates for each surface. Unless `with_faults`, F_known is F; unless
    `with_biases`, the last sum is left out.
    """
    F = pred.F_known
    means = pred.means
    copy(means.F, F)
    if with_faults:
        for i in range(3):
            for s in range(bias.size):
                F[i] -= (1.0 - effectiveness[s]) * means.Gu[i, s]
                F[i] += means.G[i, s] * bias[s] if with_biases else 0.0


@kernel
def innovation_known(pred, x, dt):
    """nu_known = (x - x_old) / dt - F_known, (3,) rad/s2."""
    for i in range(3):
        pred.nu_known[i] = (x[i] - pred.x_before[i]) / dt - pred.F_known[i]


@kernel
def move_surfaces(pred, command):
    """Move the healthy surfaces by one JSBSim frame towards the new command (n,) rad."""
    copy(command, pred.commanded)
    move_healthy(pred)


@kernel
def move_healthy(pred):
    """Move the healthy surfaces, and the ends between which they are, by one JSBSim frame."""
    copy(pred.u, pred.u_old)
    copy(pred.u_lo, pred.u_lo_old)
    copy(pred.u_hi, pred.u_hi_old)
    move(pred.actuators, pred.commanded, pred.u)
    if pred.actuators.uncertain:
        move_ends(pred.actuators, pred.commanded, pred.u_lo, pred.u_hi)


@kernel
def fill_deflection_errors(pred, err):
    """du = du0 + max(u_hi - u, u - u_lo), (n,) rad: how far each healthy surface may be from its model.
    Without errors of the actuators du stays as configured."""
    if pred.actuators.uncertain:
        for s in range(pred.u.size):
            err.du[s] = err.du0 + max(pred.u_hi[s] - pred.u[s], pred.u[s] - pred.u_lo[s])
