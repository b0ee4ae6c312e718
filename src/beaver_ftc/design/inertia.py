"""What multiplies rate products and moments in the angular accelerations [FDC].

pdot = Ppq p q + Pqr q r + Pn N + Pl L          Ir = Ix Iz - Jxz^2
qdot = Qpp p^2 + Qpr p r + Qrr r^2 + Qm M
rdot = Rpq p q + Rqr q r + Rn N + Rl L
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import MassProperties


@dataclass(frozen=True)
class InertiaCoefficients:
    """The twelve coefficients; SI units."""

    Ppq: float
    Pqr: float
    Pl: float
    Pn: float
    Qpp: float
    Qpr: float
    Qrr: float
    Qm: float
    Rpq: float
    Rqr: float
    Rl: float
    Rn: float


def inertia_coefficients(mass: MassProperties) -> InertiaCoefficients:
    """The twelve inertia coefficients of the body-axis moment equations [FDC]; SI units."""
    Ix, Iy, Iz, Jxz = mass.Ix_kg_m2, mass.Iy_kg_m2, mass.Iz_kg_m2, mass.Jxz_kg_m2
    Ir = Ix * Iz - Jxz**2
    return InertiaCoefficients(
        Ppq=(Ix - Iy + Iz) * Jxz / Ir,
        Pqr=((Iy - Iz) * Iz - Jxz**2) / Ir,
        Pl=Iz / Ir,
        Pn=Jxz / Ir,
        Qpp=-Jxz / Iy,
        Qpr=(Iz - Ix) / Iy,
        Qrr=Jxz / Iy,
        Qm=1.0 / Iy,
        Rpq=((Ix - Iy) * Ix + Jxz**2) / Ir,
        Rqr=(Iy - Iz - Ix) * Jxz / Ir,
        Rl=Jxz / Ir,
        Rn=Ix / Ir,
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
