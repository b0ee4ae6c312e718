"""What a scenario declares, as variances: for plug-ins, for the statistical detector's filters and tests."""

from math import hypot, pi, radians, sqrt

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.aircraft.schema import RATE_SIGNALS
from beaver_ftc.design.context import Declared, DesignFunctions
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.design.terms import AIRSPEED, PH, QH, RH
from beaver_ftc.design.variants import coefficient_slopes, jacobian
from beaver_ftc.diagnosis.bounds.declared import (
    ROLLING,
    SCALE_M,
    Errors,
    gust_mps,
    inertia_slack,
    low_gust_mps,
    tolerances,
)
from beaver_ftc.scenario.actuators import Actuators
from beaver_ftc.scenario.diagnosis import Bounds

_GYRO_OF = dict(zip(RATE_SIGNALS, AXES, strict=True))
_AIR_DATA = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure


def length_of_gusts(span_m: float) -> np.ndarray:
    """Way flown within which the rolling, pitching and yawing gust returns, (3,) m [Yeager1998]."""
    return np.array([sqrt(SCALE_M * span_m) / 2.6, 4.0 * span_m / pi, 3.0 * span_m / pi])


def gusts(turbulence: str, airspeed_mps: float, span_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviation (3,) rad/s and correlation time (3,) s of the air's rotation [Yeager1998].

    Rolling: a first-order process of its own (eq. 8 to 10). Pitching and yawing: the slope of the vertical
    and the lateral gusts along the flight path, s / V / (1 + tau s) of each; through Dryden's spectrum the
    variance is sigma^2 / 2 L^2 (3 / (k (1 + k)) - 1 / (1 + k)^2) with k = tau V / L. Above 2000 ft.
    """
    sigma, L, b, length = gust_mps(turbulence), SCALE_M, span_m, length_of_gusts(span_m)
    k = length / L
    rotation = sigma / L * np.sqrt(1.5 / (k * (1.0 + k)) - 0.5 / (1.0 + k) ** 2)
    rotation[0] = ROLLING * sigma / sqrt(L * b)
    return rotation, length / airspeed_mps


def declared_of(
    bounds: Bounds, actuators: Actuators, design: np.ndarray, y: np.ndarray, u: np.ndarray, aircraft: Aircraft
) -> Declared:
    """What is declared, of a flight trimmed at y and u rad; design: the designer's record, (1,)."""
    errors = Errors(bounds.sensors)
    noise, bias, resolution = (errors.each(of_it) for of_it in ("noise", "steady", "resolution"))
    coefficients = tolerances(bounds.coefficients, aircraft, design["moments"]["value"][0])
    rotation, time_s = gusts(bounds.turbulence, float(y[2]), aircraft.geometry.span_m)
    air_data = np.sqrt(noise**2 + bias**2 + resolution**2 / 12.0)[_AIR_DATA:]
    deflection_rad = radians(bounds.deflection_deg)
    return Declared(
        noise=noise,
        bias=bias,
        resolution=resolution,
        slope=errors.each("slope"),
        gust_rad_s=rotation,
        gust_time_s=time_s,
        gust_effect=gust_effect(DesignFunctions(design.copy()), y),
        coefficients=coefficients,
        inertia=bounds.inertia,
        deflection_rad=deflection_rad,
        model_rad_s2=model_error(design, y, u, air_data, coefficients, deflection_rad),
        bandwidth_rad_s=np.array([getattr(actuators, s).bandwidth_rad_s for s in aircraft.surfaces]),
        rate_limit_rad_s=np.radians([getattr(actuators, s).rate_limit_deg_s for s in aircraft.surfaces]),
    )


def gust_effect(model: DesignFunctions, y: np.ndarray) -> np.ndarray:
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
    model = DesignFunctions(design)
    return model.f(np.zeros(3), y) + model.G(y) @ u


def drift(turbulence: str, span_m: float) -> np.ndarray:
    """Intensity of the random walk that each rotating gust is over times short beside its own, over V.

    (3,) rad2/s3 per m/s, for roll, pitch and yaw. The rolling gust is a first-order process with
    sigma = 1.9 sigma_w / sqrt(L b) and a lag of sqrt(L b) / 2.6 V [Yeager1998, eq. 8]: 2 sigma^2 / lag. The
    others are lagged slopes of a velocity of intensity 3 sigma_w^2 V / L [MIL-F-8785C, 3.7], over (V lag)^2.
    """
    return _drift(gust_mps(turbulence), SCALE_M, span_m)


def drift_at_1_m(turbulence: str, span_m: float) -> np.ndarray:
    """The same by the formulas for heights below 1000 ft, where the vertical gust's scale is the height, h in
    m: over h^1.5 the rolling one, over h the pitching one, and a bound on the yawing one.

    The lateral gust has sigma_v^2 / L_v = sigma_w^2 / h (0.177 + 0.000823 h / ft)^0.4, which is less.
    """
    return _drift(low_gust_mps(turbulence), 1.0, span_m)


def _drift(sigma_w: float, L: float, b: float) -> np.ndarray:
    rolling = 2.0 * 1.9**2 * 2.6 * sigma_w**2 / (L * b) ** 1.5
    velocity = 3.0 * sigma_w**2 / L
    return np.array([rolling, velocity * (pi / (4 * b)) ** 2, velocity * (pi / (3 * b)) ** 2])


def flow_noise(errors: Errors, airspeed_mps: float) -> np.ndarray:
    """Of the flow's angles (2,) against the level axes, as vanes, airspeed and attitude have them, standard
    deviation in rad: what pitch attitude and heading are off turns the flow as much as what a vane is off."""
    through = 0.3  # attitudes and incidences of up to 17 deg
    pairs = (("alpha", "theta"), ("beta", "psi"))
    vanes = [hypot(errors[vane].random, errors[angle].random) for vane, angle in pairs]
    return np.array(vanes) + through * (errors["V"].random / airspeed_mps + errors["phi"].random)


def jitter(flow: np.ndarray, design: np.void, y: np.ndarray, u: np.ndarray, span_m: float) -> np.ndarray:
    """Standard deviation, rad/s2 on each axis, of what noise of the flow's angles (2,) rad adds to a gust."""
    V, b = y[AIRSPEED], span_m
    pitching, yawing = flow * pi * V / (np.array([4.0, 3.0]) * b)
    damping = jacobian(design, np.zeros(3), y, u)[2]  # without rates all of it is aerodynamic
    return np.sqrt((damping[:, 1] * pitching) ** 2 + (damping[:, 2] * yawing) ** 2)


def axis_of(term: Term) -> int:
    """The axis of a moment's term."""
    return MOMENTS.index(term.coefficient)


def steady_tolerance(
    bounds: Bounds, aircraft: Aircraft, design: np.void, mass: MassProperties, y: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Tolerance of each moment's term that covers every declared constant error but those of the air data
    (noise_model.py); y, u in trim."""
    errors = Errors(bounds.sensors)
    size = np.abs(design["moments"]["value"][: len(aircraft.moments)])
    slack, nominal = inertia_slack(bounds.inertia, mass), np.abs(inertia_coefficients(mass))
    of_own_axis = (2, 7, 11)  # what multiplies a moment there
    share = np.full(size.shape, max(slack[i] / nominal[i] for i in of_own_axis))
    share += [_measured_share(errors, term) for term in aircraft.moments]
    total = tolerances(bounds.coefficients, aircraft, size) + share * size
    slopes = np.abs(coefficient_slopes(design, np.zeros(3), y, u))
    span, chord = aircraft.geometry.span_m, aircraft.geometry.chord_m
    for name, place, length in zip(AXES, (PH, QH, RH), (span / 2, chord, span / 2), strict=True):
        error = errors[name].steady * length / y[AIRSPEED]
        for k, term in enumerate(aircraft.moments):
            if term.is_constant:
                total[k] += error * slopes[axis_of(term), place]
    return total


def _measured_share(errors: Errors, term: Term) -> float:
    """Relative error of what a term multiplies, by the slopes of gyros, vanes, airspeed and pressure."""
    own = AXES[axis_of(term)]  # a gyro's slope is counted once for all terms of its own axis
    share = errors[own].slope + errors["qdyn"].slope
    for signal, power in term.of:
        if signal in _GYRO_OF:
            share += power * errors["V"].slope
        error = errors.get(_GYRO_OF.get(signal, signal))
        if error is not None and _GYRO_OF.get(signal) != own:
            share += power * error.slope
    return share
