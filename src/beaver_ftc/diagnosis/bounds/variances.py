"""What a scenario declares, as variances: for plug-ins, for the statistical detector's filters and tests."""

from math import hypot, pi

import numpy as np

from beaver_ftc.aircraft import AXES, MassProperties, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.aircraft.schema import RATE_SIGNALS
from beaver_ftc.design.context import DeclaredErrors, DesignFunctions
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.design.terms import AIRSPEED, PH, QH, RH
from beaver_ftc.design.variants import coefficient_slopes, jacobian
from beaver_ftc.diagnosis.bounds.admitted import inertia_slack
from beaver_ftc.scenario.airframe import Actuators
from beaver_ftc.scenario.declared import Declared, SensorErrors

_GYRO_OF = dict(zip(RATE_SIGNALS, AXES, strict=True))
_AIR_DATA = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure


def variances_of(
    declared: Declared, actuators: Actuators, design: np.ndarray, y: np.ndarray, u: np.ndarray
) -> DeclaredErrors:
    """What is declared as a plug-in is given it, of a flight trimmed at y and u rad; design: the designer's
    record, (1,)."""
    aircraft, errors = declared.aircraft, declared.sensors
    noise, bias, resolution = (errors.each(of_it) for of_it in ("noise", "steady", "resolution"))
    coefficients = declared.coefficients.absolute(aircraft.moments, design["moments"]["value"][0])
    rotation, time_s = declared.air.rotation(float(y[2]), aircraft.geometry.span_m)
    air_data = np.sqrt(noise**2 + bias**2 + resolution**2 / 12.0)[_AIR_DATA:]
    deflection_rad = declared.actuators.deflection_rad
    return DeclaredErrors(
        noise=noise,
        bias=bias,
        resolution=resolution,
        slope=errors.each("slope"),
        gust_rad_s=rotation,
        gust_time_s=time_s,
        gust_effect=gust_effect(DesignFunctions(design.copy()), y),
        coefficients=coefficients,
        inertia=declared.inertia,
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


def flow_noise(errors: SensorErrors, airspeed_mps: float) -> np.ndarray:
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
    declared: Declared, design: np.void, mass: MassProperties, y: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Tolerance of each moment's term that covers every declared constant error but those of the air data
    (noise_model.py); y, u in trim."""
    aircraft, errors = declared.aircraft, declared.sensors
    size = np.abs(design["moments"]["value"][: len(aircraft.moments)])
    slack, nominal = inertia_slack(declared.inertia, mass), np.abs(inertia_coefficients(mass))
    of_own_axis = (2, 7, 11)  # what multiplies a moment there
    share = np.full(size.shape, max(slack[i] / nominal[i] for i in of_own_axis))
    share += [_measured_share(errors, term) for term in aircraft.moments]
    total = declared.coefficients.absolute(aircraft.moments, size) + share * size
    slopes = np.abs(coefficient_slopes(design, np.zeros(3), y, u))
    span, chord = aircraft.geometry.span_m, aircraft.geometry.chord_m
    for name, place, length in zip(AXES, (PH, QH, RH), (span / 2, chord, span / 2), strict=True):
        error = errors[name].steady * length / y[AIRSPEED]
        for k, term in enumerate(aircraft.moments):
            if term.is_constant:
                total[k] += error * slopes[axis_of(term), place]
    return total


def _measured_share(errors: SensorErrors, term: Term) -> float:
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
