"""The declared uncertainty for plug-ins, as standard deviations. Its worst case: bounds.py."""

from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.design.model import DesignFunctions, acceleration_at
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis.bounds import Y0
from beaver_ftc.diagnosis.gusts_design import air_rotation_slopes
from beaver_ftc.diagnosis.model_prediction import servo_data
from beaver_ftc.scenario.declared import Declared

if TYPE_CHECKING:
    from beaver_ftc.design.context import DeclaredErrors

_FURTHER_READINGS = ("phi", "theta", "psi", "ax", "ay", "az", "altitude")  # what plug-ins read beyond SIGNALS


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
