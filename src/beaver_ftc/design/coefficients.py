"""The built-in aircraft's data by the names the studies use; all of it is read from its file."""

from beaver_ftc.aircraft import Term, load
from beaver_ftc.aircraft.aircraft import FORCES, MOMENTS
from beaver_ftc.design import inertia
from beaver_ftc.design.engine import engine_power_kw, slipstream
from beaver_ftc.design.inertia import InertiaCoefficients

__all__ = ["InertiaCoefficients", "engine_power_kw", "slipstream"]

_AIRCRAFT = load()
SURFACES = _AIRCRAFT.surfaces
TERMS = _AIRCRAFT.terms
TRAVEL = _AIRCRAFT.travel
GEOMETRY = _AIRCRAFT.geometry
MASS = _AIRCRAFT.mass
COEFFICIENTS = (*FORCES, *MOMENTS)
ENVELOPE_AIRSPEED_MPS = _AIRCRAFT.envelope.airspeed_mps
ENVELOPE_ALPHA_RAD = _AIRCRAFT.alpha_rad


def value(name: str) -> float:
    """The coefficient of one term, e.g. value("Cm_de"); KeyError for a name the file lacks."""
    return TERMS[name].value


def coefficient_terms(coefficient: str) -> tuple[Term, ...]:
    """The terms whose sum is `coefficient` (one of COEFFICIENTS)."""
    return tuple(term for term in TERMS.values() if term.coefficient == coefficient)


def inertia_coefficients(mass=MASS) -> InertiaCoefficients:
    """The twelve inertia coefficients [FDC]; SI units."""
    return inertia.inertia_coefficients(mass)
