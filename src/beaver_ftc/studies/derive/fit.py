"""A sparse table of terms for the moments: orthogonal matching pursuit on what may be multiplied.

The coefficients follow from the sampled accelerations and the inertia by Euler's equations; each is then
fitted alone. A term is taken for what it explains of the residual, all taken so far are fitted again, and it
ends when another would explain next to nothing.
"""

from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import lstsq

from beaver_ftc.aircraft import Aircraft, MassProperties
from beaver_ftc.studies.derive.sample import Samples

MOST_TERMS = 26
LEAST_GAIN = 2e-5  # of the variance, for another term to be taken
_FREE: tuple[dict[str, int], ...] = (
    {}, {"alpha": 1}, {"alpha": 2}, {"alpha": 3}, {"beta": 1}, {"beta": 2}, {"beta": 3},
    {"alpha": 1, "beta": 1}, {"alpha": 2, "beta": 1}, {"alpha": 1, "beta": 2},
    *({rate: 1} for rate in ("ph", "qh", "rh")),
    *({"alpha": power, rate: 1} for power, rate in product((1, 2), ("ph", "qh", "rh"))),
)  # fmt: skip
_WITH_SURFACE: tuple[dict[str, int], ...] = ({}, {"alpha": 1}, {"alpha": 2}, {"beta": 2})
_OF_DECLARED: tuple[dict[str, int], ...] = ({}, {"alpha": 1}, {"beta": 1}, {"qh": 1}, {"rh": 1})
Term = dict[str, Any]


def moment_coefficients(samples: Samples, mass: MassProperties, aircraft: Aircraft) -> np.ndarray:
    """Cl, Cm, Cn of each sample, (n, 3)."""
    Ix, Iy, Iz, Jxz = mass.Ix_kg_m2, mass.Iy_kg_m2, mass.Iz_kg_m2, mass.Jxz_kg_m2
    inertia = np.array([[Ix, 0.0, -Jxz], [0.0, Iy, 0.0], [-Jxz, 0.0, Iz]])
    moments = samples.rate @ inertia + np.cross(samples.x, samples.x @ inertia)
    geometry = aircraft.geometry
    arms = np.array([geometry.span_m, geometry.chord_m, geometry.span_m])
    return moments / (samples.y[:, 3:4] * geometry.wing_area_m2 * arms)


def candidates(aircraft: Aircraft) -> list[tuple[dict[str, int], str | None]]:
    """What a term may multiply: powers of signals, and a surface or none."""
    free, with_surface = list(_FREE), list(_WITH_SURFACE)
    for signal in aircraft.signals:
        free += [{**of, signal: 1} for of in _OF_DECLARED] + [{signal: 2}]
        with_surface += [{signal: 1}, {signal: 2}]
    return [(of, None) for of in free] + [(of, s) for s in aircraft.surfaces for of in with_surface]


def regressors(samples: Samples, aircraft: Aircraft) -> np.ndarray:
    """What each candidate multiplies, (n, candidates)."""
    geometry, V = aircraft.geometry, samples.y[:, 2]
    of = {
        "alpha": samples.y[:, 0], "beta": samples.y[:, 1],
        "ph": samples.x[:, 0] * geometry.span_m / (2 * V), "qh": samples.x[:, 1] * geometry.chord_m / V,
        "rh": samples.x[:, 2] * geometry.span_m / (2 * V),
    }  # fmt: skip
    of |= dict(zip(aircraft.signals, samples.y[:, 4:].T, strict=True))
    deflection = dict(zip(aircraft.surfaces, samples.u.T, strict=True))
    columns = []
    for powers, surface in candidates(aircraft):
        column = np.ones(len(V)) if surface is None else deflection[surface]
        for signal, power in powers.items():
            column = column * of[signal] ** power
        columns.append(column)
    return np.column_stack(columns)


def pursue(A: np.ndarray, b: np.ndarray) -> tuple[list[int], np.ndarray]:
    """The columns of A taken, and their coefficients."""
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0.0] = np.inf  # what is zero everywhere explains nothing
    taken: list[int] = []
    total, residual = float(np.sum((b - b.mean()) ** 2)) or 1.0, b
    coefficients = np.empty(0)
    while len(taken) < MOST_TERMS:
        gain = np.abs(A.T @ residual) / scale
        gain[taken] = -1.0
        best = int(np.argmax(gain))
        solved = lstsq(A[:, [*taken, best]], b)[0]
        left = b - A[:, [*taken, best]] @ solved
        if (residual @ residual - left @ left) / total < LEAST_GAIN:
            break
        taken, coefficients, residual = [*taken, best], solved, left
    return taken, coefficients


def fitted(samples: Samples, aircraft: Aircraft) -> dict[str, list[Term]]:
    """The terms of Cl, Cm and Cn, as an aircraft file has them."""
    A, known = regressors(samples, aircraft), candidates(aircraft)
    C = moment_coefficients(samples, aircraft.mass, aircraft)
    terms: dict[str, list[Term]] = {}
    for axis, name in enumerate(("Cl", "Cm", "Cn")):
        taken, values = pursue(A, C[:, axis])
        of_it = sorted(zip(taken, values, strict=True))
        terms[name] = [_term(name, *known[k], float(value)) for k, value in of_it]
    return terms


def _term(coefficient: str, of: dict[str, int], surface: str | None, value: float) -> Term:
    parts = [*([surface] if surface else []), *(f"{s}{p if p > 1 else ''}" for s, p in of.items())]
    term: Term = {"name": f"{coefficient}_{'_'.join(parts) or '0'}", "value": float(f"{value:.6g}"), "of": of}
    return term | ({"surface": surface} if surface else {})
