"""The design model: what the diagnosis and the laws assume of the (p, q, r) dynamics.

    xdot = f(x, y) + G(y) u     x = (p, q, r), y = (alpha, beta, V, qdyn, declared signals), u: the surfaces

[Zhang2005, eq. (2)] with the moment terms of the aircraft's file. The moment coefficients are linear in
their values, so they are kept as a table (table.py): a bound on a coefficient is then a bound on an
acceleration.

*Accelerations.* What multiplies rate products and moments [FDC]:

    pdot = Ppq p q + Pqr q r + Pn N + Pl L          Ir = Ix Iz - Jxz^2
    qdot = Qpp p^2 + Qpr p r + Qrr r^2 + Qm M
    rdot = Rpq p q + Rqr q r + Rn N + Rl L

Sign conventions: body axes X forward, Y right, Z down; positive moments right wing down, nose up, nose
right.

*Simplified models.* A scenario may ask for a model that is wrong on purpose (`design_of`,
`plain_model.anchor`):

    engine terms neglected, other coefficients, another mass or inertia     only other numbers in the record
    frozen alpha                f(x, y) and G(y) with alpha held at its trim value, all else as measured
    linearised about trim       f = f0 + f_x (x - x0) + f_y (y - y0), G = G0
    both                        the linear model without its derivative with alpha: f_y[:, ALPHA] = 0

The linear model is that of f + G u at (x0, y0, u0): the surfaces' moments vary with y too, so f_y holds
d(G u0)/dy, and f0 + G0 u0 is the acceleration in trim. plain_model.py has these derivatives.
"""

from collections import namedtuple
from collections.abc import Mapping
from typing import Any

import numpy as np

from beaver_ftc.aircraft import Aircraft, MassProperties, load
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.compiled import copy, kernel, record, sized
from beaver_ftc.design.table import (
    AIRSPEED,
    ALPHA,
    N_SIGNALS,
    N_Y,
    PH,
    QDYN,
    QH,
    RH,
    TABLE,
    directional,
    evaluate,
    fill_table,
    free_sum,
    surface_sums,
    whole_sum,
)

_ALONG = np.eye(N_SIGNALS)  # each signal by itself: the directions of `directional`

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
    """The inertia coefficients of a design model's record (dtype `design_dtype`)."""
    return InertiaCoefficients(*(float(design[name]) for name in InertiaCoefficients._fields))


@sized
def design_dtype(n: int) -> np.dtype:
    """The design model of an aircraft with n surfaces."""
    return record(
        **dict.fromkeys(InertiaCoefficients._fields, float), S=float, b=float, c=float, moments=TABLE,
        # of a linearised or frozen model: see `response`
        linearised=int, frozen_alpha=int, x0=3, y0=N_Y, f0=3, f_x=(3, 3), f_y=(3, N_Y), G0=(3, n),
    )  # fmt: skip


def design_record(
    aircraft: Aircraft | None = None,
    *,
    scale: Mapping[str, float] | None = None,
    mass: MassProperties | None = None,
) -> np.ndarray:
    """The design model as a record array of shape (1,), dtype `design_dtype`.

    Deliberate errors of the designer: `scale` has factors on single terms by name; the inertia is that of
    `mass`.
    """
    aircraft = aircraft or load()
    design = np.zeros(1, design_dtype(aircraft.n))
    geometry = aircraft.geometry
    design["S"], design["b"], design["c"] = geometry.wing_area_m2, geometry.span_m, geometry.chord_m
    for name, number in inertia_coefficients(mass or aircraft.mass)._asdict().items():
        design[name] = number
    fill_table(design["moments"][0], aircraft, aircraft.moments, MOMENTS, scale)
    return design


@kernel
def response(design, x, y, f, G):
    """Fill f (3,) rad/s2 and G (3, n) rad/s2 per rad of the design model, simplified or not, at x (3,) and y.

    With a frozen alpha, y has it for the time of the call: a kernel makes no copy."""
    if design.linearised:
        linear_response(design, x, y, f, G)
    elif design.frozen_alpha:
        alpha = y[ALPHA]
        y[ALPHA] = design.y0[ALPHA]
        nonlinear_response(design, x, y, f, G)
        y[ALPHA] = alpha
    else:
        nonlinear_response(design, x, y, f, G)


@kernel
def responses(design, x, y, f, G):
    """`response` at n states x (n, 3), y (n, 4 + declared), into f (n, 3) and G (n, 3, surfaces)."""
    for i in range(x.shape[0]):
        response(design, x[i], y[i], f[i], G[i])


@kernel
def linear_response(design, x, y, f, G):
    """Fill f (3,) and G (3, surfaces): f = f0 + f_x (x - x0) + f_y (y - y0),  G = G0."""
    for i in range(3):
        f[i] = design.f0[i]
        for j in range(3):
            f[i] += design.f_x[i, j] * (x[j] - design.x0[j])
        for j in range(y.size):
            f[i] += design.f_y[i, j] * (y[j] - design.y0[j])
    copy(design.G0, G)


@kernel
def nonlinear_response(design, x, y, f, G):
    """Fill f (3,) rad/s2, the angular acceleration at neutral surfaces, and G (3, surfaces) rad/s2 per rad,
    that of each surface, whatever the rates. x (3,) rad/s, y (4 + declared,)."""
    evaluate(design.moments, x, y)
    nonlinear_response_from_table(design, x, y, f, G)


@kernel
def nonlinear_response_from_table(design, x, y, f, G):
    """Fill f and G as `nonlinear_response` does, from the monomials that are already in the table. These may
    be those of the rates against the air; x (3,) rad/s are the rates against the ground.
    """
    table = design.moments
    for i in range(3):
        f[i] = free_sum(table, i, table.power)
    surface_sums(table, table.power, G)
    accelerate(design, y, f.reshape(3, 1))
    accelerate(design, y, G)
    add_coupling(design, x, f)


@kernel
def accelerate(design, y, C):
    """Turn C (3, columns) from coefficients Cl, Cm, Cn into the accelerations that they cause, rad/s2.

    L = qdyn S b Cl      M = qdyn S c Cm      N = qdyn S b Cn      N m
    """
    qS = y[QDYN] * design.S
    for k in range(C.shape[1]):
        L = qS * design.b * C[0, k]
        M = qS * design.c * C[1, k]
        N = qS * design.b * C[2, k]
        C[0, k] = design.Pl * L + design.Pn * N
        C[1, k] = design.Qm * M
        C[2, k] = design.Rl * L + design.Rn * N


@kernel
def add_coupling(design, x, f):
    """Add to f (3,) rad/s2 the terms of the rate products, of x = (p, q, r) rad/s."""
    p, q, r = x[0], x[1], x[2]
    f[0] += design.Ppq * p * q + design.Pqr * q * r
    f[1] += design.Qpp * p * p + design.Qpr * p * r + design.Qrr * r * r
    f[2] += design.Rpq * p * q + design.Rqr * q * r


@kernel
def rate_damping(design, x, y, u, scratch, out):
    """Fill out (3, 3) 1/s: derivatives of the accelerations by the aerodynamic moments (rows) with the rates
    of the aircraft against the air (columns). x (3,) rad/s, y (4 + declared,), u (surfaces,) rad; scratch
    (MAX_MONOMIALS,).

    The table has the rates as ph = p b / 2V, qh = q c / V, rh = r b / 2V; per_rate is their scale, s.
    """
    table = design.moments
    evaluate(table, x, y)
    for j, rate in enumerate((PH, QH, RH)):
        directional(table, table.signal, table.power, _ALONG[rate], scratch)
        per_rate = design.c / y[AIRSPEED] if j == 1 else design.b / (2 * y[AIRSPEED])
        for i in range(3):
            out[i, j] = whole_sum(table, i, scratch, u) * per_rate
    accelerate(design, y, out)


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


def design_of(declared: Any) -> np.ndarray:
    """The design record (1,) of a `Declared`: the aircraft's file with the errors and simplifications of the
    designer. A linearised or frozen model also needs `plain_model.anchor`.
    """
    model = declared.design_model
    design = design_record(declared.aircraft, scale=declared.scale, mass=declared.mass)
    design["linearised"], design["frozen_alpha"] = model.linearised, model.frozen_alpha
    return design


def responses_at(design: np.void, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f (n, 3) rad/s2 and G (n, 3, surfaces) rad/s2 per rad of `response` at n states: x (n, 3) rad/s, y (n,
    4 + declared)."""
    f, G = np.empty(x.shape), np.zeros((len(x), *design["G0"].shape))
    responses(design, np.ascontiguousarray(x), np.array(y, order="C"), f, G)
    return f, G


def acceleration_at(design: np.void, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """f + G u (n, 3) rad/s2 at many states: see `responses_at`; u (n, surfaces) rad."""
    f, G = responses_at(design, x, y)
    return f + np.einsum("kas,ks->ka", G, u)


class DesignFunctions:
    """The design model xdot = f(x, y) + G(y) u as two functions. A plug-in receives it as `Context.model`.

    - `x` (3,) rad/s: body rates p, q and r.
    - `y` (4 + signals,): other signals, in the order and units of `Measured.y`.
    - `u` (surfaces,) rad: deflections of the surfaces from neutral.
    """

    def __init__(self, record: np.ndarray) -> None:
        self._design = record[0]

    def f(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Angular acceleration (3,) rad/s² at neutral surfaces. For `x` (n, 3) the result is (n, 3)."""
        rows = np.atleast_2d(x)
        return responses_at(self._design, rows, np.tile(y, (len(rows), 1)))[0].reshape(np.shape(x))

    def G(self, y: np.ndarray) -> np.ndarray:
        """Effectiveness matrix (3, surfaces), rad/s² per rad: acceleration for each rad of a surface."""
        return responses_at(self._design, np.zeros((1, 3)), y[None])[1][0]
