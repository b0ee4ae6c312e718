"""The tolerance of each coefficient of the moments, for the statistical detector: an unknown constant c_j of
its tests is at most so large.
"""

import numpy as np

from beaver_ftc.aircraft import AXES, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.aircraft.schema import RATE_SIGNALS
from beaver_ftc.design.model import InertiaCoefficients, inertia_coefficients
from beaver_ftc.design.plain_model import coefficient_slopes
from beaver_ftc.design.table import AIRSPEED, PH, RH
from beaver_ftc.diagnosis.bounds_design import inertia_bounds
from beaver_ftc.scenario.declared import Declared, SensorErrors

_GYRO_OF = dict(zip(RATE_SIGNALS, AXES, strict=True))


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
    b = aircraft.geometry.span_m
    c = aircraft.geometry.chord_m
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
