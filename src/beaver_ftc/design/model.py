"""The design model: what the diagnosis and the laws believe of the (p, q, r) dynamics.

    xdot = f(x, y) + G(y) u     x = (p, q, r), y = (alpha, beta, V, qdyn, declared signals), u: the surfaces

[Zhang2005, eq. (2)] with the moment terms of the aircraft's file. The moment coefficients are linear in
their values, so they are kept as a table (terms.py): a bound on a coefficient is then a bound on an
acceleration. What multiplies rate products and moments in the accelerations [FDC]:

    pdot = Ppq p q + Pqr q r + Pn N + Pl L          Ir = Ix Iz - Jxz^2
    qdot = Qpp p^2 + Qpr p r + Qrr r^2 + Qm M
    rdot = Rpq p q + Rqr q r + Rn N + Rl L

Sign conventions: body axes X forward, Y right, Z down; positive moments right wing down, nose up, nose right.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties, load
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.compiled import kernel
from beaver_ftc.design.terms import (
    AIRSPEED,
    ALPHA,
    BETA,
    DPT,
    N_Y,
    PH,
    QDYN,
    RH,
    TABLE,
    evaluate,
    fill_table,
    free_sum,
    slopes,
    surface_sums,
    whole_sum,
)

# The built-in aircraft's surfaces, for what does not yet look them up in the aircraft.
AILERON, ELEVATOR, RUDDER, FLAP = range(4)

__all__ = ["AIRSPEED", "ALPHA", "AXES", "BETA", "DPT", "N_Y", "QDYN", "design_dtype", "design_record"]


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


@lru_cache
def design_dtype(n: int) -> np.dtype:
    """The design model of an aircraft with n surfaces."""
    return np.dtype(
        [
            ("Ppq", "f8"), ("Pqr", "f8"), ("Pl", "f8"), ("Pn", "f8"),
            ("Qpp", "f8"), ("Qpr", "f8"), ("Qrr", "f8"), ("Qm", "f8"),
            ("Rpq", "f8"), ("Rqr", "f8"), ("Rl", "f8"), ("Rn", "f8"),
            ("S", "f8"), ("b", "f8"), ("c", "f8"),
            ("moments", TABLE),
            # of a linearised or frozen model: see variants.py
            ("linearised", "i8"), ("frozen_alpha", "i8"),
            ("x0", "f8", (3,)), ("y0", "f8", (N_Y,)),
            ("f0", "f8", (3,)), ("f_x", "f8", (3, 3)), ("f_y", "f8", (3, N_Y)), ("G0", "f8", (3, n)),
        ],
        align=True,
    )  # fmt: skip


def design_record(
    aircraft: Aircraft | None = None,
    *,
    engine_terms: bool = True,
    scale: Mapping[str, float] | None = None,
    mass: MassProperties | None = None,
) -> np.ndarray:
    """The design model as a record array of shape (1,), dtype `design_dtype`.

    `engine_terms=False` neglects the declared signals in the moments: of the slipstream, as published.
    `scale` multiplies single coefficients, `mass` is what the designer takes the inertia for: deliberate
    errors of the designer.
    """
    aircraft = aircraft or load()
    design = np.zeros(1, design_dtype(aircraft.n))
    inertia = asdict(inertia_coefficients(mass or aircraft.mass))
    geometry = aircraft.geometry
    dimensions = {"S": geometry.wing_area_m2, "b": geometry.span_m, "c": geometry.chord_m}
    for name, number in {**inertia, **dimensions}.items():
        design[name] = number
    neglected = {} if engine_terms else dict.fromkeys(engine_terms_of(aircraft), 0.0)
    fill_table(design["moments"][0], aircraft, aircraft.moments, MOMENTS, {**(scale or {}), **neglected})
    return design


def engine_terms_of(aircraft: Aircraft) -> tuple[str, ...]:
    """Names of the moments' terms that multiply a declared signal."""
    return tuple(
        term.name for term in aircraft.moments if any(signal in aircraft.signals for signal, _ in term.of)
    )


@kernel
def accelerations_of_moments(design, x, L, M, N, f):
    """Fill f (3,) rad/s2 from rates x (3,) rad/s and moments N m."""
    p, q, r = x[0], x[1], x[2]
    f[0] = design.Ppq * p * q + design.Pqr * q * r + design.Pn * N + design.Pl * L
    f[1] = design.Qpp * p * p + design.Qpr * p * r + design.Qrr * r * r + design.Qm * M
    f[2] = design.Rpq * p * q + design.Rqr * q * r + design.Rn * N + design.Rl * L


@kernel
def free_response_at(design, x, y, power, f):
    """Fill f (3,) rad/s2 from the monomials `power` of the state x (3,) rad/s, y (4 + declared,)."""
    table = design.moments
    lateral, longitudinal = y[QDYN] * design.S * design.b, y[QDYN] * design.S * design.c
    L, M = lateral * free_sum(table, 0, power), longitudinal * free_sum(table, 1, power)
    accelerations_of_moments(design, x, L, M, lateral * free_sum(table, 2, power), f)


@kernel
def control_effectiveness_at(design, y, power, G):
    """Fill G (3, surfaces) rad/s2 per rad from the monomials `power` of the state."""
    surface_sums(design.moments, power, G)
    accelerations_per_rad(design, y, G)


@kernel
def accelerations_per_rad(design, y, G):
    """Turn G (3, surfaces) from slopes of Cl, Cm, Cn into rad/s2 per rad."""
    lateral = y[QDYN] * design.S * design.b
    longitudinal = design.Qm * y[QDYN] * design.S * design.c
    for s in range(G.shape[1]):
        Cl, Cn = G[0, s], G[2, s]
        in_roll, in_yaw = design.Pn * Cn + design.Pl * Cl, design.Rn * Cn + design.Rl * Cl
        G[0, s], G[1, s], G[2, s] = lateral * in_roll, longitudinal * G[1, s], lateral * in_yaw


@kernel
def free_response(design, x, y, f):
    """Fill f (3,) rad/s2: angular acceleration at neutral surfaces. x (3,) rad/s, y (4 + declared,)."""
    evaluate(design.moments, x, y)
    free_response_at(design, x, y, design.moments.power, f)


@kernel
def control_effectiveness(design, y, G):
    """Fill G (3, surfaces) rad/s2 per rad: the angular acceleration of each surface, whatever the rates."""
    evaluate(design.moments, np.zeros(3), y)
    control_effectiveness_at(design, y, design.moments.power, G)


@kernel
def both_responses(design, x, y, f, G):
    """Fill f and G at one state, of which the monomials are worked out once."""
    evaluate(design.moments, x, y)
    free_response_at(design, x, y, design.moments.power, f)
    control_effectiveness_at(design, y, design.moments.power, G)


@kernel
def rate_damping(design, x, y, u, scratch, out):
    """Fill out (3, 3) 1/s: what the aerodynamic moments' accelerations change by per rate of the aircraft
    against the air. x (3,) rad/s, y (4 + declared,), u (surfaces,) rad; scratch (MAX_MONOMIALS,)."""
    table = design.moments
    evaluate(table, x, y)
    lateral, longitudinal = y[QDYN] * design.S * design.b, y[QDYN] * design.S * design.c
    for j in range(3):
        slopes(table, table.signal, table.power, PH + j, scratch)
        per_rate = design.c / y[AIRSPEED] if j == 1 else design.b / (2 * y[AIRSPEED])
        L = lateral * whole_sum(table, 0, scratch, u) * per_rate
        M = longitudinal * whole_sum(table, 1, scratch, u) * per_rate
        N = lateral * whole_sum(table, 2, scratch, u) * per_rate
        out[0, j] = design.Pl * L + design.Pn * N
        out[1, j] = design.Qm * M
        out[2, j] = design.Rl * L + design.Rn * N


@kernel
def unanticipated_pitch(design, y, Cm_alpha3):
    """Pitch acceleration, rad/s2, of an extra moment coefficient on alpha^3 [Zhang2005]."""
    return Cm_alpha3 * design.Qm * y[QDYN] * design.S * design.c * y[ALPHA] ** 3


@kernel
def acceleration(f, G, u, out):
    """Fill out (3,) with f + G u, rad/s2."""
    for i in range(3):
        out[i] = f[i]
        for s in range(u.size):
            out[i] += G[i, s] * u[s]


assert (PH, RH) == (2, 4)  # rates are neighbours among the signals: see rate_damping
