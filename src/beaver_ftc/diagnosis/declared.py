"""What a scenario declares, as standard deviations, for detectors that are designed with them."""

from math import pi, radians, sqrt

import numpy as np

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.design.context import SIGNALS, Declared, DesignModel
from beaver_ftc.diagnosis.admitted import GUST_FT_S, ROLLING, SCALE_FT, tolerances
from beaver_ftc.scenario.actuators import Actuators
from beaver_ftc.scenario.diagnosis import Bounds

_M_PER_FT = 0.3048
_AIR_DATA = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure


def gusts(turbulence: str, airspeed_mps: float, span_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviation (3,) rad/s and correlation time (3,) s of the air's rotation [Yeager1998].

    Rolling: a first-order process of its own (eq. 8 to 10). Pitching and yawing: the slope of the vertical
    and the lateral gusts along the flight path, s / V / (1 + tau s) of each; through Dryden's spectrum the
    variance is sigma^2 / 2 L^2 (3 / (k (1 + k)) - 1 / (1 + k)^2) with k = tau V / L. Above 2000 ft.
    """
    sigma, L, b = GUST_FT_S[turbulence] * _M_PER_FT, SCALE_FT * _M_PER_FT, span_m
    length = np.array([sqrt(L * b) / 2.6, 4.0 * b / pi, 3.0 * b / pi])  # of each gust, m
    k = length / L
    rotation = sigma / L * np.sqrt(1.5 / (k * (1.0 + k)) - 0.5 / (1.0 + k) ** 2)
    rotation[0] = ROLLING * sigma / sqrt(L * b)
    return rotation, length / airspeed_mps


def declared_of(
    bounds: Bounds,
    actuators: Actuators,
    design: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    aircraft: Aircraft | None = None,
) -> Declared:
    """What is declared, of a flight trimmed at y and u rad; design: the designer's record, (1,)."""
    aircraft = aircraft or load()
    sensors = [getattr(bounds.sensors, name) for name in SIGNALS]
    noise, bias, resolution = np.array([sensor.noise_bias_quantum for sensor in sensors]).T
    coefficients = tolerances(bounds.coefficients, aircraft, design["moments"]["value"][0])
    rotation, time_s = gusts(bounds.turbulence, float(y[2]), aircraft.geometry.span_m)
    air_data = np.sqrt(noise**2 + bias**2 + resolution**2 / 12.0)[_AIR_DATA:]
    deflection_rad = radians(bounds.deflection_deg)
    return Declared(
        noise=noise,
        bias=np.abs(bias),
        resolution=resolution,
        slope=np.abs([sensor.scale_error for sensor in sensors]),
        gust_rad_s=rotation,
        gust_time_s=time_s,
        gust_effect=gust_effect(DesignModel(design.copy()), y),
        coefficients=coefficients,
        inertia=bounds.inertia,
        deflection_rad=deflection_rad,
        model_rad_s2=model_error(design, y, u, air_data, coefficients, deflection_rad),
        bandwidth_rad_s=np.array([getattr(actuators, s).bandwidth_rad_s for s in aircraft.surfaces]),
        rate_limit_rad_s=np.radians([getattr(actuators, s).rate_limit_deg_s for s in aircraft.surfaces]),
    )


def gust_effect(model: DesignModel, y: np.ndarray) -> np.ndarray:
    """Angular acceleration of an aircraft at rest in air that rotates, (3, 3) 1/s: -df/dx without rates."""
    step = 1e-4
    columns = [(model.f(step * e, y) - model.f(-step * e, y)) / (2.0 * step) for e in np.eye(3)]
    return -np.column_stack(columns)


def model_error(
    design: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    air_data: np.ndarray,
    coefficients: np.ndarray,
    deflection_rad: float,
) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of f + G u at y and u, every error standing for itself.

    air_data (4,): errors of alpha, beta, airspeed, dynamic pressure. coefficients: absolute errors.
    """
    here = _acceleration(design, y, u)
    errors = np.pad(np.diag(air_data), ((0, 0), (0, y.size - air_data.size)))
    apart = [_acceleration(design, y + error, u) - here for error in errors]
    apart += [_acceleration(design, y, u + deflection_rad * e) - here for e in np.eye(u.size)]
    for place in np.flatnonzero(coefficients):
        changed = design.copy()
        changed["moments"]["value"][0][place] += coefficients[place]
        apart.append(_acceleration(changed, y, u) - here)
    return np.sqrt(np.square(apart).sum(axis=0))


def _acceleration(design: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    model = DesignModel(design)
    return model.f(np.zeros(3), y) + model.G(y) @ u
