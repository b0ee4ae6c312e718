"""The statistical detector as it follows from what a scenario declares: level, drift, blocks and views.

The noise model (rates.py) has the declared noise, for which the declared rate of false alarms holds. Letters
as in statistical.py; omega, rad/s, is the frequency of a bounded uncertainty.
"""

from collections.abc import Iterator
from math import exp, hypot, sqrt
from statistics import NormalDist
from sys import float_info
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.compiled import fill
from beaver_ftc.design.plain_model import jacobian
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, QDYN
from beaver_ftc.design.turbulence import rotation_lengths
from beaver_ftc.diagnosis.bounds import Y0
from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.attitude import configure_attitude
from beaver_ftc.diagnosis.detection.forces_design import TrimState, configure_forces
from beaver_ftc.diagnosis.detection.likelihood import (
    ALPHA_CUBED_MOMENT,
    GROWING_LOSS,
    LOSS_END,
    N_SLOTS,
    STEP_FAULT,
)
from beaver_ftc.diagnosis.detection.parity_design import (
    ROLL_YAW_PLANE,
    ParityDirection,
    configure_parity_views,
    list_directions,
)
from beaver_ftc.diagnosis.detection.rates import configure_rows
from beaver_ftc.diagnosis.detection.rows import RATES, set_columns
from beaver_ftc.diagnosis.detection.statistical import MAX_ETA_RATE
from beaver_ftc.diagnosis.detection.tones import N_TONES, configure_tones
from beaver_ftc.diagnosis.gusts import MIN_UNMEASURED_SHARES
from beaver_ftc.diagnosis.gusts_design import add_gust_noise, configure_gust, configure_gust_speed
from beaver_ftc.diagnosis.state import LOSS, PITCH
from beaver_ftc.diagnosis.tolerances import coefficient_bounds, moment_axis
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import Statistical

# Rate kappa of the growing-loss hypothesis. It explains a third of a loss that grows ten times slower or
# faster; a constant loss explains the rest.
KAPPA_PER_S = 1.5

# Share of the alarm level reserved for noise in addition to an uncertainty at its bound (statistical.md).
LEVEL_NOISE_SHARE = 0.5
# Frequency of the bounded uncertainty, if damage may take surfaces (`_configure_noise`). Chosen on flights of
# a GTM: with it 42 of 75 faults are found that were missed before, with 15 rad/s 23, with 8 rad/s 36, with
# 0.2 rad/s and less at most 35.
DAMAGE_FREQUENCY_RAD_S = 3.0
FORCE_ERROR_SHARE = 0.01  # of a gust's intensity, left unmeasured by an error of a tenth in the forces


class Entry(NamedTuple):
    """A hypothesis of a block: kind (likelihood.py), surface or -1, axis, and whether it raises alarms."""

    kind: int
    surface: int
    axis: int
    alarms: bool


def hypotheses_by_block(aircraft: Aircraft) -> Iterator[tuple[tuple[int, ...], list[Entry]]]:
    """Axes and hypotheses of each block, in their order; roll and yaw come twice (statistical.py).

        LOSS, GROWING_LOSS, LOSS_END    of each surface that may lose effectiveness and whose dominant axis is
                                        in the block
        STEP_FAULT                      on each axis of the block
        ALPHA_CUBED_MOMENT              on pitch

    Only LOSS and STEP_FAULT raise alarms.
    """
    for axes in ((PITCH,), ROLL_YAW_PLANE, ROLL_YAW_PLANE):
        losses = [
            (s, axis)
            for s, (name, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True))
            if name in aircraft.class_of_losses and axis in axes
        ]
        entries = [Entry(LOSS, s, axis, True) for s, axis in losses]
        entries += [Entry(STEP_FAULT, -1, axis, True) for axis in axes]
        entries += [Entry(ALPHA_CUBED_MOMENT, -1, PITCH, False)] if PITCH in axes else []
        entries += [Entry(kind, s, axis, False) for s, axis in losses for kind in (GROWING_LOSS, LOSS_END)]
        yield axes, entries


def count_tests(aircraft: Aircraft, *directions: ParityDirection) -> int:
    """The largest number of one-sided tests by which the detector may raise the alarm in a frame, those of
    these views included: one for each onset and sign of a hypothesis that can raise the alarm, and one for
    each frequency of a view.

    A view of a force across a surface tests for a step, losses and frequencies; the view of an axis of the
    rates, for frequencies. Other views raise no alarm (parity.py).
    """
    kinds = [entry.kind for _, entries in hypotheses_by_block(aircraft) for entry in entries if entry.alarms]
    n_tones = 0
    for d in directions:
        if d.by_force and not (d.is_axis or d.across_vane):
            kinds += [STEP_FAULT, *(LOSS for _ in d.tested_losses)]
            n_tones += N_TONES
        elif d.is_axis and not d.by_inertia:
            n_tones += N_TONES
    return N_SLOTS * sum(1 if likelihood.SIGN_OF_KIND[kind] else 2 for kind in kinds) + n_tones


def _quantile(p: float) -> float:
    """Quantile p of the normal distribution; a p below the smallest float counts as that."""
    return NormalDist().inv_cdf(max(p, float_info.min))


def derive_alarm_level(false_alarms_per_h: float, rate_hz: float, n_tests: int) -> float:
    """The alarm level, standard deviations, for a rate of false alarms per hour with so many tests a frame:

        z = -probit(false_alarms_per_h / (3600 rate_hz n_tests))

    By the union bound the rate is at most `false_alarms_per_h`.
    """
    return -_quantile(false_alarms_per_h / (3600.0 * rate_hz * n_tests))


def configure_statistics(fdi: np.void, declared: Declared, model: np.void, trim: TrimState) -> None:
    """Fill the statistical part of a diagnosis record; trim: x (3,), y and u (surfaces,) in trim.

    The order of the calls is fixed, because a step reads fields that earlier steps have filled:

        step                      reads                              filled by
        configure_gust_speed      test.alarm_level, gust             _configure_levels, configure_gust
        _configure_blocks         test.alarm_level, rows             _configure_levels, configure_rows
        _configure_noise          test.alarm_level                   _configure_levels
        configure_forces          rows, gust                         configure_rows, configure_gust
        _configure_view_gusts     gust                               configure_gust, configure_gust_speed
        configure_parity_views    block, rows, forces, vaned         _configure_blocks, configure_rows, and
                                                                     the two before
        _configure_lengths        test.alarm_level, noise.q, gust    _configure_levels, _configure_noise,
                                                                     configure_gust
        configure_attitude        test.margin                        _configure_levels
        calm blocks               n, a, R_y, P of block              _configure_blocks
        add_gust_noise            noise.Q0, noise.Q, gust, forces    _configure_noise, configure_gust,
                                                                     configure_forces
    """
    stat = fdi["statistical"]
    settings = declared.fdi.statistical
    stat["alarm"]["detected_at_s"] = -1.0
    if settings is None or not fdi["config"]["enabled"]:  # no such detector, or no compiled scheme
        return
    cfg = stat["test"]
    gust = stat["gust"]
    aircraft = declared.aircraft
    errors = declared.sensors
    rate_hz = declared.rate_hz
    V = float(trim[1][AIRSPEED])
    dt_s = 1.0 / rate_hz
    rate = eta_rate(settings, aircraft, dt_s)
    fill(cfg, enabled=1, w=1.0 / declared.substeps)
    stat["forces"]["in_use"] = declared.uses_accelerometers
    gust["output"]["uses_accelerometers"] = declared.follows_gusts_by_accelerometers
    configure_gust(gust, declared)
    views = list_directions(aircraft, declared.uses_accelerometers) if declared.compares_across else ()
    n_tests = count_tests(aircraft, *views)
    _configure_levels(cfg, declared, settings, n_tests)
    configure_gust_speed(gust, declared, float(cfg["alarm_level"]), V)
    tol = coefficient_bounds(declared, model, *trim[1:])
    configure_rows(stat, errors, tol, fdi["bound"]["declared_errors"])
    _configure_blocks(stat, declared, rate, dt_s)
    stat["noise"]["rate0"] = settings.uncertainty_rad_s * dt_s
    _configure_noise(stat, settings.uncertainty_rad_s, declared, model, trim, dt_s)
    if declared.compares_across:
        false_alarm = settings.false_alarms_per_h / (3600.0 * rate_hz * n_tests)
        configure_tones(stat["tone_test_config"], false_alarm, V, rate * rate_hz, dt_s)
        if declared.uses_accelerometers:
            configure_forces(fdi, declared, trim, jacobian(model, *trim)[3], dt_s)
            _configure_view_gusts(stat, declared)
        configure_parity_views(stat, aircraft)
    _configure_lengths(stat, V, rate_hz)
    monitor = fdi["sensor_monitor"]["config"]
    if monitor["enabled"] and monitor["noisy"]:
        configure_attitude(stat["attitude"], monitor["D"], errors, float(cfg["margin"]), dt_s)
    if gust["output"]["gusty"]:
        # the filters that assume no gust start as the others, all with a random walk as drift
        for name in ("n", "a", "R_y", "P_xx", "P_dd"):
            stat["block"]["calm"][name] = stat["block"][name]
        add_gust_noise(stat, errors, model, *trim[1:], dt_s)


def _configure_levels(cfg: np.void, declared: Declared, settings: Statistical, n_tests: int) -> None:
    """Fill the level of the alarm, the margin of isolation, and how evidence is forgotten and bounded."""
    aircraft = declared.aircraft
    rate_hz = declared.rate_hz
    # margin: the difference z_m^2 / 2 of log-likelihood ratios that noise exceeds in a second with
    # probability `misnaming`; z_m: the quantile of its share in one test
    fill(
        cfg, alarm_level=derive_alarm_level(settings.false_alarms_per_h, rate_hz, n_tests),
        margin=0.5 * _quantile(settings.misnaming / (rate_hz * count_tests(aircraft))) ** 2,
        forget=exp(-1.0 / (rate_hz * declared.fdi.forgetting_time_s)),
        mapped=aircraft.file.model_error_map is not None and not aircraft.loses_surfaces,
    )  # fmt: skip


def _configure_view_gusts(stat: np.void, declared: Declared) -> None:
    """Fill the gust estimates of the views: `vaneless`, by accelerometers in place of the vanes, and `vaned`,
    by both. Both are copies of that of the rates, and use accelerometers. The rates then use them as well,
    unless these may break. If they cannot break, `vaned` would be the same estimate, and is switched off.
    """
    gust = stat["gust"]
    vaneless = stat["vaneless"]
    gust["output"]["uses_accelerometers"] = 1
    stat["vaneless"] = stat["vaned"] = gust
    vaneless["memory"]["share"] = np.minimum(np.add(MIN_UNMEASURED_SHARES, FORCE_ERROR_SHARE), 1.0)
    gust["output"]["uses_accelerometers"] = not declared.monitors_sensors
    stat["vaned"]["output"]["gusty"] *= declared.monitors_sensors


def _configure_lengths(stat: np.void, V: float, rate_hz: float) -> None:
    """Fill the correlation length of the drift, m, of the block whose drift reverts to zero and, if a gust is
    declared but not measured, of the pitch block; fill the factor on the intensity of their gust:

        Q_scale = (gust_m / length)^2        the same power at low frequency

    gust_m m: correlation length of the gust on these axes, 0 in still air. The length is at most longest_m:
    gust_m, but for roll and yaw the smallest of the three lengths if the gust is visible only coarsely. 0 is
    no limit.
    """
    cfg = stat["gust"]["config"]
    out = stat["gust"]["output"]
    roll_m = float(cfg["L_roll"]) if out["gusty"] else 0.0
    rotations_m = rotation_lengths(cfg["span"])
    lengths = [(stat["block"][-1], min(rotations_m) if cfg["coarse_only"] else roll_m, roll_m)]
    if out["gusty"] and not out["measured"]:
        lengths.append((stat["block"][likelihood.PITCH_BLOCK], rotations_m[1], rotations_m[1]))
    for b, longest_m, gust_m in lengths:
        b["drift_correlation_length_m"] = derive_length(stat, V, rate_hz, float(longest_m))
        if out["gusty"]:
            b["Q_scale"] = (gust_m / b["drift_correlation_length_m"]) ** 2


def _configure_blocks(stat: np.void, declared: Declared, rate: float, dt_s: float) -> None:
    """Fill axes and hypotheses of each block, its level, its unknown constants, and P and R_y of its filter.

    rate: largest change of the bounded uncertainty within a frame, over its bound. If a loss is declared
    abrupt, it neither grows nor ends, and the hypotheses of this are left out. The column of a hypothesis
    that raises no alarm is not used.
    """
    aircraft = declared.aircraft
    cfg = stat["test"]
    rows = stat["rows"]
    losses = [aircraft.surfaces.index(name) for name in aircraft.class_of_losses]
    left_out = (GROWING_LOSS, LOSS_END) if declared.fdi.fault_profile == "abrupt" else ()
    cfg["n_scores"] = len(losses) + len(AXES)
    for b, (axes, all_entries) in zip(stat["block"], hypotheses_by_block(aircraft), strict=True):
        terms = [k for k, term in enumerate(aircraft.moments) if moment_axis(term) in axes]
        readings = range(len(aircraft.moments), int(rows["n"]))
        set_columns(b, rows, [*terms, *readings] if rows["n"] else [])
        fill(
            b, n=len(axes), a=1.0, Q_scale=1.0, eta_rate=rate, source=RATES, alarm_level=cfg["alarm_level"],
            noise_share=0.0 if declared.is_noise_free else LEVEL_NOISE_SHARE,
        )  # fmt: skip
        for i, axis in enumerate(axes):
            b["axes"][i], b["m"][i, axis] = axis, 1.0
            b["R_y"][i] = b["P_xx"][i, i] = rows["R"][axis]
            b["P_dd"][i, i] = likelihood.DRIFT_PRIOR_RAD_S2**2
        entries = [entry for entry in all_entries if entry.kind not in left_out]
        b["n_h"], b["hypothesis"]["decay"] = len(entries), exp(-KAPPA_PER_S * dt_s)
        likelihood.set_signs(b, [entry.kind for entry in entries])
        for h, (kind, s, axis, alarms) in zip(b["hypothesis"], entries, strict=False):
            h["signature"][: len(axes)] = [kind == STEP_FAULT and axis == i for i in axes]
            column = losses.index(s) if kind == LOSS else len(losses) + axis
            fill(h, kind=kind, surface=s, axis=axis, alarms=alarms, column=column)


def eta_rate(settings: Statistical, aircraft: Aircraft, dt_s: float) -> float:
    """Largest change of a bounded uncertainty within a frame of dt_s, over its bound: MAX_ETA_RATE if the
    model has an error, else its frequency times dt_s.

    The error of an aircraft's own terms changes with its surfaces, which a law may move fully within a frame:
    from one end of the bound to the other. If the error is mapped, its rate of change is worked out in flight
    (`statistical.update_eta_rate`).
    """
    return MAX_ETA_RATE if any(aircraft.model_error_rad_s2) else settings.uncertainty_rad_s * dt_s


def _configure_noise(
    stat: np.void, omega: float, declared: Declared, model: np.void, trim: TrimState, dt_s: float
) -> None:
    """Fill the drift, for an uncertainty of frequency omega, rad/s, and the model noise by noise of f + G u.

    The evidence that the uncertainty explains is bounded by its declared rate of change in any case
    (`likelihood.uncertain_share`). The drift only sets how much of it the filters remove. If damage may take
    surfaces, a weaker drift detects most: motion that no loss explains is then rarely an error of the model.

        Q0 = sum_x (F_x sigma_x)^2      Q = Q0 + sum_y (F_y sigma_y)^2, in trim

    In flight `rates.add_constants` updates Q, and adds the noise of the engine's power.

    F_x, F_y: slopes of f + G u with rates x and air data y; sigma: noise of the readings, gyros first. Also
    fill G_trim, the magnitude of G in trim.
    """
    sigma = declared.sensors.each("random")
    noise = stat["noise"]
    if declared.aircraft.loses_surfaces:
        omega = min(DAMAGE_FREQUENCY_RAD_S, omega)
    eta = max(declared.constant_rad_s2)
    level = float(stat["test"]["alarm_level"])
    _, G, F_x, F_y = jacobian(model, *trim)
    Q0 = F_x**2 @ sigma[:Y0] ** 2
    Q_y = F_y[:, [ALPHA, BETA, AIRSPEED, QDYN]] ** 2 @ sigma[Y0:] ** 2
    fill(noise, q=derive_intensity(eta, omega, float(sigma[:Y0].max()), level, dt_s), Q0=Q0, Q=Q0 + Q_y)
    noise["G_trim"][:, : G.shape[1]] = np.abs(G)


def derive_intensity(b: float, omega: float, sigma: float, z: float, dt_s: float) -> float:
    """Intensity of the random walk that stands for a bounded uncertainty, over its bound squared, 1/s.

        max(hypot((v (sigma^2 dt)^(1/4))^(4/5), 4 (1.204 b / z)^2 omega), v dt) / b^2
        v = 8 sqrt(2) (b omega / z)^2                                                  (statistical.md)

    An uncertainty of b sin(omega t) moves the test for a step by b omega sqrt(2 sqrt 2 / i w0), w0 = (i /
    n)^(1/4), for a walk of intensity i and gyro noise of density n = sigma^2 dt; v is the i w0 at which that
    is z / 2. Almost without noise w0 is the frame rate. The evidence for a loss under a moving command grows
    together with the uncertainty while both have the same sign: by b sqrt(omega / i) times 1.204, the largest
    value of sin(x) / sqrt(x / 2), x half of omega t. Half the alarm level is left for it: noise alone then
    takes up no more than the other half.

    b rad/s2: bound, at least MIN_ETA_RAD_S2; omega, sigma rad/s; z: alarm level, standard deviations.
    """
    b = max(b, likelihood.MIN_ETA_RAD_S2)
    v = 8.0 * sqrt(2.0) * (b * omega / z) ** 2
    i_loss = 4.0 * (1.204 * b / z) ** 2 * omega
    i_step = (v * (sigma**2 * dt_s) ** 0.25) ** 0.8
    return max(hypot(i_step, i_loss), v * dt_s) / b**2


def derive_length(stat: np.void, V: float, rate_hz: float, longest_m: float) -> float:
    """Return the length, m, of the drift in the second block of roll and yaw, or of pitch without gust
    estimate:

        min(V tau, longest_m),      tau = sqrt(2 T / q) / z

    V m/s: airspeed in trim; longest_m m: limit of the length, 0 for none; z: alarm level; q 1/s: intensity of
    the drift over the bound eta squared (NOISE_RECORD). The drift returns as soon as a bounded uncertainty
    permits: over the longest window, of T s, an uncertainty that oscillates with the fault moves a test, for
    a drift of lag tau s, by sqrt(T / 2 q) / tau; half the alarm level is left for this. The drift returns no
    later than the gust. A gust with a longer correlation length is represented by a stronger one, of equal
    power at low frequency and more power at high frequency.
    """
    if stat["noise"]["q"] == 0.0:
        # 0 in still air: nothing is declared that drifts, and the two blocks are one
        return longest_m
    T = 2 ** (N_SLOTS - 1) / rate_hz
    z = float(stat["test"]["alarm_level"])
    tau = sqrt(2.0 * T / stat["noise"]["q"]) / z
    return min(V * tau, longest_m or np.inf)
