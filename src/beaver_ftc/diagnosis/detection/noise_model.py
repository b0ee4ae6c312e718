"""The noise model and the configuration of the statistical detector, from what a scenario declares.

An error e of an air-data reading changes f + G u by e times its derivative with that reading, to first order.
The derivative depends on the flight condition and is evaluated in flight. A steady error is a constant times
a known regressor, like an error of a coefficient; noise is jitter. dpt is worked out from the engine's power,
airspeed and dynamic pressure, so it has their errors.
"""

from collections.abc import Iterator
from math import exp, hypot, sqrt
from statistics import NormalDist

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties
from beaver_ftc.compiled import kernel
from beaver_ftc.design.air import rotation_lengths
from beaver_ftc.design.model import (
    AIRSPEED,
    ALPHA,
    BETA,
    PH,
    QDYN,
    RH,
    directional,
    jacobian,
    slipstream_slopes,
    whole_sum,
)
from beaver_ftc.diagnosis.bounds import axis_of_term, coefficient_tolerances
from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.forces import configure_forces
from beaver_ftc.diagnosis.detection.likelihood import (
    ALPHA3,
    ENDING,
    GROWING,
    LATERAL,
    N_READINGS,
    N_SLOTS,
    STEP,
)
from beaver_ftc.diagnosis.detection.parity import (
    AXIS_VIEW,
    N_TONES,
    Direction,
    configure_tones,
    configure_views,
    views_of,
)
from beaver_ftc.diagnosis.gusts import (
    FORCE_ERROR_SHARE,
    UNMEASURED_SHARES,
    add_gust_jitter,
    configure_gusts,
    configure_speed_error,
)
from beaver_ftc.diagnosis.state import LOSS, SIDE_FORCE
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.diagnosis import FdiConfig, Statistical

PITCH_AXES, LATERAL_AXES = (1,), (0, 2)
_SENSORS = {"alpha": ALPHA, "beta": BETA, "V": AIRSPEED, "qdyn": QDYN}
_POWER = N_READINGS - 1  # of the engine, kW
_SLIPSTREAM = RH + 1  # the first of the declared signals
N_SIGNS = {LOSS: 1, GROWING: 1, ENDING: 1, STEP: 2, ALPHA3: 2}  # a loss has a sign, a step may go either way
# Rate kappa of the growing-loss hypothesis. It explains a third of a loss that grows ten times slower or
# faster; a constant loss explains the rest.
GROWTH_PER_S = 1.5

# Share of the alarm level reserved for noise in addition to an uncertainty at its bound (docs/theory.md,
# section 7).
CHANCE = 0.5
DAMAGE_DRIFT_RAD_S = (
    3.0  # 42 of 75 flights of a GTM not found before; 15: 23, 8: 36, 0.2 and less: 35 and fewer
)
LEAST_NOISE_RAD_S = 1e-9  # of a gyro: exact ones are still doubles, and a variance no difference of zeros
TrimState = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (3,) rad/s, y (5,) and u (4,) rad in trim
# (kind, surface, axis, raises alarms)
Hypothesis = tuple[int, int, int, int]


def blocks_of(aircraft: Aircraft) -> tuple[tuple[tuple[int, ...], tuple[Hypothesis, ...]], ...]:
    """Axes and hypotheses of each block: the losses of the surfaces that turn about its axes, and what they
    are held against. Roll and yaw are there twice: see statistical.py."""
    pitch = (*_losses(aircraft, PITCH_AXES), *_steps(PITCH_AXES), (ALPHA3, -1, 1, 0))
    lateral = (*_losses(aircraft, LATERAL_AXES), *_steps(LATERAL_AXES))
    pitch, lateral = ((*of_it, *_growing_and_ending(of_it)) for of_it in (pitch, lateral))
    return (PITCH_AXES, pitch), (LATERAL_AXES, lateral), (LATERAL_AXES, lateral)


def _losses(aircraft: Aircraft, axes: tuple[int, ...]) -> Iterator[Hypothesis]:
    for s, (surface, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True)):
        if surface in aircraft.class_of_losses and axis in axes:
            yield LOSS, s, axis, 1


def _growing_and_ending(members: tuple[Hypothesis, ...]) -> Iterator[Hypothesis]:
    losses = [(surface, axis) for kind, surface, axis, _ in members if kind == LOSS]
    return ((kind, surface, axis, 0) for surface, axis in losses for kind in (GROWING, ENDING))


def _steps(axes: tuple[int, ...]) -> Iterator[Hypothesis]:
    return ((STEP, -1, axis, 1) for axis in axes)


def tests_per_frame(aircraft: Aircraft, *views: Direction) -> int:
    """The number of one-sided tests that the detector makes in a frame, those of these views included."""
    kinds = [kind for _, members in blocks_of(aircraft) for kind, _, _, alarms in members if alarms]
    tones = 0
    for view in views:
        if view.column_of >= 0 and any(view.direction[SIDE_FORCE:]):
            kinds += [STEP, *(LOSS for _ in view.losses)]
            tones += N_TONES
        elif view.column_of == AXIS_VIEW and not view.inertial:
            tones += N_TONES
    return N_SLOTS * sum(N_SIGNS[kind] for kind in kinds) + tones


def alarm_level(false_alarms_per_h: float, rate_hz: float, tests: int) -> float:
    """The alarm level, standard deviations, for a rate of false alarms per hour with so many tests a frame.

    By the union bound the rate is at most `false_alarms_per_h`.
    """
    return -NormalDist().inv_cdf(false_alarms_per_h / (3600.0 * rate_hz * tests))


def naming_level(misnaming: float, rate_hz: float, aircraft: Aircraft) -> float:
    """Difference of log-likelihood ratios that noise exceeds in a second with this probability at most."""
    return 0.5 * NormalDist().inv_cdf(misnaming / (rate_hz * tests_per_frame(aircraft))) ** 2


def configure_statistics(
    fdi: np.void,
    config: FdiConfig,
    declared: Declared,
    design: np.void,
    mass: MassProperties,
    start: TrimState,
    rate_hz: float,
) -> None:
    """Fill the statistical part of a diagnosis record; start: x (3,), y and u (surfaces,) in trim."""
    statistical, given = fdi["statistical"], config.statistical
    statistical["alarm"]["detected_at_s"] = -1.0
    if given is None or not fdi["config"]["enabled"]:  # a plug-in diagnoses, or nothing does
        return
    tests, air, aircraft = statistical["tests"], statistical["air"], declared.aircraft
    errors, dt_s, instants = declared.sensors, 1.0 / rate_hz, int(fdi["config"]["instants"])
    airspeed_mps, pace = float(start[1][AIRSPEED]), uncertainty_pace(given, aircraft, dt_s)
    tests["enabled"], tests["share"] = 1, 1.0 / max(instants, 1)
    tests["mapped"] = aircraft.file.model_error_map is not None and not aircraft.loses_surfaces
    statistical["forces"]["known"] = forces = declared.uses_accelerometers
    air["output"]["uses_accelerometers"] = declared.follows_gusts_by_accelerometers
    configure_gusts(air, declared, mass)
    across = config.compares_across(instants)
    n_tests = tests_per_frame(aircraft, *(views_of(aircraft, forces) if across else ()))
    tests["alarm_level"] = alarm_level(given.false_alarms_per_h, rate_hz, n_tests)
    configure_speed_error(air, declared, float(tests["alarm_level"]), airspeed_mps)
    tests["naming_level"] = naming_level(given.misnaming, rate_hz, aircraft)
    tests["keep"] = exp(-1.0 / (rate_hz * config.forgetting_time_s))
    _set_up_blocks(statistical, errors, aircraft)
    _set_up_bounded(statistical, config, declared, pace, dt_s)
    statistical["noise"]["pace"] = given.uncertainty_rad_s * dt_s
    _set_up_noise(statistical, drift_frequency(given, aircraft), declared, design, start, dt_s)
    tolerance = coefficient_tolerances(declared, design, mass, *start[1:])
    _set_up_tolerances(statistical, aircraft, tolerance)
    configure_readings(statistical, errors, fdi["bound"]["declared_errors"])
    if across:
        chance = given.false_alarms_per_h / (3600.0 * rate_hz * n_tests)
        configure_tones(statistical["tone_config"], chance, airspeed_mps, pace * rate_hz, dt_s)
        if forces:
            along_y = jacobian(design, *start)[3]
            configure_forces(fdi, declared, start, along_y, dt_s)
            air["output"][
                "uses_accelerometers"
            ] = not declared.monitors_sensors  # the monitor may find them broken
            statistical["inertial_air"] = air
            statistical["inertial_air"]["output"]["moving"] *= air["output"]["uses_accelerometers"]
            statistical["inertial_air"]["memory"]["unmeasured_share"] = np.minimum(
                np.add(UNMEASURED_SHARES, FORCE_ERROR_SHARE), 1.0
            )
        configure_views(statistical, aircraft)
    last, pitch = statistical["block"][-1], statistical["block"][likelihood.PITCH_BLOCK]
    rolling = float(air["config"]["rolling_length"]) if air["output"]["moving"] else 0.0
    gusts_m = rotation_lengths(air["config"]["span"]) if air["config"]["coarse"] else [rolling]
    last["return_length"] = drift_return_length(statistical, airspeed_mps, rate_hz, float(min(gusts_m)))
    if air["output"]["moving"]:
        # the filters that assume no gust: they start as the others, with a drift in any direction
        for name in ("n", "keep", "noise", "P_xx", "P_dd"):
            statistical["block"]["no_gust_filter"][name] = statistical["block"][name]
        last["drift_scale"] = (rolling / last["return_length"]) ** 2
        if not air["output"]["measures_gust"]:
            pitching = float(rotation_lengths(air["config"]["span"])[1])
            pitch["return_length"] = drift_return_length(statistical, airspeed_mps, rate_hz, pitching)
            pitch["drift_scale"] = (pitching / pitch["return_length"]) ** 2
        add_gust_jitter(statistical, errors, design, *start[1:], dt_s)


def _set_up_blocks(statistical: np.void, errors: SensorErrors, aircraft: Aircraft) -> None:
    blocks = blocks_of(aircraft)
    losses = [aircraft.surfaces.index(surface) for surface in aircraft.class_of_losses]
    statistical["tests"]["n_log_columns"] = len(losses) + len(AXES)
    for block, (axes, members) in zip(statistical["block"], blocks, strict=True):
        block["n"], block["n_hypotheses"] = len(axes), len(members)
        block["n_regressors"] = sum(axis_of_term(term) in axes for term in aircraft.moments)
        block["keep"], block["drift_scale"] = 1.0, 1.0
        for i, axis in enumerate(axes):
            block["axis"][i] = axis
            variance = max(errors[AXES[axis]].random, LEAST_NOISE_RAD_S) ** 2
            block["noise"][i] = block["P_xx"][i, i] = variance
            block["P_dd"][i, i] = likelihood.PRIOR_DRIFT_RAD_S2**2
        likelihood.set_supporting_signs(block, [kind for kind, *_ in members])
        for hypothesis, (kind, surface, axis, alarms) in zip(block["hypothesis"], members, strict=False):
            hypothesis["kind"], hypothesis["surface"] = kind, surface
            hypothesis["axis"], hypothesis["raises_alarm"] = axis, alarms
            hypothesis["log_column"] = losses.index(surface) if kind == LOSS else len(losses) + axis


def uncertainty_pace(given: Statistical, aircraft: Aircraft, dt_s: float) -> float:
    """Largest change of a bounded uncertainty within a frame, over its bound.

    The error of an aircraft's own terms changes with its surfaces, which a law may move fully within a frame:
    from one end of the bound to the other. If the error is mapped, its pace is worked out in flight
    (`statistical.update_pace`).
    """
    return 2.0 if any(aircraft.model_error_rad_s2) else given.uncertainty_rad_s * dt_s


def drift_frequency(given: Statistical, aircraft: Aircraft) -> float:
    """Frequency, rad/s, of the bounded uncertainty that the drift of the filters represents.

    The evidence that the uncertainty explains is bounded by its declared pace in any case
    (`likelihood.uncertainty_part`). The drift only sets how much of it the filters remove. If damage may take
    surfaces, a weaker drift detects most: motion that no loss explains is then rarely an error of the model.
    """
    return (
        min(DAMAGE_DRIFT_RAD_S, given.uncertainty_rad_s)
        if aircraft.loses_surfaces
        else given.uncertainty_rad_s
    )


def _set_up_bounded(
    statistical: np.void, config: FdiConfig, declared: Declared, pace: float, dt_s: float
) -> None:
    """Fill level, noise share and pace of the bounded uncertainty. A loss declared constant does not grow."""
    still = declared.is_noise_free
    for block in statistical["block"]:
        block["level"], block["noise_share"] = statistical["tests"]["alarm_level"], 0.0 if still else CHANCE
        block["pace"] = pace
        kinds = block["hypothesis"]["kind"][: block["n_hypotheses"]]
        if config.fault_profile == "abrupt":
            block["n_hypotheses"] = np.sum((kinds != GROWING) & (kinds != ENDING))
        block["hypothesis"]["growth_decay"] = exp(-GROWTH_PER_S * dt_s)


def _set_up_noise(
    statistical: np.void, omega: float, declared: Declared, design: np.void, start: TrimState, dt_s: float
) -> None:
    """Fill the drift, for an uncertainty of frequency omega, rad/s, and the jitter by noise of f + G u."""
    errors = declared.sensors.each("random")
    noise = float(errors[:3].max())
    largest = max(declared.constant_rad_s2)
    level = float(statistical["tests"]["alarm_level"])
    statistical["noise"]["walk_intensity"] = walk_intensity(largest, omega, noise, level, dt_s)
    _, G, f_x, f_y = jacobian(design, *start)
    statistical["noise"]["own_jitter"] = f_x**2 @ errors[:3] ** 2
    in_trim = (
        f_y[:, [ALPHA, BETA, AIRSPEED, QDYN]] ** 2 @ errors[3:] ** 2
    )  # later as `add_reading_regressors` says
    statistical["noise"]["jitter"] = statistical["noise"]["own_jitter"] + in_trim
    statistical["noise"]["deflection"] = np.abs(G).sum(axis=1) * declared.actuators.deflection_rad


def walk_intensity(eta_bar: float, omega: float, noise: float, level: float, dt_s: float) -> float:
    """Intensity of the random walk that stands for a bounded uncertainty, over its bound squared, 1/s.

    An uncertainty of eta_bar sin(omega t) moves the test for a step by eta_bar omega sqrt(2 sqrt 2 / i w0),
    w0 = (i / n)^(1/4), for a walk of intensity i and gyro noise of density n = noise^2 dt (docs/theory.md).
    Almost without noise w0 is the frame rate. The evidence for a loss under a moving command grows together
    with the uncertainty while both have the same sign: by eta_bar sqrt(omega / i) times 1.204, the largest
    value of sin(z) / sqrt(z / 2), z half of omega t. Half the alarm level is left for it: noise alone then
    takes up no more than the other half. eta_bar rad/s2; omega, noise rad/s; level in standard deviations.
    """
    eta_bar = max(eta_bar, likelihood.LEAST_UNCERTAINTY_RAD_S2)
    swing = 8.0 * sqrt(2.0) * (eta_bar * omega / level) ** 2  # of i w0
    ramp = 4.0 * (1.204 * eta_bar / level) ** 2 * omega
    walk = (swing * (noise**2 * dt_s) ** 0.25) ** 0.8
    return max(hypot(walk, ramp), swing * dt_s) / eta_bar**2


def drift_return_length(statistical: np.void, airspeed_mps: float, rate_hz: float, gust_m: float) -> float:
    """Return length, m, of the drift in the second block of roll and yaw, or of pitch without gust estimate.

    gust_m: return length of the gust, m; 0 in still air. The drift returns as soon as a bounded uncertainty
    permits: over the longest window T an uncertainty that oscillates with the fault moves a test, for a drift
    of intensity i and lag tau, by eta_bar sqrt(T / 2 i) / tau; half the alarm level is left for this. The
    drift returns no later than the gust. A gust with a longer return length is represented by a stronger one,
    of equal power at low frequency and more power at high frequency.
    """
    if statistical["noise"]["walk_intensity"] == 0.0:
        return gust_m  # 0 in still air: nothing is declared that drifts, and the two views are one
    longest_s = 2 ** (N_SLOTS - 1) / rate_hz
    level = float(statistical["tests"]["alarm_level"])
    lag_s = sqrt(2.0 * longest_s / statistical["noise"]["walk_intensity"]) / level
    return min(airspeed_mps * lag_s, gust_m or np.inf)


def _set_up_tolerances(statistical: np.void, aircraft: Aircraft, tolerance: np.ndarray) -> None:
    """What is constant but unknown, as tolerances of coefficients: theirs, inertia, steady sensor errors."""
    axis = np.array([axis_of_term(term) for term in aircraft.moments])
    for block, axes in zip(statistical["block"], (PITCH_AXES, LATERAL_AXES, LATERAL_AXES), strict=True):
        of_it = tolerance[np.isin(axis, axes)]
        block["tolerance"][: of_it.size] = of_it
    statistical["tests"]["has_tolerances"] = bool(np.any(tolerance))


def configure_readings(statistical: np.void, errors: SensorErrors, declared_errors: np.void) -> None:
    """Add the readings of the air data to the regressors of the blocks."""
    steady, noise = np.zeros(N_READINGS), statistical["noise"]["reading"]
    for name, place in _SENSORS.items():
        steady[place], noise[place] = errors[name].steady, errors[name].random
    steady[_POWER] = declared_errors["engine_kw"]  # all of it: so many standard deviations are part of that
    noise[_POWER] = declared_errors["engine_kw"] / NOISE_LIMIT_SIGMA
    if not (steady.any() or noise.any()):
        return
    statistical["noise"]["read"] = statistical["tests"]["has_tolerances"] = 1
    for block in statistical["block"]:
        n = int(block["n_regressors"])
        block["n_regressors"], block["tolerance"][n : n + N_READINGS] = n + N_READINGS, steady


@kernel
def fill_reading_direction(table, declared_errors, y, which, direction):
    """Fill direction (N_SIGNALS,) with the change of a table's signals per unit of a reading."""
    direction[:] = 0.0
    if which < AIRSPEED:  # a vane
        direction[which] = 1.0
    if which == AIRSPEED:
        for k in range(PH, RH + 1):
            direction[k] = -table.signal[k] / y[AIRSPEED]
    if declared_errors.engine and which >= AIRSPEED:
        by_airspeed, by_pressure, per_kw = slipstream_slopes(y, declared_errors.thin_air_kw)
        of_power = by_pressure if which == QDYN else per_kw
        direction[_SLIPSTREAM] = by_airspeed if which == AIRSPEED else of_power


@kernel
def fill_reading_effect(design, y, u, which, slope, out):
    """Fill out (3,) rad/s2 with the change of the accelerations per unit of a reading.

    slope: the change of the monomials per unit of it.
    """
    table, force = design.moments, y[QDYN] * design.S
    for i in range(3):
        out[i] = whole_sum(table, i, slope, u)
        if which == QDYN:
            out[i] += whole_sum(table, i, table.power, u) / y[QDYN]
    L, M, N = force * design.b * out[0], force * design.c * out[1], force * design.b * out[2]
    out[0], out[1], out[2] = design.Pl * L + design.Pn * N, design.Qm * M, design.Rl * L + design.Rn * N


@kernel
def add_reading_regressors(share, noise, blocks, declared_errors, design, y, u):
    """Add this instant, a `share` of the frame, to the readings' regressors, rad/s2 per unit, and fill the
    jitter, rad2/s4, as it is now; `design.moments` is evaluated there."""
    table, out = design.moments, noise.moved
    noise.jitter[:] = noise.own_jitter
    for which in range(N_READINGS):
        fill_reading_direction(table, declared_errors, y, which, noise.direction)
        directional(table, table.signal, table.power, noise.direction, noise.slope)
        fill_reading_effect(design, y, u, which, noise.slope, out)
        for i in range(3):
            noise.jitter[i] += (out[i] * noise.reading[which]) ** 2
        pitch = blocks[likelihood.PITCH_BLOCK]
        pitch.regressor[pitch.n_regressors - N_READINGS + which, 0] += share * out[1]
        for block in blocks[LATERAL:]:
            j = block.n_regressors - N_READINGS + which
            block.regressor[j, 0] += share * out[0]
            block.regressor[j, 1] += share * out[2]
