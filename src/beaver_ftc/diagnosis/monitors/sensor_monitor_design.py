"""The sensor monitor's record, as it follows from what a scenario declares."""

from math import exp
from typing import Any, cast

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.compiled import fill
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.design.turbulence import Dryden
from beaver_ftc.diagnosis.bounds_design import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.gusts_design import air_rotation_slopes
from beaver_ftc.diagnosis.monitors.flow_or_force import N_FROZEN_NEVER
from beaver_ftc.diagnosis.monitors.numbering import FILTER_POLES_PER_S, NO_SENSOR
from beaver_ftc.plant.instruments import ENGINE_SPEED, MANIFOLD, PHI, SENSORS
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import frames_apart

# Errors of a reading: field of `errors` -> name in the declaration
ERRORS = {"e_zero": "worst", "e_slope": "slope", "const": "steady"}
MAX_AIRSPEED_OVER_TRIM = 1.4  # largest airspeed of a flight, as a share of that in trim
# Rate at which the attitude corrects a replaced body rate, if noise or rounding of the attitude is declared
RATE_GAIN_PER_S = 3.0
# Number of readings in a row, each equal to the one before, that a sound sensor does not give: without
# rounding of its reading, and with a noise of more than a quarter of its resolution.
N_FROZEN_EXACT = 3
N_FROZEN_ROUNDED = 50


def configure_sensor_monitor(monitor: np.void, declared: Declared, design: np.void, y: np.ndarray) -> None:
    """Fill the monitor's record: y (4 + signals,), readings in trim; design: record of the design model.

    If no monitor is declared, only the output is filled: no alarm, no sensor isolated.
    """
    config = monitor["config"]
    fill(monitor["output"], isolated_sensor=NO_SENSOR, alarmed_at_s=-1.0, isolated_at_s=-1.0)
    config["enabled"] = declared.monitors_sensors
    if not declared.monitors_sensors:
        return
    initial = cast("Any", declared.initial)  # the aircraft names its keys
    air = declared.air
    engine = declared.aircraft.has_engine_instruments
    h = 1.0 / declared.rate_hz / declared.substeps
    gust_max, gust_change = bound_gusts(air, initial.airspeed_mps, h)
    fill(
        config, substeps=declared.substeps, has_engine=engine, h=h,
        decay=[exp(-lam * h) for lam in FILTER_POLES_PER_S],
        g=GRAVITY_MPS2 * (1.0 + initial.altitude_m / EARTH_RADIUS_M) ** -2,
    )  # fmt: skip
    config["D"] = air_rotation_slopes(DesignFunctions(np.array([design])), y)
    config["y_trim"][3:7] = y[:4]  # alpha, beta, airspeed, dynamic pressure: after the gyros in the readings
    fill(
        monitor["air"], gust_max=gust_max, gust_change=gust_change, low_m=air.low_m,
        wind_max=declared.vertical_wind_mps, max_airspeed_mps=MAX_AIRSPEED_OVER_TRIM * initial.airspeed_mps,
    )  # fmt: skip
    monitor["substep"] = declared.substeps - 1  # the first JSBSim frame ends a frame of the loop
    if engine:
        monitor["sample"]["y_pred"][[ENGINE_SPEED, MANIFOLD]] = (
            initial.engine_rpm,
            initial.manifold_pressure_inhg,
        )
    configure_errors(monitor, declared)


def configure_errors(monitor: np.void, declared: Declared) -> None:
    """Fill the declared errors of the readings, and the number of repeated samples from which each is frozen;
    a sample is a JSBSim frame, and a sensor may be read once in several. The attitude is noisy if an error of
    it changes: worst > steady."""
    config = monitor["config"]
    errors = monitor["errors"]
    sensors = declared.sensors
    h = float(config["h"])
    fill(errors, **{name: sensors.each(kind, SENSORS) for name, kind in ERRORS.items()})
    drifts = [getattr(getattr(sensors.declared, name), "drift_rad_s", 0.0) for name in SENSORS]
    errors["drift"] = max(map(abs, drifts))
    for i, name in enumerate(SENSORS):
        error = sensors[name]
        config["n_frozen"][i] = n_frozen(error.noise, error.resolution) * frames_apart(i, h)
    noisy = np.any((errors["e_zero"] > errors["const"])[PHI : PHI + 3])
    fill(config, noisy=noisy, rate_gain=min(1.0, h * RATE_GAIN_PER_S) if noisy else 1.0)


def n_frozen(noise: float, resolution: float) -> int:
    """Number of repeated readings that a sound sensor of this noise and resolution does not give."""
    if resolution == 0.0:
        return N_FROZEN_EXACT
    return N_FROZEN_ROUNDED if noise > resolution / 4.0 else N_FROZEN_NEVER


def bound_gusts(air: Dryden, V: float, h: float) -> tuple[float, np.ndarray]:
    """Bounds on the speed of gusts, m/s, and on their changes through each filter (poles,), m/s:

        6 sigma,    6 sqrt(Q h / (1 - exp(-2 lam h)))        6: GUST_LIMIT_SIGMA

    The speed of a gust is a random walk of intensity Q = 3 sigma^2 V_m / L, m2/s3 (`Dryden.velocity_walk`),
    with V_m = MAX_AIRSPEED_OVER_TRIM V; a filter with a pole of lam 1/s keeps T = h / (1 - exp(-2 lam h)) of
    it. V m/s: airspeed in trim; h s: time between two samples.
    """
    Q = air.velocity_walk(V, MAX_AIRSPEED_OVER_TRIM)
    T = [h / (1.0 - exp(-2.0 * lam * h)) for lam in FILTER_POLES_PER_S]
    return GUST_LIMIT_SIGMA * air.sigma_mps, GUST_LIMIT_SIGMA * np.sqrt(Q * np.array(T))
