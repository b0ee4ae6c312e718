"""The Beaver's one sourced table: every aerodynamic term, the geometry, the mass and the engine.

The aircraft's XML and the design model both come from this table (tests/aircraft compares the XML with it,
term by term). Sources: [TM88] R.T.H. Tjee and J.A. Mulder, Stability and Control Derivatives of the De
Havilland DHC-2 "Beaver" Aircraft, TU Delft LR-556, 1988; [FDC] M.O. Rauw, FDC 1.2, 2001, which uses the
same numbers.

Sign conventions: body axes X forward, Y right, Z down, origin in the centre of gravity. Rates and moments are
right-handed about those axes. Deflections in rad, positive elevator trailing edge down (nose down), positive
aileron rolls left, positive rudder yaws left, positive flap down.

A term is named `<coefficient>_<what it multiplies>`. A single quantity is spelled out (`Cm_alpha`,
`Cn_beta3`, `Cm_q`, `Cl_da`); a product of several uses the short letters a, be, da, de, dr, df, dpt
(`Cl_daa` is da times alpha).
"""

from dataclasses import dataclass
from math import prod

TM88 = "TM88"
FDC = "FDC"


@dataclass(frozen=True)
class Term:
    """One term of a body-axis coefficient: `value` times the product of `factors`.

    name:        e.g. "Cm_alpha"; also the XML function `aero/coefficient/<name>` and the input
                 `uncertainty/<name>-scale`.
    value:       coefficient, per rad of each angle or deflection (dimensionless where there is none).
    factors:     what it multiplies, one entry per power: ("alpha", "alpha") is alpha squared. Entries are
                 quantities of QUANTITIES.
    description: what the term is.
    source:      key of the reference.
    """

    name: str
    value: float
    factors: tuple[str, ...]
    description: str
    source: str = TM88

    @property
    def coefficient(self) -> str:
        """The coefficient this term belongs to: CX, CY, CZ, Cl, Cm or Cn."""
        return self.name.split("_", 1)[0]


@dataclass(frozen=True)
class Geometry:
    """Reference dimensions [TM88]: wing area m2, span m, mean aerodynamic chord m."""

    wing_area_m2: float = 23.23
    span_m: float = 14.63
    chord_m: float = 1.5875


@dataclass(frozen=True)
class MassProperties:
    """Mass kg and inertia kg m2 about the centre of gravity, body axes [TM88]; Jxz is the product of inertia
    integral of x z dm, so it enters the inertia tensor with a minus sign. Jxy and Jyz are zero."""

    mass_kg: float = 2288.231
    Ix_kg_m2: float = 5368.39
    Iy_kg_m2: float = 6928.93
    Iz_kg_m2: float = 11158.75
    Jxz_kg_m2: float = 117.64


@dataclass(frozen=True)
class InertiaCoefficients:
    """What multiplies rate products, N, L and M in the angular accelerations [FDC]."""

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


@dataclass(frozen=True)
class Travel:
    """Travel of one surface, rad."""

    min_rad: float
    max_rad: float


SURFACES = ("aileron", "elevator", "rudder", "flap")

# Dimensionless quantities a term may multiply, and what each is.
QUANTITIES = {
    "alpha": "angle of attack, rad",
    "beta": "sideslip angle, rad",
    "ph": "roll rate p b/2V",
    "qh": "pitch rate q c/V (full chord)",
    "rh": "yaw rate r b/2V",
    "betadoth": "sideslip rate betadot b/2V",
    "da": "aileron deflection, rad",
    "de": "elevator deflection, rad",
    "dr": "rudder deflection, rad",
    "df": "flap deflection, rad",
    "dpt": "slipstream: total pressure rise across the propeller over dynamic pressure",
}

_TERMS = (
    Term("CX_0", -0.03554, (), "longitudinal force at zero incidence"),
    Term("CX_alpha", 0.002920, ("alpha",), "longitudinal force with angle of attack"),
    Term("CX_alpha2", 5.459, ("alpha",) * 2, "longitudinal force with angle of attack squared"),
    Term("CX_alpha3", -5.162, ("alpha",) * 3, "longitudinal force with angle of attack cubed"),
    Term("CX_q", -0.6748, ("qh",), "longitudinal force with pitch rate"),
    Term("CX_dr", 0.03412, ("dr",), "longitudinal force with rudder"),
    Term("CX_df", -0.09447, ("df",), "longitudinal force with flap"),
    Term("CX_dfa", 1.106, ("df", "alpha"), "longitudinal force with flap, growing with angle of attack"),
    Term("CX_dpt", 0.1161, ("dpt",), "longitudinal force of the propeller and its slipstream: the thrust"),
    Term("CX_adpt2", 0.1453, ("alpha", "dpt", "dpt"), "slipstream's longitudinal force at angle of attack"),
    Term("CY_0", -0.002226, (), "side force in symmetric flight"),
    Term("CY_beta", -0.7678, ("beta",), "side force with sideslip"),
    Term("CY_p", -0.1240, ("ph",), "side force with roll rate"),
    Term("CY_r", 0.3666, ("rh",), "side force with yaw rate"),
    Term("CY_da", -0.02956, ("da",), "side force with aileron"),
    Term("CY_dr", 0.1158, ("dr",), "side force with rudder"),
    Term("CY_dra", 0.5238, ("dr", "alpha"), "side force with rudder, growing with angle of attack"),
    Term("CY_betadot", -0.1600, ("betadoth",), "side force with rate of sideslip"),
    Term("CZ_0", -0.05504, (), "normal force at zero incidence"),
    Term("CZ_alpha", -5.578, ("alpha",), "normal force with angle of attack: the lift slope"),
    Term("CZ_alpha3", 3.442, ("alpha",) * 3, "normal force with angle of attack cubed: towards the stall"),
    Term("CZ_q", -2.988, ("qh",), "normal force with pitch rate"),
    Term("CZ_de", -0.3980, ("de",), "normal force with elevator"),
    Term("CZ_debe2", -15.93, ("de", "beta", "beta"), "normal force with elevator in sideslip"),
    Term("CZ_df", -1.377, ("df",), "normal force with flap"),
    Term("CZ_dfa", -1.261, ("df", "alpha"), "normal force with flap, growing with angle of attack"),
    Term("CZ_dpt", -0.1563, ("dpt",), "normal force of the propeller and its slipstream"),
    Term("Cl_0", 0.0005910, (), "rolling moment in symmetric flight"),
    Term("Cl_beta", -0.06180, ("beta",), "rolling moment with sideslip: the dihedral effect"),
    Term("Cl_p", -0.5045, ("ph",), "rolling moment with roll rate: roll damping"),
    Term("Cl_r", 0.1695, ("rh",), "rolling moment with yaw rate"),
    Term("Cl_da", -0.09917, ("da",), "rolling moment with aileron"),
    Term("Cl_dr", 0.006934, ("dr",), "rolling moment with rudder"),
    Term("Cl_daa", -0.08269, ("da", "alpha"), "rolling moment with aileron, growing with angle of attack"),
    Term("Cl_a2dpt", -0.01406, ("alpha", "alpha", "dpt"), "rolling moment of the slipstream at incidence"),
    Term("Cm_0", 0.09448, (), "pitching moment at zero incidence"),
    Term("Cm_alpha", -0.6028, ("alpha",), "pitching moment with angle of attack: static stability"),
    Term("Cm_alpha2", -2.140, ("alpha",) * 2, "pitching moment with angle of attack squared"),
    Term("Cm_q", -15.56, ("qh",), "pitching moment with pitch rate: pitch damping"),
    Term("Cm_de", -1.921, ("de",), "pitching moment with elevator"),
    Term("Cm_beta2", 0.6921, ("beta",) * 2, "pitching moment with sideslip squared"),
    Term("Cm_r", -0.3118, ("rh",), "pitching moment with yaw rate"),
    Term("Cm_df", 0.4072, ("df",), "pitching moment with flap"),
    Term("Cm_dpt", -0.07895, ("dpt",), "pitching moment of the slipstream"),
    Term("Cn_0", -0.003117, (), "yawing moment in symmetric flight"),
    Term("Cn_beta", 0.006719, ("beta",), "yawing moment with sideslip: weathercock stability"),
    Term("Cn_p", -0.1585, ("ph",), "yawing moment with roll rate"),
    Term("Cn_r", -0.1112, ("rh",), "yawing moment with yaw rate: yaw damping"),
    Term("Cn_da", -0.003872, ("da",), "yawing moment with aileron"),
    Term("Cn_dr", -0.08265, ("dr",), "yawing moment with rudder"),
    Term("Cn_q", 0.1595, ("qh",), "yawing moment with pitch rate"),
    Term("Cn_beta3", 0.1373, ("beta",) * 3, "yawing moment with sideslip cubed"),
    Term("Cn_dpt3", -0.003026, ("dpt",) * 3, "yawing moment of the slipstream"),
)

TERMS: dict[str, Term] = {term.name: term for term in _TERMS}
COEFFICIENTS = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
GEOMETRY = Geometry()
MASS = MassProperties()

# A Beaver's droop and full flap; ailerons about 30 deg, elevator 28 deg, rudder 25 deg.
TRAVEL: dict[str, Travel] = {
    "aileron": Travel(-0.52, 0.52),
    "elevator": Travel(-0.49, 0.49),
    "rudder": Travel(-0.44, 0.44),
    "flap": Travel(-0.1, 1.03),
}

# Where the polynomials were identified: 30 to 55 m/s, attached flow up to 0.28 rad [TM88]. Towards negative
# lift the source gives no limit; -0.10 rad is 0.09 rad below the angle of zero lift and well short of a
# negative stall.
ENVELOPE_AIRSPEED_MPS = (30.0, 55.0)
ENVELOPE_ALPHA_RAD = (-0.10, 0.28)

SEA_LEVEL_DENSITY_KG_M3 = 1.225


def value(name: str) -> float:
    """The coefficient of one term, e.g. value("Cm_de"); KeyError for a name the table lacks."""
    return TERMS[name].value


def coefficient_terms(coefficient: str) -> tuple[Term, ...]:
    """The terms whose sum is `coefficient` (one of COEFFICIENTS), in the table's order."""
    return tuple(term for term in _TERMS if term.coefficient == coefficient)


def evaluate(coefficient: str, quantities: dict[str, float], scales: dict[str, float] | None = None) -> float:
    """Sum one coefficient. quantities: a value for each of QUANTITIES. scales: multiplier per term (1)."""
    scales = scales or {}
    return sum(
        term.value * scales.get(term.name, 1.0) * prod(quantities[factor] for factor in term.factors)
        for term in coefficient_terms(coefficient)
    )


def engine_power_kw(engine_rpm: float, manifold_pressure_inhg: float, density_kg_m3: float) -> float:
    """Shaft power of the R-985 from its chart fit [FDC, Power]: kW from rpm, inHg and kg/m3."""
    thin_air = (408.0 - 0.0965 * engine_rpm) * (1.0 - density_kg_m3 / SEA_LEVEL_DENSITY_KG_M3)
    return 0.7355 * (-326.5 + 0.00412 * (manifold_pressure_inhg + 7.4) * (engine_rpm + 2010.0) + thin_air)


def slipstream(power_kw: float, density_kg_m3: float, airspeed_mps: float) -> float:
    """dpt, the dimensionless total pressure rise across the propeller [FDC, Power]: power in kW, not W."""
    return 0.08696 + 191.18 * 2.0 * power_kw / (density_kg_m3 * airspeed_mps**3)


def inertia_coefficients(mass: MassProperties = MASS) -> InertiaCoefficients:
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
