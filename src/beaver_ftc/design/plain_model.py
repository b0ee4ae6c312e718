"""The design model without compiled code: its derivatives by complex steps, and its values at many states.

The functions of model.py and table.py also take complex numbers, and arrays of many states as components.

    x, y, u     rates (3, ...), rad/s; other signals (4 + declared, ...); surfaces (n,), rad
    f, G        acceleration at neutral surfaces (3, ...), rad/s2; that of each surface (3, n, ...), rad/s2
                per rad
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from beaver_ftc.aircraft.schema import MAX_MONOMIALS
from beaver_ftc.compiled import plain
from beaver_ftc.design.model import InertiaCoefficients, accelerate, add_coupling, unanticipated_pitch
from beaver_ftc.design.table import ALPHA, N_SIGNALS, free_sum, monomials, signals, surface_sums

_STEP = 1e-30  # of a complex step: far below rounding, so the derivative is exact to rounding


def anchor(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> None:
    """Fix the point at which a model is linearised or frozen: x (3,) rad/s, y, u rad in trim."""
    if not (design["linearised"] or design["frozen_alpha"]):
        return
    f, G, f_x, f_y = jacobian(design, x, y, u)
    if design["frozen_alpha"]:
        f_y[:, ALPHA] = 0.0
    design["x0"], design["y0"][: y.size] = x, y
    design["f0"], design["G0"], design["f_x"], design["f_y"][:, : y.size] = f, G, f_x, f_y


def jacobian(
    design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """f (3,), G (3, n) and the derivatives of f + G u with x (3, 3) and with y (3, y.size): complex steps."""
    steps = 1j * _STEP * np.eye(3 + y.size)  # a column is a direction
    f, G = _nonlinear_f_and_G(design, x[:, None] + steps[:3], y[:, None] + steps[3:])
    along = (f + np.einsum("isk,s->ik", G, u)).imag / _STEP
    return f[:, 0].real, G[:, :, 0].real, along[:, :3], along[:, 3:]


def _nonlinear_f_and_G(design: np.void, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nonlinear f (3, ...) and G (3, n, ...) by the evaluator's plain functions, which take complex
    numbers and any number of states at once: x (3, ...), y (4 + declared, ...)."""
    model, table = _fields(design), _fields(design["moments"])
    states = np.broadcast_shapes(x.shape[1:], y.shape[1:])
    signal = np.zeros((N_SIGNALS, *states), np.result_type(x, y))
    plain(signals)(table, x, y, signal)
    f, G = _coefficients(table, signal, model.G0.shape[1])
    plain(accelerate)(model, y, f[:, None])
    plain(accelerate)(model, y, G)
    plain(add_coupling)(model, x, f)
    return f, G


def _coefficients(table: Any, signal: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Cl, Cm, Cn at neutral surfaces, (3, ...), and their slopes per rad of n surfaces, (3, n, ...)."""
    states, kind = signal.shape[1:], signal.dtype
    power, per_rad = np.zeros((MAX_MONOMIALS, *states), kind), np.zeros((3, n, *states), kind)
    plain(monomials)(table, signal, power)
    plain(surface_sums)(table, power, per_rad)
    return np.array([plain(free_sum)(table, i, power) for i in range(3)]), per_rad


def _fields(fields: np.void) -> SimpleNamespace:
    """The fields of a record as attributes. Attributes of NumPy's own records are ten times as slow."""
    return SimpleNamespace(**{name: fields[name] for name in fields.dtype.names or ()})


def coefficient_slopes(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """d(Cl, Cm, Cn) / d signals, (3, N_SIGNALS), with the surfaces at u rad, by complex steps."""
    table, signal = _fields(design["moments"]), np.zeros(N_SIGNALS, complex)
    plain(signals)(table, x, y, signal)
    free, per_rad = _coefficients(table, signal[:, None] + 1j * _STEP * np.eye(N_SIGNALS), u.size)
    return (free + np.einsum("isk,s->ik", per_rad, u)).imag / _STEP


def inertial(inertia: InertiaCoefficients, x: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 without moments at rates x (n, 3) rad/s: the terms of the rate
    products [FDC]."""
    f = np.zeros((3, len(x)))
    plain(add_coupling)(inertia, x.T, f)
    return f.T


def unanticipated_at(design: np.void, y: np.ndarray, Cm_alpha3: np.ndarray) -> np.ndarray:
    """What `unanticipated_pitch` gives at each of y (n, 4 + declared) and Cm_alpha3 (n,): (n,) rad/s2."""
    pitch: np.ndarray = plain(unanticipated_pitch)(_fields(design), y.T, Cm_alpha3)
    return pitch


def effectiveness(design: np.void, y: np.ndarray) -> np.ndarray:
    """G (3, n) rad/s2 per rad at y (4 + declared,), without compiled code.

    A linearised model has the G of its trim at any y. If alpha is frozen, it is that of y all the same.
    """
    return design["G0"].copy() if design["linearised"] else _nonlinear_f_and_G(design, np.zeros(3), y)[1].real


def own_damping(design: np.void, y: np.ndarray) -> np.ndarray:
    """d f_i / d x_i (3,) 1/s at y and no rate, surfaces neutral: each rate's effect on its own axis.

    A linearised model has those of its trim at any y. If alpha is frozen, it is that of y all the same.
    """
    neutral = np.zeros(design["G0"].shape[1])
    f_x = design["f_x"] if design["linearised"] else jacobian(design, np.zeros(3), y, neutral)[2]
    return np.diag(f_x).copy()
