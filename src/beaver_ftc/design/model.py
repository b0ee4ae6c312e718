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

from collections import namedtuple
from collections.abc import Mapping

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties, load
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design import terms
from beaver_ftc.design.terms import AIRSPEED, ALPHA, BETA, DPT, N_Y, PH, QDYN, RH

# The built-in aircraft's surfaces, for what does not yet look them up in the aircraft.
AILERON, ELEVATOR, RUDDER, FLAP = range(4)

__all__ = ["AIRSPEED", "ALPHA", "AXES", "BETA", "DPT", "N_Y", "QDYN", "design_dtype", "design_record"]


# What multiplies rate products and moments in the accelerations; SI units.
InertiaCoefficients = namedtuple("InertiaCoefficients", "Ppq Pqr Pl Pn Qpp Qpr Qrr Qm Rpq Rqr Rl Rn")


def inertia_coefficients(mass: MassProperties) -> InertiaCoefficients:
    """The twelve inertia coefficients of the body-axis moment equations [FDC]; SI units."""
    Ix, Iy, Iz, Jxz = mass.Ix_kg_m2, mass.Iy_kg_m2, mass.Iz_kg_m2, mass.Jxz_kg_m2
    Ir = Ix * Iz - Jxz**2
    return InertiaCoefficients(
        Ppq=(Ix - Iy + Iz) * Jxz / Ir, Pqr=((Iy - Iz) * Iz - Jxz**2) / Ir, Pl=Iz / Ir, Pn=Jxz / Ir,
        Qpp=-Jxz / Iy, Qpr=(Iz - Ix) / Iy, Qrr=Jxz / Iy, Qm=1.0 / Iy,
        Rpq=((Ix - Iy) * Ix + Jxz**2) / Ir, Rqr=(Iy - Iz - Ix) * Jxz / Ir, Rl=Jxz / Ir, Rn=Ix / Ir,
    )  # fmt: skip


def inertia_of(design: np.void) -> InertiaCoefficients:
    """Those of a design model's record (dtype `design_dtype`)."""
    return InertiaCoefficients(*(float(design[name]) for name in InertiaCoefficients._fields))


def inertial(inertia: InertiaCoefficients, x: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of turning with no moment, from the rate products [FDC]."""
    p, q, r = x.T
    roll = inertia.Ppq * p * q + inertia.Pqr * q * r
    pitch = inertia.Qpp * p * p + inertia.Qpr * p * r + inertia.Qrr * r * r
    yaw = inertia.Rpq * p * q + inertia.Rqr * q * r
    return np.column_stack([roll, pitch, yaw])


@sized
def design_dtype(n: int) -> np.dtype:
    """The design model of an aircraft with n surfaces."""
    return record(
        **dict.fromkeys(InertiaCoefficients._fields, float), S=float, b=float, c=float, moments=terms.TABLE,
        # of a linearised or frozen model: see variants.py
        linearised=int, frozen_alpha=int, x0=3, y0=N_Y, f0=3, f_x=(3, 3), f_y=(3, N_Y), G0=(3, n),
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
    geometry, ratio = aircraft.geometry, dict(scale or {})
    design["S"], design["b"], design["c"] = geometry.wing_area_m2, geometry.span_m, geometry.chord_m
    for name, number in inertia_coefficients(mass or aircraft.mass)._asdict().items():
        design[name] = number
    for term in aircraft.moments:
        if not engine_terms and any(signal in aircraft.signals for signal, _ in term.of):
            ratio[term.name] = 0.0
    terms.fill_table(design["moments"][0], aircraft, aircraft.moments, MOMENTS, ratio)
    return design


@kernel
def accelerations_of_moments(design, x, L, M, N, f):
    """Fill f (3,) rad/s2 from rates x (3,) rad/s and moments N m."""
    p, q, r = x[0], x[1], x[2]
    f[0] = design.Ppq * p * q + design.Pqr * q * r + design.Pn * N + design.Pl * L
    f[1] = design.Qpp * p * p + design.Qpr * p * r + design.Qrr * r * r + design.Qm * M
    f[2] = design.Rpq * p * q + design.Rqr * q * r + design.Rn * N + design.Rl * L


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
def both_responses(design, x, y, f, G):
    """Fill f (3,) rad/s2, the angular acceleration at neutral surfaces, and G (3, surfaces) rad/s2 per rad,
    that of each surface, whatever the rates. x (3,) rad/s, y (4 + declared,)."""
    table, power = design.moments, design.moments.power
    terms.evaluate(table, x, y)
    lateral, longitudinal = y[QDYN] * design.S * design.b, y[QDYN] * design.S * design.c
    Cl, Cn = terms.free_sum(table, 0, power), terms.free_sum(table, 2, power)
    Cm = terms.free_sum(table, 1, power)
    accelerations_of_moments(design, x, lateral * Cl, longitudinal * Cm, lateral * Cn, f)
    terms.surface_sums(table, power, G)
    accelerations_per_rad(design, y, G)


@kernel
def rate_damping(design, x, y, u, scratch, out):
    """Fill out (3, 3) 1/s: what the aerodynamic moments' accelerations change by per rate of the aircraft
    against the air. x (3,) rad/s, y (4 + declared,), u (surfaces,) rad; scratch (MAX_MONOMIALS,)."""
    table = design.moments
    terms.evaluate(table, x, y)
    lateral, longitudinal = y[QDYN] * design.S * design.b, y[QDYN] * design.S * design.c
    for j in range(3):
        terms.slopes(table, table.signal, table.power, PH + j, scratch)
        per_rate = design.c / y[AIRSPEED] if j == 1 else design.b / (2 * y[AIRSPEED])
        L = lateral * terms.whole_sum(table, 0, scratch, u) * per_rate
        M = longitudinal * terms.whole_sum(table, 1, scratch, u) * per_rate
        N = lateral * terms.whole_sum(table, 2, scratch, u) * per_rate
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
