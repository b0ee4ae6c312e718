"""The statistical detector as it follows from what a scenario declares: levels, and the order of its parts.

The noise model (rates.py) has the declared noise, for which the declared rate of false alarms holds. Blocks:
block_design.py; their drift: drift_design.py; forces: forces_design.py; views: parity_design.py.
"""

from math import exp
from statistics import NormalDist
from sys import float_info

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import fill
from beaver_ftc.design.plain_model import jacobian
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis.detection.attitude import configure_attitude
from beaver_ftc.diagnosis.detection.block_design import configure_blocks, hypotheses_by_block
from beaver_ftc.diagnosis.detection.blocks import LOSS, N_SLOTS, SIGN_OF_KIND, STEP_FAULT
from beaver_ftc.diagnosis.detection.drift_design import configure_lengths, configure_noise, eta_rate
from beaver_ftc.diagnosis.detection.forces_design import TrimState, configure_forces
from beaver_ftc.diagnosis.detection.parity_design import (
    ParityDirection,
    configure_parity_views,
    list_directions,
)
from beaver_ftc.diagnosis.detection.rates import configure_rows
from beaver_ftc.diagnosis.detection.rows import INERTIAL, VANED
from beaver_ftc.diagnosis.detection.tones import N_TONES, configure_tones
from beaver_ftc.diagnosis.gusts import MIN_UNMEASURED_SHARES
from beaver_ftc.diagnosis.gusts_design import add_gust_noise, configure_gust, configure_gust_speed
from beaver_ftc.diagnosis.tolerances import coefficient_bounds
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import Statistical

FORCE_ERROR_SHARE = 0.01  # of a gust's intensity, left unmeasured by an error of a tenth in the forces


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
        if d.by_force and d.source == VANED:
            kinds += [STEP_FAULT, *(LOSS for _ in d.tested_losses)]
            n_tones += N_TONES
        elif d.is_axis and d.source != INERTIAL:
            n_tones += N_TONES
    return N_SLOTS * sum(1 if SIGN_OF_KIND[kind] else 2 for kind in kinds) + n_tones


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

    The order of the calls counts: each may read what those before it have filled. Levels and gust come first,
    then rows, blocks, their drift, the forces and the views, the filters without gust and the attitude last.
    """
    stat = fdi["statistical"]
    settings = declared.fdi.statistical
    stat["alarm"]["detected_at_s"] = -1.0
    if settings is None or not fdi["config"]["enabled"]:  # no such detector, or no compiled scheme
        return
    gust = stat["gust"]
    y, u = trim[1:]
    V = float(y[AIRSPEED])
    dt_s = 1.0 / declared.rate_hz
    rate = eta_rate(settings, declared.aircraft, dt_s)
    stat["forces"]["in_use"] = declared.uses_accelerometers
    gust["output"]["uses_accelerometers"] = declared.follows_gusts_by_accelerometers
    directions = list_directions(declared.aircraft, declared.uses_accelerometers)
    views = list(directions) if declared.compares_across else []
    n_tests = count_tests(declared.aircraft, *views)
    _configure_levels(stat["test"], declared, settings, n_tests)
    level = float(stat["test"]["alarm_level"])
    margin = float(stat["test"]["margin"])
    configure_gust(gust, declared)
    configure_gust_speed(gust, declared, level, V)
    tol = coefficient_bounds(declared, model, y, u)
    configure_rows(stat, declared.sensors, tol, fdi["bound"]["declared_errors"])
    configure_blocks(stat, declared, rate, dt_s)
    configure_noise(stat, settings.uncertainty_rad_s, declared, model, trim, dt_s)
    configure_lengths(stat, V, declared.rate_hz)
    if views:
        false_alarm = settings.false_alarms_per_h / (3600.0 * declared.rate_hz * n_tests)
        configure_tones(stat["tone_test_config"], false_alarm, V, rate * declared.rate_hz, dt_s)
        if declared.uses_accelerometers:
            configure_forces(fdi, declared, trim, jacobian(model, *trim)[3], dt_s)
            _configure_view_gusts(stat, declared)
        configure_parity_views(stat, declared.aircraft)
    monitor = fdi["sensor_monitor"]["config"]
    if monitor["enabled"] and monitor["noisy"]:
        configure_attitude(stat["attitude"], monitor["D"], declared.sensors, margin, dt_s)
    if gust["output"]["gusty"]:
        # the filters that assume no gust start as the others, all with a random walk as drift
        for name in ("n", "a", "R_y", "P_xx", "P_dd"):
            stat["block"]["calm"][name] = stat["block"][name]
        add_gust_noise(stat, declared.sensors, model, y, u, dt_s)


def _configure_levels(cfg: np.void, declared: Declared, settings: Statistical, n_tests: int) -> None:
    """Fill the level of the alarm, the margin of isolation, and how evidence is forgotten and bounded.

    margin: the difference z_m^2 / 2 of log-likelihood ratios that noise exceeds in a second with probability
    `misnaming`; z_m: the quantile of its share in one test.
    """
    aircraft = declared.aircraft
    rate_hz = declared.rate_hz
    fill(
        cfg, enabled=1, w=1.0 / declared.substeps,
        alarm_level=derive_alarm_level(settings.false_alarms_per_h, rate_hz, n_tests),
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
