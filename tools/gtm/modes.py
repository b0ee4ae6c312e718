"""Linear models of a steady flight, by JSBSim and by the specification, and their modes."""

from collections.abc import Callable
from math import cos, radians, sin

import numpy as np

from beaver_ftc_aircraft.gtm.steady import HEADING_DEG, Bench, Steady
from tools.gtm.flights import of_steady, state_of
from tools.gtm.specification import Specification


def linear(of: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """Jacobian (8, 8) of u, v, w, p, q, r, phi, theta by differences. of: returns the six accelerations."""

    def all_of(state: np.ndarray) -> np.ndarray:
        p, q, r, phi, theta = state[3:8]
        turn = q * sin(phi) + r * cos(phi)
        return np.array([*of(state), p + turn * np.tan(theta), q * cos(phi) - r * sin(phi)])

    steps = np.array([1e-3] * 3 + [1e-5] * 3 + [1e-6] * 2)
    columns = [(all_of(x + h) - all_of(x - h)) / (2.0 * h.sum()) for h in np.diag(steps)]
    return np.array(columns).T


def modes(matrix: np.ndarray) -> dict[str, tuple[float, float]]:
    """Frequency, rad/s, and damping of each oscillation of the longitudinal and of the lateral motion."""
    longitudinal, lateral = [0, 2, 4, 7], [1, 3, 5, 6]
    found: dict[str, tuple[float, float]] = {}
    for kind, states in (("longitudinal", longitudinal), ("lateral", lateral)):
        roots = np.linalg.eigvals(matrix[np.ix_(states, states)])
        swings = sorted(
            {(round(abs(z), 12), round(-z.real / abs(z), 12)) for z in roots if z.imag > 0}, reverse=True
        )
        names = ("short period", "phugoid") if kind == "longitudinal" else ("Dutch roll", "lateral phugoid")
        found |= dict(zip(names, swings, strict=False))
    return found


def linear_jsbsim(model: Bench, steady: Steady) -> np.ndarray:
    """The Jacobian of the converted model."""
    for name, number in steady.commands().items():
        model.fdm[name] = number

    def of(state: np.ndarray) -> np.ndarray:
        angles = state[6], state[7], radians(HEADING_DEG)
        model.place(800.0, state[:3], angles, state[3:6])
        return model.accelerations()

    return linear(of, state_of(steady)[:8])


def linear_specified(spec: Specification, steady: Steady) -> np.ndarray:
    """The Jacobian of the specification."""
    controls, whole = of_steady(steady), state_of(steady)
    return linear(lambda x: spec.rates_of_change(np.array([*x, *whole[8:]]), controls, 0)[:6], whole[:8])
