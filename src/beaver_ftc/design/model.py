"""The design model: what the diagnosis and the laws believe of the (p, q, r) dynamics.

    xdot = f(x, y) + G(y) u          x = (p, q, r), y = (alpha, beta, V, qdyn, dpt), u = (da, de, dr, df)

[Zhang2005, eq. (2)] with the coefficients of [TM88]. The moment coefficients are linear in their terms, so
they are kept as a table of coefficients times a table of regressors: a bound on a coefficient is then a
bound on an acceleration.

Sign conventions: body axes X forward, Y right, Z down; positive moments right wing down, nose up, nose
right; positive aileron rolls left, positive elevator pitches down, positive rudder yaws left, positive flap
pitches up.
"""

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.coefficients import GEOMETRY, MASS, MassProperties, inertia_coefficients, value

AXES = ("p", "q", "r")
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
ALPHA, BETA, AIRSPEED, QDYN, DPT = range(5)

# The terms of each moment coefficient, in the order in which `regressors` fills them.
TERMS = (
    ("Cl_0", "Cl_beta", "Cl_p", "Cl_r", "Cl_a2dpt", "Cl_da", "Cl_daa", "Cl_dr", ""),
    ("Cm_0", "Cm_alpha", "Cm_alpha2", "Cm_q", "Cm_beta2", "Cm_r", "Cm_dpt", "Cm_de", "Cm_df"),
    ("Cn_0", "Cn_beta", "Cn_p", "Cn_r", "Cn_q", "Cn_beta3", "Cn_dpt3", "Cn_da", "Cn_dr"),
)
ENGINE_TERMS = ("Cl_a2dpt", "Cm_dpt", "Cn_dpt3")

DESIGN = np.dtype(
    [
        ("Ppq", "f8"), ("Pqr", "f8"), ("Pl", "f8"), ("Pn", "f8"),
        ("Qpp", "f8"), ("Qpr", "f8"), ("Qrr", "f8"), ("Qm", "f8"),
        ("Rpq", "f8"), ("Rqr", "f8"), ("Rl", "f8"), ("Rn", "f8"),
        ("S", "f8"), ("b", "f8"), ("c", "f8"),
        ("coefficient", "f8", (3, 9)),
        # of a linearised or frozen model: see variants.py
        ("linearised", "i8"), ("frozen_alpha", "i8"),
        ("x0", "f8", (3,)), ("y0", "f8", (5,)),
        ("f0", "f8", (3,)), ("f_x", "f8", (3, 3)), ("f_y", "f8", (3, 5)), ("G0", "f8", (3, 4)),
    ],
    align=True,
)  # fmt: skip


def design_record(
    *, engine_terms: bool = True, scale: Mapping[str, float] | None = None, mass: MassProperties = MASS
) -> np.ndarray:
    """The design model as a record array of shape (1,), dtype `DESIGN`.

    `engine_terms=False` neglects the slipstream in the moments, as published. `scale` multiplies single
    coefficients, `mass` is what the designer takes the inertia for: deliberate errors of the designer.
    """
    design = np.zeros(1, DESIGN)
    dimensions = {"S": GEOMETRY.wing_area_m2, "b": GEOMETRY.span_m, "c": GEOMETRY.chord_m}
    for name, number in {**asdict(inertia_coefficients(mass)), **dimensions}.items():
        design[name] = number
    scale = scale or {}
    for axis, names in enumerate(TERMS):
        for term, name in enumerate(names):
            if name and (engine_terms or name not in ENGINE_TERMS):
                design["coefficient"][0, axis, term] = value(name) * scale.get(name, 1.0)
    return design


@kernel
def regressors(design, x, y, u, out):
    """Fill `out` (3, 9) with what each moment coefficient term multiplies; dimensionless or rad.

    x (3,) rad/s; y (5,) rad, rad, m/s, Pa, 1; u (4,) rad. [TM88], with qh = q c / V over the full chord.
    """
    alpha, beta, V, dpt = y[ALPHA], y[BETA], y[AIRSPEED], y[DPT]
    ph = x[0] * design.b / (2 * V)
    qh = x[1] * design.c / V
    rh = x[2] * design.b / (2 * V)

    out[0, 0], out[0, 1], out[0, 2], out[0, 3], out[0, 4] = 1.0, beta, ph, rh, alpha * alpha * dpt
    out[0, 5], out[0, 6], out[0, 7], out[0, 8] = u[AILERON], u[AILERON] * alpha, u[RUDDER], 0.0

    out[1, 0], out[1, 1], out[1, 2], out[1, 3] = 1.0, alpha, alpha * alpha, qh
    out[1, 4], out[1, 5], out[1, 6] = beta * beta, rh, dpt
    out[1, 7], out[1, 8] = u[ELEVATOR], u[FLAP]

    out[2, 0], out[2, 1], out[2, 2], out[2, 3], out[2, 4] = 1.0, beta, ph, rh, qh
    out[2, 5], out[2, 6] = beta * beta * beta, dpt * dpt * dpt
    out[2, 7], out[2, 8] = u[AILERON], u[RUDDER]


@kernel
def free_response(design, x, y, f):
    """Fill f (3,) rad/s2: angular acceleration at neutral surfaces. Arguments as in `regressors`."""
    p, q, r = x[0], x[1], x[2]
    alpha, beta, V, qdyn, dpt = y[ALPHA], y[BETA], y[AIRSPEED], y[QDYN], y[DPT]
    k = design.coefficient
    ph, qh, rh = p * design.b / (2 * V), q * design.c / V, r * design.b / (2 * V)
    Cl = k[0, 0] + k[0, 1] * beta + k[0, 2] * ph + k[0, 3] * rh + k[0, 4] * alpha * alpha * dpt
    Cm = (
        k[1, 0] + k[1, 1] * alpha + k[1, 2] * alpha * alpha + k[1, 3] * qh
        + k[1, 4] * beta * beta + k[1, 5] * rh + k[1, 6] * dpt
    )  # fmt: skip
    Cn = (
        k[2, 0] + k[2, 1] * beta + k[2, 2] * ph + k[2, 3] * rh + k[2, 4] * qh
        + k[2, 5] * beta * beta * beta + k[2, 6] * dpt * dpt * dpt
    )  # fmt: skip
    L, M, N = (
        qdyn * design.S * design.b * Cl,
        qdyn * design.S * design.c * Cm,
        qdyn * design.S * design.b * Cn,
    )
    f[0] = design.Ppq * p * q + design.Pqr * q * r + design.Pn * N + design.Pl * L
    f[1] = design.Qpp * p * p + design.Qpr * p * r + design.Qrr * r * r + design.Qm * M
    f[2] = design.Rpq * p * q + design.Rqr * q * r + design.Rn * N + design.Rl * L


@kernel
def control_effectiveness(design, y, G):
    """Fill G (3, 4) rad/s2 per rad: the angular acceleration of each surface."""
    k = design.coefficient
    lateral = y[QDYN] * design.S * design.b
    longitudinal = design.Qm * y[QDYN] * design.S * design.c
    Cl_da = k[0, 5] + k[0, 6] * y[ALPHA]
    Cl_dr, Cn_da, Cn_dr = k[0, 7], k[2, 7], k[2, 8]
    G[0, AILERON] = lateral * (design.Pn * Cn_da + design.Pl * Cl_da)
    G[2, AILERON] = lateral * (design.Rn * Cn_da + design.Rl * Cl_da)
    G[0, RUDDER] = lateral * (design.Pn * Cn_dr + design.Pl * Cl_dr)
    G[2, RUDDER] = lateral * (design.Rn * Cn_dr + design.Rl * Cl_dr)
    G[1, ELEVATOR] = longitudinal * k[1, 7]
    G[1, FLAP] = longitudinal * k[1, 8]


@kernel
def unanticipated_pitch(design, y, Cm_alpha3):
    """Pitch acceleration, rad/s2, of an extra moment coefficient on alpha^3 [Zhang2005]; y (5,)."""
    return Cm_alpha3 * design.Qm * y[QDYN] * design.S * design.c * y[ALPHA] ** 3


@kernel
def acceleration(f, G, u, out):
    """Fill out (3,) with f + G u, rad/s2."""
    for i in range(3):
        out[i] = f[i] + G[i, 0] * u[0] + G[i, 1] * u[1] + G[i, 2] * u[2] + G[i, 3] * u[3]
