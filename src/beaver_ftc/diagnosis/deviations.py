"""The declared uncertainty as standard deviations and as tolerances of coefficients, for plug-ins and for the
statistical detector. Its worst case: bounds.py.
"""

from math import hypot, pi
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.aircraft import AXES, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.aircraft.schema import RATE_SIGNALS
from beaver_ftc.design.model import (
    DesignFunctions,
    acceleration_at,
    coefficient_slopes,
    inertia_coefficients,
    jacobian,
)
from beaver_ftc.design.table import AIRSPEED, PH, RH
from beaver_ftc.diagnosis.actuators import servo_data
from beaver_ftc.diagnosis.bounds import Y0, inertia_bounds
from beaver_ftc.scenario.declared import Declared, SensorErrors

if TYPE_CHECKING:
    from beaver_ftc.design.context import DeclaredErrors

_FURTHER_READINGS = ("phi", "theta", "psi", "ax", "ay", "az", "altitude")  # of a plug-in, after SIGNALS
_GYRO_OF = dict(zip(RATE_SIGNALS, AXES, strict=True))


def plugin_errors(declared: Declared, model: np.ndarray, y: np.ndarray, u: np.ndarray) -> "DeclaredErrors":
    """Return the declared errors for a plug-in, at the trim y and u rad; model: record of the design model,
    (1,).
    """
    from beaver_ftc.design.context import DeclaredErrors  # for plug-ins alone

    aircraft, errors = declared.aircraft, declared.sensors
    instruments = {
        f"{prefix}{name}": errors.each("steady" if name == "bias" else name, *readings)
        for prefix, readings in (("", ()), ("further_", (_FURTHER_READINGS,)))
        for name in ("noise", "bias", "resolution", "slope")
    }
    dC = declared.coefficients.absolute(aircraft.moments, model["moments"]["value"][0])
    gust, gust_s = declared.air.rotation(float(y[2]), aircraft.geometry.span_m)
    noise, bias, resolution = (errors.each(kind)[Y0:] for kind in ("noise", "steady", "resolution"))
    sigma = np.sqrt(noise**2 + bias**2 + resolution**2 / 12.0)
    return DeclaredErrors(
        **instruments,
        **servo_data(declared),
        gust_rad_s=gust,
        gust_time_s=gust_s,
        gust_effect=air_rotation_slopes(DesignFunctions(model.copy()), y),
        coefficients=dC,
        inertia=declared.inertia,
        deflection_rad=declared.deflection_rad,
        model_rad_s2=model_error_std(model, y, u, sigma, dC, declared.deflections_rad),
    )


def air_rotation_slopes(model: DesignFunctions, y: np.ndarray) -> np.ndarray:
    """Angular acceleration of an aircraft at rest in air that rotates, (3, 3) 1/s: -df/dx without rates."""
    steps = 1e-4 * np.eye(3)
    return -((model.f(steps, y) - model.f(-steps, y)) / 2e-4).T


def model_error_std(
    model: np.ndarray, y: np.ndarray, u: np.ndarray, sigma: np.ndarray, dC: np.ndarray, du: np.ndarray
) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of f + G u at y and u, all errors independent.

    sigma (4,): errors of alpha, beta, airspeed, dynamic pressure; dC (terms,): of the coefficients, absolute;
    du (surfaces,) rad: of the deflections.
    """
    off_y = np.pad(np.diag(sigma), ((1, u.size), (0, y.size - sigma.size)))
    off_u = np.pad(np.diag(du), ((1 + sigma.size, 0), (0, 0)))
    rest = np.zeros((len(off_y), 3))
    F = acceleration_at(model[0], rest, y + off_y, u + off_u)
    dF = [*(F[1:] - F[0])]
    for k in np.flatnonzero(dC):
        changed = model.copy()
        changed["moments"]["value"][0][k] += dC[k]
        dF.append(acceleration_at(changed[0], rest[:1], y[None], u[None])[0] - F[0])
    return np.sqrt(np.square(dF).sum(axis=0))


def flow_noise(errors: SensorErrors, V: float) -> np.ndarray:
    """Standard deviation (2,) rad of the noise of the flow's angles in level axes, computed from vanes,
    airspeed and attitude. An error of pitch attitude or heading turns the flow as much as an error of a
    vane."""
    angle = 0.3  # attitudes and incidences of up to 17 deg
    pairs = (("alpha", "theta"), ("beta", "psi"))
    sigma = [hypot(errors[vane].random, errors[attitude].random) for vane, attitude in pairs]
    return np.array(sigma) + angle * (errors["V"].random / V + errors["phi"].random)


def gust_noise(sigma: np.ndarray, model: np.void, y: np.ndarray, u: np.ndarray, b: float) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of the estimated effect of a gust, by the noise sigma (2,) rad of the
    flow's angles; b: span, m.
    """
    V = y[AIRSPEED]
    sq, sr = sigma * pi * V / (np.array([4.0, 3.0]) * b)
    # without rates all of it is aerodynamic
    F_x = jacobian(model, np.zeros(3), y, u)[2]
    return np.sqrt((F_x[:, 1] * sq) ** 2 + (F_x[:, 2] * sr) ** 2)


def moment_axis(term: Term) -> int:
    """The axis of the moment to which a term belongs."""
    return MOMENTS.index(term.coefficient)


def coefficient_bounds(declared: Declared, model: np.void, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Tolerance of each moment's term that covers every declared constant error but those of the air data
    (statistical_design.py); y, u in trim."""
    aircraft, errors = declared.aircraft, declared.sensors
    C = np.abs(model["moments"]["value"][: len(aircraft.moments)])
    own = [2, 7, 11]  # what multiplies a moment there
    by_inertia = inertia_bounds(declared.inertia, declared.mass)[own]
    by_inertia /= np.abs(inertia_coefficients(declared.mass))[own]
    relative = by_inertia.max() + [_signal_error(errors, term) for term in aircraft.moments]
    tol = declared.coefficients.absolute(aircraft.moments, C) + relative * C
    b, c = aircraft.geometry.span_m, aircraft.geometry.chord_m
    slopes = np.abs(coefficient_slopes(model, np.zeros(3), y, u))[:, PH : RH + 1]
    by_gyros = slopes @ (errors.each("steady", AXES) * (b / 2, c, b / 2) / y[AIRSPEED])
    tol += [by_gyros[moment_axis(term)] * term.is_constant for term in aircraft.moments]
    return tol


def _signal_error(errors: SensorErrors, term: Term) -> float:
    """Relative error of the signals that a term multiplies, by the slopes of gyros, vanes, airspeed and
    pressure."""
    own = AXES[moment_axis(term)]  # a slope of it is counted once for all terms of the axis
    e = errors[own].slope + errors["qdyn"].slope
    for name, n in term.of:
        gyro = _GYRO_OF.get(name)
        err = errors.get(gyro or name)
        e += n * errors["V"].slope if gyro else 0.0
        e += n * err.slope if err is not None and gyro != own else 0.0
    return e
