"""Level flight of the design model: the elevator it takes, over dynamic pressure and flap.

    qdyn S CX = m g sin alpha,   qdyn S CZ + m g cos alpha = 0,   Cm = 0

in angle of attack, slipstream and elevator: wings level, no rates, no sideslip, the engine free. What the
elevator, or what is left of it, cannot give at a speed cannot be held there, whatever the law.
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.aircraft import Aircraft

GRAVITY_MPS2 = 9.80665
THRUST = "dpt"  # the signal that stands for the engine
STEP = 1e-30  # of a complex step
ITERATIONS, CLOSE = 12, 1e-9
STEEPEST_RAD, MOST_THRUST = 0.5, 3.0  # beyond, the polynomials have solutions that no aircraft flies
PER_FLAP, GUESS = -0.12, (0.1, 0.5, 0.0)  # alpha over flap, and alpha, slipstream, elevator without it


@lru_cache(maxsize=32)
def elevator_needed(
    aircraft: Aircraft,
    surfaces: tuple[str, str],
    mass_kg: float,
    scale: tuple[tuple[str, float], ...],
    qdyn_pa: tuple[float, ...],
    flap_rad: tuple[float, ...],
) -> np.ndarray:
    """Deflection (n, m) rad for level flight at qdyn (n,) and flap (m,); not a number where there is none.

    surfaces: elevator and flap of this aircraft. scale: what the designer multiplies single terms by.
    """
    q, flap = (values.ravel() for values in np.meshgrid(qdyn_pa, flap_rad, indexing="ij"))
    load = mass_kg * GRAVITY_MPS2 / (q * aircraft.geometry.wing_area_m2)
    neutral = {factor: 0.0 for term in aircraft.terms.values() for factor in term.factors}
    ratio = dict(scale)

    def imbalance(unknown: np.ndarray) -> np.ndarray:
        alpha, thrust, elevator = unknown.T
        of = neutral | {"alpha": alpha, THRUST: thrust, surfaces[0]: elevator, surfaces[1]: flap}
        CX, CZ, Cm = (aircraft.coefficient(name, of, ratio) for name in ("CX", "CZ", "Cm"))
        return np.stack([CX - load * np.sin(alpha), CZ + load * np.cos(alpha), Cm], -1)

    unknown = np.tile(GUESS, (q.size, 1))
    unknown[:, 0] += PER_FLAP * flap
    for _ in range(ITERATIONS):
        slopes = [imbalance(unknown + 1j * STEP * e).imag / STEP for e in np.eye(3)]
        unknown = unknown - np.linalg.solve(np.stack(slopes, -1), imbalance(unknown)[..., None])[..., 0]
    found = (
        (np.abs(imbalance(unknown)).max(axis=1) < CLOSE)
        & (np.abs(unknown[:, 0]) < STEEPEST_RAD)
        & (np.abs(unknown[:, 1]) < MOST_THRUST)
    )
    return np.where(found, unknown[:, 2], np.nan).reshape(len(qdyn_pa), len(flap_rad))
