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
    InertiaCoefficients,
    acceleration_at,
    coefficient_slopes,
    inertia_coefficients,
    jacobian,
)
from beaver_ftc.design.table import AIRSPEED, PH, RH
from beaver_ftc.diagnosis.bounds import Y0, inertia_bounds
from beaver_ftc.diagnosis.model_prediction import servo_data
from beaver_ftc.scenario.declared import Declared, SensorErrors

if TYPE_CHECKING:
    from beaver_ftc.design.context import DeclaredErrors

_FURTHER_READINGS = ("phi", "theta", "psi", "ax", "ay", "az", "altitude")  # what plug-ins read beyond SIGNALS
LARGE_ANGLE_RAD = 0.3  # attitudes and incidences of up to 17 deg
_GYRO_OF = dict(zip(RATE_SIGNALS, AXES, strict=True))


def plugin_errors(declared: Declared, model: np.ndarray, y: np.ndarray, u: np.ndarray) -> "DeclaredErrors":
    """Return the declared errors for a plug-in, at the trim y (4 + signals,) and u (surfaces,) rad; model:
    record of the design model, (1,). For `model_rad_s2` alone, the variance of a reading is
    noise^2 + bias^2 + resolution^2 / 12.
    """
    from beaver_ftc.design.context import DeclaredErrors  # for plug-ins alone

    aircraft = declared.aircraft
    errors = declared.sensors
    instruments = {}
    for name in ("noise", "bias", "resolution", "slope"):
        kind = "steady" if name == "bias" else name
        instruments[name] = errors.each(kind)
        instruments[f"further_{name}"] = errors.each(kind, _FURTHER_READINGS)
    noise, bias, resolution = (instruments[name][Y0:] for name in ("noise", "bias", "resolution"))
    sigma = np.sqrt(noise**2 + bias**2 + resolution**2 / 12.0)  # a rounding error is uniform: variance 1/12
    dC = declared.coefficients.absolute(aircraft.moments, model["moments"]["value"][0])
    gust, gust_s = declared.air.rotation(float(y[AIRSPEED]), aircraft.geometry.span_m)
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
    """Angular acceleration of an aircraft at rest in air that rotates, (3, 3) 1/s: -df/dx without rates, by
    central differences with steps of 1e-4 rad/s."""
    steps = 1e-4 * np.eye(3)
    return -((model.f(steps, y) - model.f(-steps, y)) / 2e-4).T


def model_error_std(
    model: np.ndarray, y: np.ndarray, u: np.ndarray, sigma: np.ndarray, dC: np.ndarray, du: np.ndarray
) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of a = f + G u at rest (x = 0) and at y, u, all errors e independent:

        sqrt(sum over e of (a(e) - a(0))^2)

    sigma (4,): errors of alpha, beta, airspeed, dynamic pressure; dC (terms,): of the coefficients, absolute;
    du (surfaces,) rad: of the deflections.
    """

    def a(record: np.ndarray, reading: np.ndarray, deflection: np.ndarray) -> np.ndarray:
        """f + G u (3,) rad/s2 at rest, by the record of a model, (1,)."""
        return acceleration_at(record[0], np.zeros((1, 3)), reading[None], deflection[None])[0]

    a_e = [a(model, y + dy, u) for dy in np.diag(np.pad(sigma, (0, y.size - sigma.size)))]
    a_e += [a(model, y, u + du_s) for du_s in np.diag(du)]
    for k in np.flatnonzero(dC):
        changed = model.copy()
        changed["moments"]["value"][0][k] += dC[k]
        a_e.append(a(changed, y, u))
    return np.sqrt(np.square(a_e - a(model, y, u)).sum(axis=0))


def flow_noise(errors: SensorErrors, V: float) -> np.ndarray:
    """Standard deviation (2,) rad of the noise of the flow's angles in level axes, computed from vanes,
    airspeed and attitude:

        hypot(sigma_vane, sigma_attitude) + LARGE_ANGLE_RAD (sigma_V / V + sigma_phi)

    An error of pitch attitude or heading turns the flow as much as an error of a vane. V: airspeed, m/s.
    """
    pairs = (("alpha", "theta"), ("beta", "psi"))
    sigma = [hypot(errors[vane].random, errors[attitude].random) for vane, attitude in pairs]
    return np.array(sigma) + LARGE_ANGLE_RAD * (errors["V"].random / V + errors["phi"].random)


def gust_noise(sigma: np.ndarray, model: np.void, y: np.ndarray, u: np.ndarray, b: float) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of the estimated effect of a gust, by the noise sigma (2,) rad of the
    flow's angles:

        sqrt((F_q s_q)^2 + (F_r s_r)^2)      s_q = pi V sigma_alpha / (4 b)      s_r = pi V sigma_beta / (3 b)

    s: noise of the rotation of the air, rad/s (gusts.py); F (3,) 1/s: d(f + G u) / d rate; b: span, m; V:
    airspeed, m/s.
    """
    s_q, s_r = sigma * pi * y[AIRSPEED] / (np.array([4.0, 3.0]) * b)
    _, F_q, F_r = jacobian(model, np.zeros(3), y, u)[2].T  # without rates all of it is aerodynamic
    return np.sqrt((F_q * s_q) ** 2 + (F_r * s_r) ** 2)


def moment_axis(term: Term) -> int:
    """The axis (ROLL, PITCH or YAW) of the moment to which a term belongs."""
    return MOMENTS.index(term.coefficient)


def coefficient_bounds(declared: Declared, model: np.void, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Tolerance (terms,) of the coefficient of each term of the moments. It covers the constant errors of
    coefficients, inertia and gyros, and the slope errors of gyros and air data. The constant offsets of the
    air data have columns of their own (rows.py). y, u in trim:

        dC + (e_inertia + e_signals) |C| + [constant term] sum_j |d(Cl, Cm, Cn) / d(ph, qh, rh)_j| e_j

    C, dC: coefficients and their declared errors; e_inertia: largest relative error of the inertia
    coefficient that multiplies a moment about its own axis; e_signals: of `_signal_error`; e_j: error of
    ph = p b / 2V, qh = q c / V, rh = r b / 2V by the constant errors of the gyros, which acts as a constant
    moment.
    """
    aircraft = declared.aircraft
    errors = declared.sensors
    C = np.abs(model["moments"]["value"][: len(aircraft.moments)])
    dI = InertiaCoefficients(*inertia_bounds(declared.inertia, declared.mass))
    nominal = inertia_coefficients(declared.mass)
    e_inertia = max(dI.Pl / nominal.Pl, dI.Qm / nominal.Qm, dI.Rn / nominal.Rn)
    relative = e_inertia + np.array([_signal_error(errors, term) for term in aircraft.moments])
    tol = declared.coefficients.absolute(aircraft.moments, C) + relative * C
    b, c = aircraft.geometry.span_m, aircraft.geometry.chord_m
    slopes = np.abs(coefficient_slopes(model, np.zeros(3), y, u))[:, PH : RH + 1]
    by_gyros = slopes @ (errors.each("steady", AXES) * (b / 2, c, b / 2) / y[AIRSPEED])
    tol += [by_gyros[moment_axis(term)] * term.is_constant for term in aircraft.moments]
    return tol


def _signal_error(errors: SensorErrors, term: Term) -> float:
    """Relative error of the product of signals that multiplies a term's coefficient, by the slope errors:

        e = slope of the axis' gyro + slope of qdyn + sum_k n_k slope_k

    k: signals of the term, with the powers n_k. A normalised rate counts with its gyro and with the airspeed
    that divides it. The slope of the axis' gyro counts once for all terms of the axis, so not again as one of
    a signal.
    """
    axis = AXES[moment_axis(term)]
    e = errors[axis].slope + errors["qdyn"].slope
    for name, n in term.of:
        if name in _GYRO_OF:
            e += n * errors["V"].slope
        instrument = _GYRO_OF.get(name, name)
        if instrument in errors and instrument != axis:
            e += n * errors[instrument].slope
    return e
