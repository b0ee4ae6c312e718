"""Level flight of the design model: the elevator that it takes over dynamic pressure and flap.

    qdyn S CX = m g sin alpha,   qdyn S CZ + m g cos alpha = 0,   Cm = 0

in angle of attack, slipstream and elevator: wings level, no rates, no sideslip, the engine free. S m2: wing
area; m kg: mass; g m/s2: gravity.
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2

THRUST = "dpt"  # the signal that stands for the engine
STEP = 1e-30  # of a complex step: far below rounding, so the derivative is exact to rounding
ITERATIONS, CLOSE = 12, 1e-9  # of Newton's method; imbalance of a coefficient that counts as zero
# Largest angle of attack and slipstream: beyond them the polynomials have solutions that no aircraft flies.
STEEPEST_RAD, MOST_THRUST = 0.5, 3.0
PER_FLAP, GUESS = -0.12, (0.1, 0.5, 0.0)  # start: slope of alpha over flap; alpha, slipstream, elevator


@lru_cache(maxsize=32)
def elevator_needed(
    aircraft: Aircraft,
    surfaces: tuple[str, str],
    mass_kg: float,
    scale: tuple[tuple[str, float], ...],
    qdyn_pa: tuple[float, ...],
    flap_rad: tuple[float, ...],
) -> np.ndarray:
    """Deflection (n, m) rad for level flight at qdyn (n,) Pa and flap (m,) rad; not a number where there is
    none.

    Newton's method, z <- z - J^-1 F, for all n m points at once: z (n m, 3) = (alpha, slipstream, elevator),
    F = (CX - load sin alpha, CZ + load cos alpha, Cm), load = m g / (qdyn S), J = dF/dz by complex steps.

    surfaces: names of elevator and flap. scale: factors of the designer on single terms. All signals that are
    not named here are 0.
    """
    q, flap = (values.ravel() for values in np.meshgrid(qdyn_pa, flap_rad, indexing="ij"))
    load = mass_kg * GRAVITY_MPS2 / (q * aircraft.geometry.wing_area_m2)
    neutral = {factor: 0.0 for term in aircraft.terms.values() for factor in term.factors}
    ratio = dict(scale)

    def F(z: np.ndarray) -> np.ndarray:
        """F (n m, 3) at z (n m, 3)."""
        alpha, thrust, elevator = z.T
        signals = neutral | {"alpha": alpha, THRUST: thrust, surfaces[0]: elevator, surfaces[1]: flap}
        CX, CZ, Cm = (aircraft.coefficient(name, signals, ratio) for name in ("CX", "CZ", "Cm"))
        return np.stack([CX - load * np.sin(alpha), CZ + load * np.cos(alpha), Cm], -1)

    z = np.tile(GUESS, (q.size, 1))
    z[:, 0] += PER_FLAP * flap
    for _ in range(ITERATIONS):
        J = np.stack([F(z + 1j * STEP * e).imag / STEP for e in np.eye(3)], -1)
        z = z - np.linalg.solve(J, F(z)[..., None])[..., 0]
    solved = np.abs(F(z)).max(axis=1) < CLOSE
    flyable = (np.abs(z[:, 0]) < STEEPEST_RAD) & (np.abs(z[:, 1]) < MOST_THRUST)
    return np.where(solved & flyable, z[:, 2], np.nan).reshape(len(qdyn_pa), len(flap_rad))
