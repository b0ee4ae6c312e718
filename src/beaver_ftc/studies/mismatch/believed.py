"""What the designer believes and what the truth is made of, as numbers, and for many frames at once."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.design.coefficients import MASS, InertiaCoefficients, inertia_coefficients, value
from beaver_ftc.design.variants import anchor, design_of, mass_of
from beaver_ftc.studies.mismatch import moments
from beaver_ftc.studies.mismatch.states import States

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario


@dataclass(frozen=True)
class Parts:
    """Coefficient of each moment term, and the inertia coefficients: a nonlinear moment model in numbers."""

    coefficients: dict[str, float]
    inertia: InertiaCoefficients

    def acceleration(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """f + G u (n, 3) rad/s2 at x (n, 3) rad/s, y (n, 5), u (n, 4) rad."""
        of = moments.quantities(x, y, u)
        return moments.inertial(self.inertia, x) + moments.aerodynamic(
            self.coefficients, self.inertia, of, y[:, 3]
        )


def true_parts(scenario: "Scenario") -> Parts:
    """The truth's moments as the scenario declares them."""
    ratio = scenario.uncertainty.coefficients
    return Parts(
        {name: value(name) * ratio.get(name, 1.0) for name in moments.MOMENT_TERMS},
        inertia_coefficients(MASS),
    )


def designed_parts(scenario: "Scenario") -> Parts:
    """The designer's, before freezing or linearising."""
    model = scenario.design_model
    neglected = () if model.engine_terms else moments.ENGINE_TERMS
    return Parts(
        {
            name: 0.0 if name in neglected else value(name) * model.coefficients.get(name, 1.0)
            for name in moments.MOMENT_TERMS
        },
        inertia_coefficients(mass_of(model)),
    )


@dataclass(frozen=True)
class Belief:
    """The design model in use: nonlinear, frozen or linearised at the trim of the first frame."""

    parts: Parts
    design: np.void

    def acceleration(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """f + G u (n, 3) rad/s2; arguments as in `Parts.acceleration`."""
        if self.design["linearised"]:
            return self._linear(x, y, u)
        return self.parts.acceleration(x, self._seen(y), u)

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
    return Belief(designed_parts(scenario), design)
