"""Design models that are wrong on purpose: what a designer may have simplified or mistaken.

    engine terms neglected, other coefficients, another mass or inertia     only other numbers in the record
    frozen alpha                f(x, y0) and G(y0) with alpha held at its trim value, all else as measured
    linearised about trim       f = f0 + f_x (x - x0) + f_y (y - y0), G = G0

The linear model is that of f + G u at (x0, y0, u0): the surfaces' moments vary with y too, so f_y holds
d(G u0)/dy, and f0 + G0 u0 is the acceleration in trim.
"""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft, MassProperties, load
from beaver_ftc.compiled import kernel, plain
from beaver_ftc.design import model as nonlinear
from beaver_ftc.design import terms
from beaver_ftc.design.model import ALPHA, QDYN, both_responses
from beaver_ftc.design.terms import MAX_MONOMIALS, N_SIGNALS

_STEP = 1e-30  # of a complex step: far below rounding, so the derivative is exact to rounding


def design_of(model: Any, aircraft: Aircraft | None = None) -> np.ndarray:
    """The design record (1,) of a scenario's `design_model`: what the designer leaves out or gets wrong.

    One that is tied to the trim wants `anchor` as well.
    """
    mass = mass_of(model, aircraft)
    design = nonlinear.design_record(
        aircraft, engine_terms=model.engine_terms, scale=model.coefficients, mass=mass
    )
    design["linearised"], design["frozen_alpha"] = model.linearised, model.frozen_alpha
    return design


def mass_of(model: Any, aircraft: Aircraft | None = None) -> MassProperties:
    """What a scenario's `design_model` takes for mass and inertia; a heavier aircraft of the same shape has
    its inertia in proportion."""
    nominal, inertia = (aircraft or load()).mass, {}
    for name in ("Ix", "Iy", "Iz", "Jxz"):
        own = getattr(nominal, f"{name}_kg_m2")
        inertia[f"{name}_kg_m2"] = own * model.mass * getattr(model.inertia, name)
    return replace(nominal, mass_kg=nominal.mass_kg * model.mass, **inertia)


def anchor(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> None:
    """Fix the point a model is linearised about or frozen at: x (3,) rad/s, y, u rad in trim."""
    if not (design["linearised"] or design["frozen_alpha"]):
        return
    f, G, f_x, f_y = jacobian(design, x, y, u)
    if design["frozen_alpha"]:
        f_y[:, ALPHA] = 0.0
    design["x0"], design["y0"][: y.size] = x, y
    design["f0"], design["G0"], design["f_x"], design["f_y"][:, : y.size] = f, G, f_x, f_y


class Anchored(NamedTuple):
    """How a design model is tied to a trim: linearised about it, or with its angle of attack frozen there.

    x0 (3,) rad/s, y0: the trim. f0 (3,) rad/s2, G0 (3, surfaces) rad/s2 per rad, f_x (3, 3), f_y: the model
    and its derivatives there; zero where it is not tied.
    """

    linearised: bool
    frozen_alpha: bool
    x0: np.ndarray
    y0: np.ndarray
    f0: np.ndarray
    G0: np.ndarray
    f_x: np.ndarray
    f_y: np.ndarray


def anchored(design: np.void) -> Anchored:
    """How this design model is tied to a trim; of a record of `design_dtype`."""
    arrays = {name: design[name].copy() for name in Anchored._fields[2:]}
    return Anchored(bool(design["linearised"]), bool(design["frozen_alpha"]), **arrays)


def jacobian(
    design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """f (3,), G (3, n) and the derivatives of f + G u with x (3, 3) and with y (3, y.size): complex steps."""
    steps = 1j * _STEP * np.eye(3 + y.size)  # a column is a direction
    f, G = _split(design, x[:, None] + steps[:3], y[:, None] + steps[3:])
    along = (f + np.einsum("isk,s->ik", G, u)).imag / _STEP
    return f[:, 0].real, G[:, :, 0].real, along[:, :3], along[:, 3:]


def _split(design: np.void, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nonlinear f (3, ...) and G (3, n, ...) by the evaluator's plain functions, which take complex
    numbers and any number of states at once: x (3, ...), y (4 + declared, ...)."""
    record, table = _fields(design), _fields(design["moments"])
    states = np.broadcast_shapes(x.shape[1:], y.shape[1:])
    f, G = np.zeros((3, *states), complex), np.zeros((*record.G0.shape, *states), complex)
    signal, power = np.zeros((N_SIGNALS, *states), complex), np.zeros((MAX_MONOMIALS, *states), complex)
    plain(terms.signals)(table, x, y, signal)
    plain(terms.monomials)(table, signal, power)
    arms = [y[QDYN] * record.S * length for length in (record.b, record.c, record.b)]
    moments = [arm * plain(terms.free_sum)(table, i, power) for i, arm in enumerate(arms)]
    plain(nonlinear.accelerations_of_moments)(record, x, *moments, f)
    plain(terms.surface_sums)(table, power, G)
    plain(nonlinear.accelerations_per_rad)(record, y, G)
    return f, G


def _fields(record: np.void) -> SimpleNamespace:
    """A record's fields as attributes; NumPy's own records take ten times as long to find one."""
    return SimpleNamespace(**{name: record[name] for name in record.dtype.names or ()})


def coefficient_slopes(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """d(Cl, Cm, Cn) / d signals, (3, N_SIGNALS), with the surfaces at u rad, by complex steps."""
    table = _fields(design["moments"])
    signal, power = np.zeros(N_SIGNALS, complex), np.zeros((MAX_MONOMIALS, N_SIGNALS), complex)
    plain(terms.signals)(table, x, y, signal)
    plain(terms.monomials)(table, signal[:, None] + 1j * _STEP * np.eye(N_SIGNALS), power)
    per_rad = np.zeros((3, u.size, N_SIGNALS), complex)
    plain(terms.surface_sums)(table, power, per_rad)
    free = np.array([plain(terms.free_sum)(table, i, power) for i in range(3)])
    return (free + np.einsum("isk,s->ik", per_rad, u)).imag / _STEP


def effectiveness(design: np.void, y: np.ndarray) -> np.ndarray:
    """G (3, 4) rad/s2 per rad at y (5,), without compiled code."""
    return design["G0"].copy() if design["linearised"] else _split(design, np.zeros(3), y)[1].real


def own_damping(design: np.void, y: np.ndarray) -> np.ndarray:
    """d f_i / d x_i (3,) 1/s at y and no rate, surfaces neutral: each rate's effect on its own axis."""
    if design["linearised"]:
        return np.diag(design["f_x"]).copy()
    f, _ = _split(design, 1j * _STEP * np.eye(3), y[:, None] + 0j)
    return np.diag(f).imag / _STEP


@kernel
def response(design, x, y, f, G):
    """Fill f (3,) rad/s2 and G (3, n) rad/s2 per rad with what the designer believes at x (3,) and y."""
    if design.linearised:
        linear_response(design, x, y, f, G)
    elif design.frozen_alpha:
        frozen = y.copy()
        frozen[ALPHA] = design.y0[ALPHA]
        both_responses(design, x, frozen, f, G)
    else:
        both_responses(design, x, y, f, G)


@kernel
def responses(design, x, y, f, G):
    """The same at each of x (n, 3), into f (n, 3); G is that of y."""
    for i in range(x.shape[0]):
        response(design, x[i], y, f[i], G)


@kernel
def linear_response(design, x, y, f, G):
    """Fill f and G with the linear model about (x0, y0)."""
    for i in range(3):
        f[i] = design.f0[i]
        for j in range(3):
            f[i] += design.f_x[i, j] * (x[j] - design.x0[j])
        for j in range(y.size):
            f[i] += design.f_y[i, j] * (y[j] - design.y0[j])
        for s in range(G.shape[1]):
            G[i, s] = design.G0[i, s]
