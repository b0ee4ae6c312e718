"""Design models that are wrong on purpose: what a designer may have simplified or mistaken.

    engine terms neglected, other coefficients, another mass or inertia     only other numbers in the record
    frozen alpha                f(x, y0) and G(y0) with alpha held at its trim value, all else as measured
    linearised about trim       f = f0 + f_x (x - x0) + f_y (y - y0), G = G0

The linear model is that of f + G u at (x0, y0, u0): the surfaces' moments vary with y too, so f_y holds
d(G u0)/dy, and f0 + G0 u0 is the acceleration in trim.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.coefficients import MASS, MassProperties
from beaver_ftc.design.model import ALPHA, control_effectiveness, design_record, free_response

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import DesignModel

_STEP = 1e-30  # of a complex step: far below rounding, so the derivative is exact to rounding


def design_of(model: "DesignModel") -> np.ndarray:
    """The design record (1,) of a scenario's `design_model`; one tied to the trim wants `anchor` as well."""
    design = design_record(engine_terms=model.engine_terms, scale=model.coefficients, mass=mass_of(model))
    design["linearised"], design["frozen_alpha"] = model.linearised, model.frozen_alpha
    return design


def mass_of(model: "DesignModel") -> MassProperties:
    """A heavier aircraft of the same shape has its inertia in proportion."""
    return replace(
        MASS,
        mass_kg=MASS.mass_kg * model.mass,
        Ix_kg_m2=MASS.Ix_kg_m2 * model.mass * model.inertia.Ix,
        Iy_kg_m2=MASS.Iy_kg_m2 * model.mass * model.inertia.Iy,
        Iz_kg_m2=MASS.Iz_kg_m2 * model.mass * model.inertia.Iz,
        Jxz_kg_m2=MASS.Jxz_kg_m2 * model.mass * model.inertia.Jxz,
    )


def anchor(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> None:
    """Fix the point a model is linearised about or frozen at: x (3,) rad/s, y (5,), u (4,) rad in trim."""
    if not (design["linearised"] or design["frozen_alpha"]):
        return
    f, G, f_x, f_y = jacobian(design, x, y, u)
    if design["frozen_alpha"]:
        f_y[:, ALPHA] = 0.0
    design["x0"], design["y0"] = x, y
    design["f0"], design["G0"], design["f_x"], design["f_y"] = f, G, f_x, f_y


def jacobian(
    design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """f (3,), G (3, 4) and the derivatives of f + G u with x (3, 3) and with y (3, 5), by complex steps."""
    f, G = _split(design, x.astype(complex), y.astype(complex))
    along_x = [_directional(design, x + 1j * _STEP * e, y + 0j, u) for e in np.eye(3)]
    along_y = [_directional(design, x + 0j, y + 1j * _STEP * e, u) for e in np.eye(5)]
    return f.real, G.real, np.column_stack(along_x), np.column_stack(along_y)


def _split(design: np.void, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nonlinear f and G, in their plain form, which takes complex numbers."""
    f, G = np.zeros(3, complex), np.zeros((3, 4), complex)
    record = np.asarray(design).view(np.recarray)
    free_response.py_func(record, x, y, f)
    control_effectiveness.py_func(record, y, G)
    return f, G


def _directional(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    f, G = _split(design, x, y)
    return (f + G @ u).imag / _STEP


@kernel
def response(design, x, y, f, G):
    """Fill f (3,) rad/s2 and G (3, 4) rad/s2 per rad with what the designer believes at x (3,) and y (5,)."""
    if design.linearised:
        linear_response(design, x, y, f, G)
    elif design.frozen_alpha:
        frozen = y.copy()
        frozen[ALPHA] = design.y0[ALPHA]
        free_response(design, x, frozen, f)
        control_effectiveness(design, frozen, G)
    else:
        free_response(design, x, y, f)
        control_effectiveness(design, y, G)


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
        for j in range(5):
            f[i] += design.f_y[i, j] * (y[j] - design.y0[j])
        for s in range(4):
            G[i, s] = design.G0[i, s]
