"""The statistical detector: likelihood-ratio tests on the whitened innovation (likelihood.py, parity.py).

Pitch is one block; roll and yaw, whose noise is correlated, are another. Roll and yaw have two blocks with
different models of the drift. A random walk reacts fast and ignores constant errors. A drift that returns to
zero gathers evidence for longer. Pitch has only the latter if no vane measures its gust. The worst-case
scheme needs no probability; the scenario's `fdi.authority` sets whose alarms and exclusions count.

The noise model (rows.py) follows from what a scenario declares, and the declared rate of false alarms holds
for the declared noise.

Symbols of the kernels:

    nu (3,) rad/s2                innovation of the frame
    eta (3,) rad/s2               bound on the uncertainty
    x (3,) rad/s, y, u (n,) rad   rates, readings, deflections; F = f + G u of the design model, rad/s2
    w                             one over the number of instants in a frame
    dt s, k                       duration and number of the frame
    b, h, v                       block, hypothesis, view
    s, i, j                       surface, axis, reading or term
    fies, of (n,)                 isolation estimators; number of that of each surface's loss, or -1
    lo, hi                        bounds on a log-likelihood ratio
    cfg, noise, gust, bound       records of the tests, the noise model, the gust estimate, the bounds
"""

from collections.abc import Iterator
from math import exp, hypot, sqrt
from statistics import NormalDist
from sys import float_info

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties
from beaver_ftc.aircraft.schema import MAX_SURFACES
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design import rotation_lengths
from beaver_ftc.design.model import jacobian
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, QDYN
from beaver_ftc.diagnosis import gusts
from beaver_ftc.diagnosis.detection import likelihood, parity
from beaver_ftc.diagnosis.detection.attitude import attitude_dtype, configure_attitude
from beaver_ftc.diagnosis.detection.forces import FORCES_RECORD, TrimState, configure_forces
from beaver_ftc.diagnosis.detection.likelihood import (
    ALPHA_CUBED_MOMENT,
    GROWING_LOSS,
    LATERAL_BLOCK,
    LOSS_END,
    N_FILTER_BLOCKS,
    N_SLOTS,
    STEP_FAULT,
    block_dtype,
)
from beaver_ftc.diagnosis.detection.parity import (
    AXIS_VIEW,
    ROLL_YAW_PLANE,
    USUAL_SIZE,
    VANE_VIEW,
    ParityDirection,
    StatisticalSize,
    configure_parity_views,
    list_directions,
    view_dtype,
)
from beaver_ftc.diagnosis.detection.rows import (
    NOISE_RECORD,
    RATES,
    ROWS_RECORD,
    add_constants,
    add_turn,
    begin_rows,
    configure_rows,
    look,
    set_columns,
)
from beaver_ftc.diagnosis.detection.tones import N_TONES, TONE_RECORD, configure_tones
from beaver_ftc.diagnosis.deviations import coefficient_bounds, moment_axis
from beaver_ftc.diagnosis.gusts import (
    FORCE_ERROR_SHARE,
    GUST_RECORD,
    MIN_UNMEASURED_SHARES,
    add_gust_noise,
    configure_gust,
    configure_gust_speed,
)
from beaver_ftc.diagnosis.state import DAMAGE_EXCLUDES, LOSS, PITCH, SIDE_FORCE
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import Statistical

# Rate kappa of the growing-loss hypothesis. It explains a third of a loss that grows ten times slower or
# faster; a constant loss explains the rest.
KAPPA_PER_S = 1.5

# Share of the alarm level reserved for noise in addition to an uncertainty at its bound (statistical.md).
LEVEL_NOISE_SHARE = 0.5
# 42 of 75 flights of a GTM not found before; 15: 23, 8: 36, 0.2 and less: 35 and fewer
DAMAGE_FREQUENCY_RAD_S = 3.0


def hypotheses_by_block(
    aircraft: Aircraft,
) -> Iterator[tuple[tuple[int, ...], list[tuple[int, int, int, int]]]]:
    """Axes and hypotheses (kind, surface, axis, raises alarms) of each block: the losses of the surfaces that
    turn about its axes, and what they are held against. Roll and yaw are there twice, see above."""
    for axes in ((PITCH,), ROLL_YAW_PLANE, ROLL_YAW_PLANE):
        losses = [
            (s, axis)
            for s, (name, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True))
            if name in aircraft.class_of_losses and axis in axes
        ]
        rows = [(LOSS, s, axis, 1) for s, axis in losses]
        rows += [(STEP_FAULT, -1, axis, 1) for axis in axes]
        rows += [(ALPHA_CUBED_MOMENT, -1, PITCH, 0)] if PITCH in axes else []
        rows += [(kind, s, axis, 0) for s, axis in losses for kind in (GROWING_LOSS, LOSS_END)]
        yield axes, rows


def count_tests(aircraft: Aircraft, *directions: ParityDirection) -> int:
    """The number of one-sided tests that the detector makes in a frame, those of these views included."""
    kinds = [kind for _, rows in hypotheses_by_block(aircraft) for kind, _, _, alarms in rows if alarms]
    n_tones = 0
    for d in directions:
        if 0 <= d.nulled < VANE_VIEW and any(d.m_0[SIDE_FORCE:]):
            kinds += [STEP_FAULT, *(LOSS for _ in d.tested_losses)]
            n_tones += N_TONES
        elif d.nulled == AXIS_VIEW and not d.by_inertia:
            n_tones += N_TONES
    return N_SLOTS * sum(1 if likelihood.SIGN_OF_KIND[kind] else 2 for kind in kinds) + n_tones


def _quantile(p: float) -> float:
    """Quantile p of the normal distribution; of a p that is too small for a number, that of the smallest."""
    return NormalDist().inv_cdf(max(p, float_info.min))


def derive_alarm_level(false_alarms_per_h: float, rate_hz: float, n_tests: int) -> float:
    """The alarm level, standard deviations, for a rate of false alarms per hour with so many tests a frame.

    By the union bound the rate is at most `false_alarms_per_h`.
    """
    return -_quantile(false_alarms_per_h / (3600.0 * rate_hz * n_tests))


def configure_statistics(
    fdi: np.void,
    declared: Declared,
    model: np.void,
    mass: MassProperties,
    trim: TrimState,
    rate_hz: float,
) -> None:
    """Fill the statistical part of a diagnosis record; trim: x (3,), y and u (surfaces,) in trim."""
    stat, settings = fdi["statistical"], declared.fdi.statistical
    stat["alarm"]["detected_at_s"] = -1.0
    if settings is None or not fdi["config"]["enabled"]:  # a plug-in diagnoses, or nothing does
        return
    cfg, gust, aircraft = stat["test"], stat["gust"], declared.aircraft
    errors, dt_s = declared.sensors, 1.0 / rate_hz
    n_instants = int(fdi["config"]["n_substeps"])
    cfg["enabled"], cfg["w"] = 1, 1.0 / max(n_instants, 1)
    V = float(trim[1][AIRSPEED])
    rate = eta_rate(settings, aircraft, dt_s)
    stat["forces"]["in_use"] = declared.uses_accelerometers
    gust["output"]["uses_accelerometers"] = declared.follows_gusts_by_accelerometers
    configure_gust(gust, declared, mass)
    views = declared.fdi.compares_across(n_instants)
    n_tests = count_tests(
        aircraft, *(list_directions(aircraft, declared.uses_accelerometers) if views else ())
    )
    _configure_levels(cfg, declared, n_tests, rate_hz)
    configure_gust_speed(gust, declared, float(cfg["alarm_level"]), V)
    tol = coefficient_bounds(declared, model, mass, *trim[1:])
    configure_rows(stat, errors, tol, fdi["bound"]["declared_errors"])
    _configure_blocks(stat, declared, rate, dt_s)
    stat["noise"]["rate0"] = settings.uncertainty_rad_s * dt_s
    _configure_noise(stat, settings.uncertainty_rad_s, declared, model, trim, dt_s)
    if views:
        configure_tones(
            stat["tone_test_config"],
            settings.false_alarms_per_h / (3600.0 * rate_hz * n_tests),
            V,
            rate * rate_hz,
            dt_s,
        )
        if declared.uses_accelerometers:
            configure_forces(fdi, declared, trim, jacobian(model, *trim)[3], dt_s)
            _configure_view_gusts(stat, declared)
        configure_parity_views(stat, aircraft)
    _configure_lengths(stat, V, rate_hz)
    monitor = fdi["sensor_monitor"]["config"]
    if monitor["enabled"] and monitor["noisy"]:
        configure_attitude(stat["attitude"], monitor["D"], errors, float(stat["test"]["margin"]), dt_s)
    if gust["output"]["gusty"]:
        # the filters that assume no gust: they trim as the others, with a drift in any direction
        for name in ("n", "a", "R_y", "P_xx", "P_dd"):
            stat["block"]["calm"][name] = stat["block"][name]
        add_gust_noise(stat, errors, model, *trim[1:], dt_s)


def _configure_levels(cfg: np.void, declared: Declared, n_tests: int, rate_hz: float) -> None:
    """Fill the level of the alarm, the margin of isolation, and how evidence is forgotten and bounded."""
    settings, aircraft = declared.fdi.statistical, declared.aircraft
    assert settings is not None
    cfg["alarm_level"] = derive_alarm_level(settings.false_alarms_per_h, rate_hz, n_tests)
    # difference of log-likelihood ratios that noise exceeds in a second with the probability `misnaming`
    cfg["margin"] = 0.5 * _quantile(settings.misnaming / (rate_hz * count_tests(aircraft))) ** 2
    cfg["forget"] = exp(-1.0 / (rate_hz * declared.fdi.forgetting_time_s))
    cfg["mapped"] = aircraft.file.model_error_map is not None and not aircraft.loses_surfaces


def _configure_view_gusts(stat: np.void, declared: Declared) -> None:
    """Fill the gust estimates of the views: by accelerometers in place of the vanes, and by both.

    The rates use the latter, too, unless accelerometers may break.
    """
    gust, vaneless = stat["gust"], stat["vaneless"]
    gust["output"]["uses_accelerometers"] = 1
    stat["vaneless"] = stat["vaned"] = gust
    vaneless["memory"]["share"] = np.minimum(np.add(MIN_UNMEASURED_SHARES, FORCE_ERROR_SHARE), 1.0)
    gust["output"]["uses_accelerometers"] = not declared.monitors_sensors
    stat["vaned"]["output"]["gusty"] *= declared.monitors_sensors


def _configure_lengths(stat: np.void, V: float, rate_hz: float) -> None:
    """Fill the correlation length of the drift, m, of the block whose drift reverts to its mean and, where no
    vane measures the gust, of the pitch block; fill how much of a gust's drift each of them then has."""
    cfg, out = stat["gust"]["config"], stat["gust"]["output"]
    roll_m, rotations_m = float(cfg["L_roll"]) if out["gusty"] else 0.0, rotation_lengths(cfg["span"])
    lengths = [(stat["block"][-1], min(rotations_m) if cfg["coarse_only"] else roll_m, roll_m)]
    if out["gusty"] and not out["measured"]:
        lengths.append((stat["block"][likelihood.PITCH_BLOCK], rotations_m[1], rotations_m[1]))
    for b, longest_m, gust_m in lengths:
        b["drift_correlation_length_m"] = derive_length(stat, V, rate_hz, float(longest_m))
        if out["gusty"]:
            b["Q_scale"] = (gust_m / b["drift_correlation_length_m"]) ** 2


def _configure_blocks(stat: np.void, declared: Declared, rate: float, dt_s: float) -> None:
    """Fill axes and hypotheses of each block, its level, and its unknown constants.

    rate: largest change of the bounded uncertainty within a frame, over its bound. A loss that is declared
    constant does not grow.
    """
    aircraft, cfg, rows = declared.aircraft, stat["test"], stat["rows"]
    losses = [aircraft.surfaces.index(name) for name in aircraft.class_of_losses]
    left_out = (GROWING_LOSS, LOSS_END) if declared.fdi.fault_profile == "abrupt" else ()
    cfg["n_scores"] = len(losses) + len(AXES)
    for b, (axes, all_entries) in zip(stat["block"], hypotheses_by_block(aircraft), strict=True):
        own = [k for k, term in enumerate(aircraft.moments) if moment_axis(term) in axes]
        readings = range(len(aircraft.moments), int(rows["n"]))
        set_columns(b, rows, [*own, *readings] if rows["n"] else [])
        b["n"], b["a"], b["Q_scale"], b["eta_rate"], b["source"] = len(axes), 1.0, 1.0, rate, RATES
        b["alarm_level"] = cfg["alarm_level"]
        b["noise_share"] = 0.0 if declared.is_noise_free else LEVEL_NOISE_SHARE
        for i, axis in enumerate(axes):
            b["axes"][i], b["m"][i, axis] = axis, 1.0
            b["R_y"][i] = b["P_xx"][i, i] = rows["R"][axis]
            b["P_dd"][i, i] = likelihood.DRIFT_PRIOR_RAD_S2**2
        entries = [entry for entry in all_entries if entry[0] not in left_out]
        b["n_h"], b["hypothesis"]["decay"] = len(entries), exp(-KAPPA_PER_S * dt_s)
        likelihood.set_signs(b, [kind for kind, *_ in entries])
        for h, (kind, s, axis, alarms) in zip(b["hypothesis"], entries, strict=False):
            h["signature"][: len(axes)] = [kind == STEP_FAULT and axis == each for each in axes]
            h["kind"], h["surface"], h["axis"], h["alarms"] = kind, s, axis, alarms
            h["column"] = losses.index(s) if kind == LOSS else len(losses) + axis


def eta_rate(settings: Statistical, aircraft: Aircraft, dt_s: float) -> float:
    """Largest change of a bounded uncertainty within a frame, over its bound.

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
    """
    sigma, noise = declared.sensors.each("random"), stat["noise"]
    if declared.aircraft.loses_surfaces:
        omega = min(DAMAGE_FREQUENCY_RAD_S, omega)
    eta, level = max(declared.constant_rad_s2), float(stat["test"]["alarm_level"])
    noise["q"] = derive_intensity(eta, omega, float(sigma[:3].max()), level, dt_s)
    _, G, F_x, F_y = jacobian(model, *trim)
    noise["Q0"] = F_x**2 @ sigma[:3] ** 2
    Q_y = F_y[:, [ALPHA, BETA, AIRSPEED, QDYN]] ** 2 @ sigma[3:] ** 2  # later as `rows.add_constants` says
    noise["Q"] = noise["Q0"] + Q_y
    noise["G_trim"][:, : G.shape[1]] = np.abs(G)


def derive_intensity(eta: float, omega: float, sigma: float, level: float, dt_s: float) -> float:
    """Intensity of the random walk that stands for a bounded uncertainty, over its bound squared, 1/s.

    An uncertainty of eta sin(omega t) moves the test for a step by eta omega sqrt(2 sqrt 2 / i w0), w0 = (i /
    n)^(1/4), for a walk of intensity i and gyro noise of density n = sigma^2 dt (statistical.md). Almost
    without noise w0 is the frame rate. The evidence for a loss under a moving command grows together with the
    uncertainty while both have the same sign: by eta sqrt(omega / i) times 1.204, the largest value of sin(z)
    / sqrt(z / 2), z half of omega t. Half the alarm level is left for it: noise alone then takes up no more
    than the other half.

    eta rad/s2; omega, sigma rad/s; level in standard deviations.
    """
    eta = max(eta, likelihood.MIN_ETA_RAD_S2)
    iw = 8.0 * sqrt(2.0) * (eta * omega / level) ** 2  # of i w0
    i_loss = 4.0 * (1.204 * eta / level) ** 2 * omega
    i_step = (iw * (sigma**2 * dt_s) ** 0.25) ** 0.8
    return max(hypot(i_step, i_loss), iw * dt_s) / eta**2


def derive_length(stat: np.void, V: float, rate_hz: float, gust_m: float) -> float:
    """Return length V tau, m, of the drift in the second block of roll and yaw, or of pitch without gust
    estimate.

    gust_m: correlation length of the gust, m; 0 in still air. The drift returns as soon as a bounded
    uncertainty permits: over the longest window T an uncertainty that oscillates with the fault moves a test,
    for a drift of intensity i and lag tau, by eta sqrt(T / 2 i) / tau; half the alarm level is left for this.
    The drift returns no later than the gust. A gust with a longer correlation length is represented by a
    stronger one, of equal power at low frequency and more power at high frequency.
    """
    if stat["noise"]["q"] == 0.0:
        # 0 in still air: nothing is declared that drifts, and the two blocks are one
        return gust_m
    T = 2 ** (N_SLOTS - 1) / rate_hz
    level = float(stat["test"]["alarm_level"])
    tau = sqrt(2.0 * T / stat["noise"]["q"]) / level
    return min(V * tau, gust_m or np.inf)


# Least share of the best log-likelihood ratio that a constant theta explains of a loss growing at any rate
# (docs/explanation/statistical.md).
MIN_LLR_SHARE = 0.25
# The error of a model moves from one end of its bound to the other, by 2 bounds, within a frame at most, and
# no faster than a surface moves by a quarter of its travel.
MAX_ETA_RATE = 2.0
BOUNDS_PER_TRAVEL = 8.0
MIN_TRAVEL_RAD = 1e-6

# Configuration of the tests.
TESTING_RECORD = record(
    enabled=int,
    alarm_level=float, margin=float,  # standard deviations; difference of log-likelihood ratios
    forget=float,  # factor by which evidence decays per frame after the alarm
    n_scores=int,
    w=float,  # one over the number of instants in a frame
    mapped=int,  # if the error is mapped and no surface can be lost
)  # fmt: skip

# Output of the detector: largest score over the alarm level and its axis; the largest so far in healthy
# flight; time of the first alarm, s, or -1. share: n_scores of the log, of losses, then of steps.
ALARM_RECORD = record(ratio=float, axis=int, peak=float, detected_at_s=float, share=MAX_SURFACES + len(AXES))


@sized
def statistical_dtype(size: StatisticalSize = USUAL_SIZE) -> np.dtype:
    """The record of the detector, for an aircraft that needs these capacities."""
    return record(
        test=TESTING_RECORD, noise=NOISE_RECORD, rows=ROWS_RECORD, alarm=ALARM_RECORD,
        block=(block_dtype(size.rate_size), N_FILTER_BLOCKS), n_views=int,
        views=(view_dtype(size.view_size), size.n_views), tone_test_config=TONE_RECORD, forces=FORCES_RECORD,
        gust=GUST_RECORD, vaneless=GUST_RECORD, vaned=GUST_RECORD, attitude=attitude_dtype(size.rate_size),
    )  # fmt: skip


@kernel
def update_blocks(cfg, rows, blocks, gust, dt, k, alarmed, may_end=False):
    """Update the blocks with frame k: each whitens what it sees of the rows, and tests it.

    alarmed: the detector has raised its alarm; may_end: a loss may end.
    """
    decay = cfg.forget if alarmed else 1.0
    slot = likelihood.restarting_slot(k)
    for j, b in enumerate(blocks):
        if not alarmed:
            likelihood.reset_slot(b, slot)
        look(b, rows)
        b.has_coarse = gust.config.coarse_only
        if gust.config.coarse_only:
            for i, axis in enumerate(b.axes[: b.n]):
                b.g_c[i] = gust.output.acc_coarse[axis]
        if gust.output.gusty:
            add_turn(b, gust)
            if j < likelihood.REVERTING_BLOCK:
                likelihood.whiten_calm(b, dt)
            else:  # without gust both blocks of roll and yaw have the same filter
                b.calm.g[:] = blocks[LATERAL_BLOCK].calm.g
        hi_decay = cfg.forget if may_end else 0.0
        likelihood.update_block(b, dt, decay, hi_decay, cfg.mapped)


@kernel
def filter_known(blocks, gust, nu, dt):
    """Whiten nu (3,), the innovation after known faults; the state x_known tracks its slowly varying mean.

    The whitened innovation replaces the `nu` of each block.
    """
    for b in blocks[: likelihood.REVERTING_BLOCK]:
        for i, axis in enumerate(b.axes[: b.n]):
            b.nu[i] = nu[axis] - gust.output.acc_mean[axis]
        likelihood.whiten_step(b, b.x_known, b.nu, dt, b.nu)


@kernel
def fill_unmodelled(blocks, gust, out):
    """out = d + acc, (3,) rad/s2: the acceleration that the control law's model lacks.

    d: estimated drift; acc: effect of the gust that the vanes measure.
    """
    for b in blocks[: likelihood.REVERTING_BLOCK]:
        for i, axis in enumerate(b.axes[: b.n]):
            out[axis] = b.x_known[2 + i] + gust.output.acc[axis]


@kernel
def update_alarm(alarm, cfg, blocks, views, forces, gust, t, bounded=True):
    """Fill the scores over the alarm level, the largest, its axis, and at the first alarm its time t s.

    Scores of forces and of oscillations are in the column of the step on their axis. The largest is 0 unless
    `bounded`: outside its map, the model's error has no bound.
    """
    alarm.ratio, alarm.share[:] = 0.0, 0.0
    for b in blocks:
        for h in b.hypothesis[: b.n_h]:
            if h.alarms:
                keep_score(alarm, h.score / cfg.alarm_level, h.axis, h.column)
    for v in views:
        share = parity.view_alarm_score(v, views, cfg, forces, gust) / cfg.alarm_level
        keep_score(alarm, share, v.alarm_axis, cfg.n_scores - 3 + v.alarm_axis)
    if not bounded:
        alarm.ratio = 0.0
    if alarm.ratio > 1.0 and alarm.detected_at_s < 0.0:
        alarm.detected_at_s = t


@kernel
def keep_score(alarm, share, axis, column):
    """Keep a score over the alarm level in its column, and with its axis if it is the largest of all."""
    alarm.share[column] = max(alarm.share[column], share)
    if share > alarm.ratio:
        alarm.ratio, alarm.axis = share, axis


@kernel
def best_alternative(b, fies, of, s, revived=False):
    """max_h lo_h over all alternatives h to the loss of surface s in block b.

    Excluded losses are no alternatives, unless `revived`: as evidence decays, an uncertainty that correlates
    with the commands may support them again.
    """
    lo = 0.0
    for h in b.hypothesis[: b.n_h]:
        if h.kind in (GROWING_LOSS, LOSS_END):
            continue
        if h.kind == LOSS:
            j = of[h.surface]
            if h.surface == s or (j >= 0 and fies[j].excluded and not revived):
                continue
        lo = max(lo, h.llr_lo)
    return lo


@kernel
def loss_bounds(b, s, ended):
    """max_h (lo_h, hi_h) over the losses of surface s in block b, or, if `ended`, over their ends; 0 without
    any."""
    lo, hi = 0.0, 0.0
    for h in b.hypothesis[: b.n_h]:
        if h.surface == s and (h.kind == LOSS_END) == ended:
            lo, hi = max(lo, h.llr_lo), max(hi, h.llr_hi)
    return lo, hi


@kernel
def confirms_loss(cfg, blocks, fies, of, s):
    """True if a loss of surface s explains the data better than all alternatives:

        lo_loss - max_alternatives lo > margin      in some block

    If the estimator is weakly excluded by DAMAGE_EXCLUDES, excluded losses are alternatives as well.
    """
    revived = of[s] >= 0 and fies[of[s]].weak == DAMAGE_EXCLUDES
    for b in blocks:
        if loss_bounds(b, s, False)[0] - best_alternative(b, fies, of, s, revived) > cfg.margin:
            return True
    return False


@kernel
def excludes_loss(cfg, blocks, fies, of, s, pitch_ends, abrupt):
    """True if an alternative explains the data better than a loss of surface s:

        best - max(hi_loss, hi_end) > margin,   hi_loss < share best,   hi_end < end_share best

    best: the largest lo of the alternatives. Each block of roll and yaw is compared together with that of
    pitch, because a loss acts on its own axes only. A loss that is not declared `abrupt` may grow. A constant
    theta then explains only a part of its effect, so that share is MIN_LLR_SHARE instead of 1. The same holds
    for a loss that begins inside a frame of several instants, and for the end of a loss there. The end of a
    loss in pitch counts only if `pitch_ends` is set: a fault outside the class may look like it.
    """
    pitch = blocks[likelihood.PITCH_BLOCK]
    single = cfg.w == 1.0
    share = 1.0 if abrupt and single else MIN_LLR_SHARE
    end_share = 1.0 if single else MIN_LLR_SHARE
    for b in blocks[LATERAL_BLOCK:]:
        best = best_alternative(pitch, fies, of, s)
        best = max(best, best_alternative(b, fies, of, s))
        hi = max(loss_bounds(pitch, s, False)[1], loss_bounds(b, s, False)[1])
        hi_end = loss_bounds(b, s, True)[1]
        if pitch_ends:
            hi_end = max(hi_end, loss_bounds(pitch, s, True)[1])
        low = hi < share * best and hi_end < end_share * best
        if low and best - max(hi, hi_end) > cfg.margin:
            return True
    return False


@kernel
def estimate_loss(blocks, s):
    """(theta, D): estimate in [-1, 0] of a loss of surface s, where the block knows it best, and one over its
    variance.
    """
    th, D = 0.0, 0.0
    for b in blocks:
        for h in b.hypothesis[: b.n_h]:
            if h.kind == LOSS and h.surface == s and h.D > D:
                th, D = h.th, h.D
    return th, D


@kernel
def prepare_tests(cfg, noise, rows, blocks, gust, bound, model, meas, u, dt):
    """Prepare the next frame: gust, rows, and drift of the blocks at this instant.

    u (n,): positions of healthy surfaces.
    """
    if gust.output.gusty:
        gusts.fill_gust_effect(gust, model, meas.x, meas.y, u)
    begin_rows(cfg.w, noise, rows, bound, model, meas, u)
    fill_drift(noise, rows.eta[0], blocks, gust, meas.y[AIRSPEED], dt)
    if bound.error_map.n_boxes > 0:
        update_eta_rate(noise, blocks, bound.error_map, u)
    if gust.output.gusty:
        gusts.begin_gust_sums(gust, meas.y[AIRSPEED], cfg.w * dt)


@kernel
def update_eta_rate(noise, blocks, emap, u):
    """The share of its bound by which a mapped uncertainty can change in the next frame.

    eta_rate = min(rate0 + moved BOUNDS_PER_TRAVEL, MAX_ETA_RATE),   moved = max_s |u_s - u_old_s| / travel_s
    """
    moved = 0.0
    for s in range(u.size):
        width = max(emap.stop_hi[s] - emap.stop_lo[s], MIN_TRAVEL_RAD)
        moved = max(moved, abs(u[s] - emap.u_old[s]) / width)
        emap.u_old[s] = u[s]
    for b in blocks:
        b.eta_rate = min(noise.rate0 + BOUNDS_PER_TRAVEL * moved, MAX_ETA_RATE)


@kernel
def add_test_instant(cfg, noise, rows, gust, bound, model, meas, u, dt):
    """Add an instant inside a frame, dt s after the instant before, to gust and rows."""
    if gust.output.gusty:
        gusts.update_gust(gust, model, meas.x, meas.y, u, meas.attitude, dt)
    add_constants(cfg.w, noise, rows, bound.declared_errors, model, meas, u)


@kernel
def fill_drift(noise, eta, blocks, gust, V, dt):
    """Fill of each block the drift's intensity Q_d and decay a; of the filter without gust the noise, too.

    Q_d = Q_scale q_gust + q max(eta, MIN_ETA)^2,  (rad/s2)2/s      a = exp(-dt V / length)
    """
    for k, b in enumerate(blocks):
        reverts, length = k == likelihood.REVERTING_BLOCK, b.drift_correlation_length_m
        for i, axis in enumerate(b.axes[: b.n]):
            for j in range(b.n):
                gusty = gust.output.gusty
                q_gust = gusts.unmeasured_drift(gust, V, axis, b.axes[j], reverts) if gusty else 0.0
                b.Q_d[i, j] = b.Q_scale * q_gust
            q_eta = noise.q * max(eta[axis], likelihood.MIN_ETA_RAD_S2) ** 2
            b.Q_d[i, i] += q_eta
            b.calm.Q_d[i, i] = q_eta
            b.calm.Q_x[i] = noise.Q[axis]
        b.a = np.exp(-dt * V / length) if length > 0.0 else 1.0
