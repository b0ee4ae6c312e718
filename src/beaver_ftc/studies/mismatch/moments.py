"""Angular accelerations from the coefficient table, for many frames at once.

The same physics as `design.model`, by another road: each term is its table entry's value times the product of
its factors, turned into an acceleration by the inertia [FDC]. Nothing is summed that one may want apart.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from beaver_ftc.aircraft import Term
from beaver_ftc.design.coefficients import GEOMETRY, SURFACES, TERMS, InertiaCoefficients

MOMENTS = ("Cl", "Cm", "Cn")
MOMENT_TERMS: dict[str, Term] = {name: term for name, term in TERMS.items() if term.coefficient in MOMENTS}
ENGINE_TERMS = tuple(name for name, term in MOMENT_TERMS.items() if "dpt" in term.factors)
RATES = ("ph", "qh", "rh")


def quantities(x: np.ndarray, y: np.ndarray, u: np.ndarray) -> dict[str, np.ndarray]:
    """What the terms multiply, (n,) each, from x (n, 3) rad/s, y (n, 5), u (n, 4) rad."""
    alpha, beta, V, _, dpt = y.T
    b, c = GEOMETRY.span_m, GEOMETRY.chord_m
    rates = {"ph": x[:, 0] * b / (2 * V), "qh": x[:, 1] * c / V, "rh": x[:, 2] * b / (2 * V)}
    return {"alpha": alpha, "beta": beta, "dpt": dpt, **rates, **dict(zip(SURFACES, u.T, strict=True))}


def regressor(name: str, of: Mapping[str, np.ndarray]) -> np.ndarray:
    """What one term multiplies, (n,): the product of its factors."""
    product = np.ones_like(of["alpha"])
    for factor in TERMS[name].factors:
        product = product * of[factor]
    return product


def weights(inertia: InertiaCoefficients, coefficient: str, qdyn: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of a unit of Cl, Cm or Cn at dynamic pressure qdyn (n,) Pa."""
    per_axis = {
        "Cl": (inertia.Pl, 0.0, inertia.Rl),
        "Cm": (0.0, inertia.Qm, 0.0),
        "Cn": (inertia.Pn, 0.0, inertia.Rn),
    }[coefficient]
    length = GEOMETRY.chord_m if coefficient == "Cm" else GEOMETRY.span_m
    return np.outer(qdyn * GEOMETRY.wing_area_m2 * length, per_axis)


def term(name: str, value: float, inertia: InertiaCoefficients, of: Mapping, qdyn: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of one term with this coefficient."""
    return value * regressor(name, of)[:, None] * weights(inertia, MOMENT_TERMS[name].coefficient, qdyn)


def aerodynamic(
    coefficients: Mapping[str, float],
    inertia: InertiaCoefficients,
    of: Mapping[str, np.ndarray],
    qdyn: np.ndarray,
    names: Iterable[str] = MOMENT_TERMS,
) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of the moments, terms `names` of them."""
    return sum(
        (term(name, coefficients[name], inertia, of, qdyn) for name in names), np.zeros((qdyn.size, 3))
    )


def inertial(inertia: InertiaCoefficients, x: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of turning with no moment, from the rate products [FDC]."""
    p, q, r = x.T
    return np.column_stack(
        [
            inertia.Ppq * p * q + inertia.Pqr * q * r,
            inertia.Qpp * p * p + inertia.Qpr * p * r + inertia.Qrr * r * r,
            inertia.Rpq * p * q + inertia.Rqr * q * r,
        ]
    )
