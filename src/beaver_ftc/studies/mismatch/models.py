"""A stretch of the log as arrays, and angular accelerations there: the truth's and the designer's.

The same physics as `design.model`, by another road: each term is its table entry's value times the product of
its factors, turned into an acceleration by the inertia [FDC]. Nothing is summed that one may want apart.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.aircraft import Term
from beaver_ftc.design.fdc import GEOMETRY, MASS, SURFACES, TERMS, value
from beaver_ftc.design.model import InertiaCoefficients, inertia_coefficients, inertial
from beaver_ftc.design.variants import anchor, design_of, mass_of

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

MOMENTS = ("Cl", "Cm", "Cn")
MOMENT_TERMS: dict[str, Term] = {name: term for name, term in TERMS.items() if term.coefficient in MOMENTS}
ENGINE_TERMS = tuple(name for name, term in MOMENT_TERMS.items() if "dpt" in term.factors)
RATES = ("ph", "qh", "rh")
AXES = ("p", "q", "r")
Columns = Mapping[str, np.ndarray]

_Y = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")  # the design model's order
_SURFACE_COLUMNS = tuple(f"{s}_{what}_rad" for s in SURFACES for what in ("cmd", "pos", "effective"))
_RATES = tuple(f"{axis}_rad_s" for axis in AXES)
_ATTITUDE = ("phi_rad", "theta_rad", "psi_rad")
REQUIRED = (
    "t_s", *_RATES, *_Y, *_ATTITUDE, "north_m", "altitude_m",
    *(f"{axis}dot_rad_s2" for axis in AXES), *(f"{axis}_eta_bar_rad_s2" for axis in AXES),
    *(f"{axis}_design_rad_s2" for axis in AXES), *_SURFACE_COLUMNS,
)  # fmt: skip


def measured_name(column: str) -> str:
    """The log column that holds what a sensor made of a true one: `alpha_rad` is `alpha_measured_rad`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_measured_{unit}" if unit else f"{stem}_measured"


def air_name(column: str) -> str:
    """The log column of a rate relative to the turning air: `p_rad_s` is `p_air_rad_s`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_air_{unit}"


OPTIONAL = tuple(measured_name(column) for column in (*_RATES, *_Y)) + tuple(map(air_name, _RATES))


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

    def __len__(self) -> int:
        return self.t_s.size

    def __getitem__(self, rows: slice) -> "States":
        return States(**{name: values[rows] for name, values in vars(self).items()})


def states_of(log: Columns) -> States:
    """The states in log columns (name -> (n,)). A log without a measured column measured the truth."""
    surfaces = {what: [f"{s}_{what}_rad" for s in SURFACES] for what in ("cmd", "pos", "effective")}
    return States(
        t_s=log["t_s"],
        x=_stack(log, _RATES),
        x_measured=_stack(log, _present(log, _RATES, measured_name)),
        x_air=_stack(log, _present(log, _RATES, air_name)),
        y=_stack(log, _Y),
        y_measured=_stack(log, _present(log, _Y, measured_name)),
        u=_stack(log, surfaces["cmd"]),
        position=_stack(log, surfaces["pos"]),
        effective=_stack(log, surfaces["effective"]),
        xdot=_stack(log, [f"{axis}dot_rad_s2" for axis in AXES]),
        attitude=_stack(log, _ATTITUDE),
        north_m=log["north_m"],
        altitude_m=log["altitude_m"],
        eta_bar=_stack(log, [f"{axis}_eta_bar_rad_s2" for axis in AXES]),
        design_mean=_stack(log, [f"{axis}_design_rad_s2" for axis in AXES]),
    )


def _stack(log: Columns, names: Iterable[str]) -> np.ndarray:
    return np.column_stack([log[name] for name in names])


def _present(log: Columns, names: Iterable[str], other) -> list[str]:
    return [other(name) if other(name) in log else name for name in names]


def joined(held: Columns | None, chunk: Columns) -> Columns:
    """Columns one after the other; `held` None is nothing."""
    return chunk if held is None else {name: np.concatenate([held[name], chunk[name]]) for name in chunk}


def last_row(log: Columns) -> Columns:
    """The last row, as columns of one; a copy, so that the rest can go."""
    return {name: values[-1:].copy() for name, values in log.items()}


def quantities(x: np.ndarray, y: np.ndarray, u: np.ndarray) -> dict[str, np.ndarray]:
    """What the terms multiply, (n,) each, from x (n, 3) rad/s, y (n, 5), u (n, 4) rad."""
    alpha, beta, V, _, dpt = y.T
    b, c = GEOMETRY.span_m, GEOMETRY.chord_m
    rates = {"ph": x[:, 0] * b / (2 * V), "qh": x[:, 1] * c / V, "rh": x[:, 2] * b / (2 * V)}
    return {"alpha": alpha, "beta": beta, "dpt": dpt, **rates, **dict(zip(SURFACES, u.T, strict=True))}


def regressor(name: str, of: Mapping[str, np.ndarray]) -> np.ndarray:
    """What one term multiplies, (n,): the product of its factors."""
    product = np.ones_like(of["alpha"])
    for factor in TERMS[name].factors:
        product = product * of[factor]
    return product


def weights(inertia: InertiaCoefficients, coefficient: str, qdyn: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of a unit of Cl, Cm or Cn at dynamic pressure qdyn (n,) Pa."""
    per_axis = {
        "Cl": (inertia.Pl, 0.0, inertia.Rl),
        "Cm": (0.0, inertia.Qm, 0.0),
        "Cn": (inertia.Pn, 0.0, inertia.Rn),
    }[coefficient]
    length = GEOMETRY.chord_m if coefficient == "Cm" else GEOMETRY.span_m
    return np.outer(qdyn * GEOMETRY.wing_area_m2 * length, per_axis)


def term(name: str, value: float, inertia: InertiaCoefficients, of: Mapping, qdyn: np.ndarray) -> np.ndarray:
    """The angular acceleration (n, 3) rad/s2 of one term with this coefficient."""
    return value * regressor(name, of)[:, None] * weights(inertia, MOMENT_TERMS[name].coefficient, qdyn)


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


def true_moments(scenario: "Scenario") -> MomentModel:
    """The truth's moments as the scenario declares them."""
    ratio = scenario.uncertainty.coefficients
    return MomentModel(
        {name: value(name) * ratio.get(name, 1.0) for name in MOMENT_TERMS},
        inertia_coefficients(MASS),
    )


def designed_moments(scenario: "Scenario") -> MomentModel:
    """The designer's, before freezing or linearising."""
    model = scenario.design_model
    neglected = () if model.engine_terms else ENGINE_TERMS
    return MomentModel(
        {
            name: 0.0 if name in neglected else value(name) * model.coefficients.get(name, 1.0)
            for name in MOMENT_TERMS
        },
        inertia_coefficients(mass_of(model)),
    )


@dataclass(frozen=True)
class Belief:
    """The design model in use: nonlinear, frozen or linearised at the trim of the first frame."""

    moments: MomentModel
    design: np.void

    def acceleration(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """f + G u (n, 3) rad/s2."""
        if self.design["linearised"]:
            return self._linear(x, y, u)
        return self.moments.acceleration(x, self._seen(y), u)

    def effectiveness(self, y: np.ndarray) -> np.ndarray:
        """G (n, 3, 4) rad/s2 per rad."""
        still, unit = np.zeros((len(y), 3)), np.eye(4)
        neutral = self.acceleration(still, y, np.zeros((len(y), 4)))
        columns = [
            self.acceleration(still, y, np.broadcast_to(unit[s], (len(y), 4))) - neutral for s in range(4)
        ]
        return np.stack(columns, axis=-1)

    def _seen(self, y: np.ndarray) -> np.ndarray:
        if not self.design["frozen_alpha"]:
            return y
        frozen = y.copy()
        frozen[:, 0] = self.design["y0"][0]
        return frozen

    def _linear(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        d = self.design
        away = (x - d["x0"]) @ d["f_x"].T + (y - d["y0"][: y.shape[1]]) @ d["f_y"][:, : y.shape[1]].T
        return d["f0"] + away + u @ d["G0"].T


def belief_of(scenario: "Scenario", trim: States) -> Belief:
    """The scenario's design model; `trim` is the flight's first frame, where it was linearised."""
    design = design_of(scenario.design_model)[0]
    anchor(design, trim.x[0], trim.y[0], trim.u[0])
    return Belief(designed_moments(scenario), design)
