"""A stretch of the log as arrays, and angular accelerations there: the truth's and the designer's.

The same physics as `design.model`, by another road: each term is its table entry's value times the product of
its factors, turned into an acceleration by the inertia [FDC]. Nothing is summed that one may want apart.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import prod

import numpy as np

from beaver_ftc.aircraft import AXES, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.design.fdc import GEOMETRY, MASS, SURFACES, TERMS
from beaver_ftc.design.model import (
    ALPHA,
    Anchored,
    InertiaCoefficients,
    anchor,
    anchored,
    design_of,
    inertia_coefficients,
    inertial,
    mass_of,
)
from beaver_ftc.plant.conditions import known_trim
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario

MOMENT_TERMS: dict[str, Term] = {name: term for name, term in TERMS.items() if term.coefficient in MOMENTS}
ENGINE_TERMS = tuple(name for name, term in MOMENT_TERMS.items() if "dpt" in term.factors)
RATES = ("ph", "qh", "rh")
Columns = Mapping[str, np.ndarray]


def measured_name(column: str) -> str:
    """The log column that holds what a sensor made of a true one: `alpha_rad` is `alpha_measured_rad`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_measured_{unit}" if unit else f"{stem}_measured"


def air_name(column: str) -> str:
    """The log column of a rate relative to the turning air: `p_rad_s` is `p_air_rad_s`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_air_{unit}"


_X = tuple(f"{axis}_rad_s" for axis in AXES)
_Y = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")  # the design model's order
_TRUE = {measured_name(column): column for column in (*_X, *_Y)} | {air_name(column): column for column in _X}
_ALONE = ("t_s", "north_m", "altitude_m")
_TOGETHER = {
    "x": _X, "x_measured": tuple(map(measured_name, _X)), "x_air": tuple(map(air_name, _X)),
    "y": _Y, "y_measured": tuple(map(measured_name, _Y)),
    "u": tuple(f"{surface}_cmd_rad" for surface in SURFACES),
    "position": tuple(f"{surface}_pos_rad" for surface in SURFACES),
    "effective": tuple(f"{surface}_effective_rad" for surface in SURFACES),
    "xdot": tuple(f"{axis}dot_rad_s2" for axis in AXES),
    "attitude": ("phi_rad", "theta_rad", "psi_rad"),
    "eta_bar": tuple(f"{axis}_eta_bar_rad_s2" for axis in AXES),
    "design_mean": tuple(f"{axis}_design_rad_s2" for axis in AXES),
}  # fmt: skip
LOGGED = frozenset((*_ALONE, *(column for columns in _TOGETHER.values() for column in columns)))


@dataclass(frozen=True)
class States:
    """Frames of a flight; n of them. SI and rad.

    x, x_measured, x_air (n, 3) body rates relative to the Earth, as measured, and relative to the turning
    air; y, y_measured (n, 5) alpha, beta, V, qdyn, dpt; u, position, effective (n, 4): the command in
    effect, the actuators' output and what the aerodynamics see; xdot (n, 3) JSBSim's angular
    acceleration; attitude (n, 3) phi, theta, psi; north_m, altitude_m (n,); eta_bar, design_mean (n, 3)
    rad/s2: the bound, and f + G u as the diagnosis averaged it, over the frame that ends here.
    """

    t_s: np.ndarray
    x: np.ndarray
    x_measured: np.ndarray
    x_air: np.ndarray
    y: np.ndarray
    y_measured: np.ndarray
    u: np.ndarray
    position: np.ndarray
    effective: np.ndarray
    xdot: np.ndarray
    attitude: np.ndarray
    north_m: np.ndarray
    altitude_m: np.ndarray
    eta_bar: np.ndarray
    design_mean: np.ndarray

    def __getitem__(self, rows: slice) -> "States":
        return States(**{name: values[rows] for name, values in vars(self).items()})


def states_of(log: Columns) -> States:
    """The states in log columns (name -> (n,)). A log without a measured column measured the truth."""
    together = {
        name: np.column_stack([log[column if column in log else _TRUE[column]] for column in columns])
        for name, columns in _TOGETHER.items()
    }
    return States(**{name: log[name] for name in _ALONE}, **together)


def quantities(x: np.ndarray, y: np.ndarray, u: np.ndarray) -> dict[str, np.ndarray]:
    """What the terms multiply, (n,) each, from x (n, 3) rad/s, y (n, 5), u (n, 4) rad."""
    alpha, beta, V, _, dpt = y.T
    b, c = GEOMETRY.span_m, GEOMETRY.chord_m
    rates = {"ph": x[:, 0] * b / (2 * V), "qh": x[:, 1] * c / V, "rh": x[:, 2] * b / (2 * V)}
    return {"alpha": alpha, "beta": beta, "dpt": dpt, **rates, **dict(zip(SURFACES, u.T, strict=True))}


def weights(inertia: InertiaCoefficients, coefficient: str, qdyn: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of a unit of Cl, Cm or Cn at dynamic pressure qdyn (n,) Pa."""
    length, per_axis = {
        "Cl": (GEOMETRY.span_m, (inertia.Pl, 0.0, inertia.Rl)),
        "Cm": (GEOMETRY.chord_m, (0.0, inertia.Qm, 0.0)),
        "Cn": (GEOMETRY.span_m, (inertia.Pn, 0.0, inertia.Rn)),
    }[coefficient]
    return np.outer(qdyn * GEOMETRY.wing_area_m2 * length, per_axis)


def term(name: str, value: float, inertia: InertiaCoefficients, of: Columns, qdyn: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of one term with this coefficient."""
    regressor = prod((of[factor] for factor in TERMS[name].factors), start=np.ones_like(qdyn))
    return value * regressor[:, None] * weights(inertia, MOMENT_TERMS[name].coefficient, qdyn)


@dataclass(frozen=True)
class MomentModel:
    """Coefficient of each moment term, and the inertia coefficients: a nonlinear moment model in numbers.

    x (n, 3) rad/s, y (n, 5), u (n, 4) rad throughout; accelerations (n, 3) rad/s2.
    """

    coefficients: dict[str, float]
    inertia: InertiaCoefficients

    def acceleration(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """f + G u."""
        return inertial(self.inertia, x) + self.aerodynamic(x, y, u)

    def aerodynamic(
        self, x: np.ndarray, y: np.ndarray, u: np.ndarray, names: Iterable[str] = MOMENT_TERMS
    ) -> np.ndarray:
        """Of the moments alone, terms `names` of them."""
        of = quantities(x, y, u)
        each = (term(name, self.coefficients[name], self.inertia, of, y[:, 3]) for name in names)
        return sum(each, np.zeros((len(x), 3)))


def true_moments(scenario: Scenario) -> MomentModel:
    """The truth's moments as the scenario declares them."""
    return MomentModel(_scaled(scenario.uncertainty.coefficients), inertia_coefficients(MASS))


def designed_moments(scenario: Scenario) -> MomentModel:
    """The designer's, before freezing or linearising."""
    model = scenario.design_model
    neglected = {} if model.engine_terms else dict.fromkeys(ENGINE_TERMS, 0.0)
    return MomentModel(_scaled(model.coefficients) | neglected, inertia_coefficients(mass_of(model)))


def _scaled(ratio: Mapping[str, float]) -> dict[str, float]:
    """The table's coefficients, some of them multiplied."""
    return {name: term.value * ratio.get(name, 1.0) for name, term in MOMENT_TERMS.items()}


@dataclass(frozen=True)
class DesignModelOfFlight:
    """The design model in use: nonlinear, frozen or linearised at the designer's trim."""

    moments: MomentModel
    design: Anchored

    def acceleration(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """f + G u (n, 3) rad/s2."""
        d, m = self.design, y.shape[1]
        if d.linearised:
            away = (x - d.x0) @ d.f_x.T + (y - d.y0[:m]) @ d.f_y[:, :m].T
            return d.f0 + away + u @ d.G0.T
        if d.frozen_alpha:
            y = y.copy()
            y[:, ALPHA] = d.y0[ALPHA]
        return self.moments.acceleration(x, y, u)

    def effectiveness(self, y: np.ndarray) -> np.ndarray:
        """G (n, 3, 4) rad/s2 per rad."""
        still = np.zeros((len(y), 3))
        neutral = self.acceleration(still, y, np.zeros((len(y), 4)))
        deflected = (np.broadcast_to(one, (len(y), 4)) for one in np.eye(4))
        return np.stack([self.acceleration(still, y, u) - neutral for u in deflected], axis=-1)


def design_model_of_flight(scenario: Scenario) -> DesignModelOfFlight:
    """The scenario's design model, linearised or frozen where the designer knows the trim."""
    design = design_of(scenario.design_model)[0]
    anchor(design, *known_trim(Declared.of(scenario)))
    return DesignModelOfFlight(designed_moments(scenario), anchored(design))
