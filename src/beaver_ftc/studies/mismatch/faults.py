"""What each declared fault does to the angular acceleration, weighed with the design's G as in theory.

A loss of effectiveness is what it takes from the surface where the surface is: the product of all losses,
taken one after the other. A fault of the mechanism (jam, runaway, bias, ...) is the way from where the
healthy actuator would be to where the surface is; of several on one surface at once the latest to strike
has it. The unanticipated one is its own moment.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.design.coefficients import GEOMETRY, SURFACES
from beaver_ftc.studies.mismatch.believed import Belief
from beaver_ftc.studies.mismatch.states import States

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

TIME_TOLERANCE_S = 1e-9
Effects = dict[str, np.ndarray]


def fault_effects(scenario: "Scenario", belief: Belief, states: States, healthy: np.ndarray) -> Effects:
    """The angular acceleration (n, 3) rad/s2 of each fault; healthy (n, 4) rad is where they found it."""
    G = belief.effectiveness(states.y)
    effects: Effects = {}
    for name, fault, moved in _deflections(scenario, states, healthy):
        s = SURFACES.index(fault.actuator)
        effects[name] = effects.get(name, 0.0) + G[:, :, s] * moved[:, None]
    for name, fault in named(scenario):
        if fault.type == "unanticipated":
            effects[name] = unanticipated(fault, belief, states)
    return effects


def named(scenario: "Scenario") -> list[tuple[str, Any]]:
    """Each fault under a name of its own: surface, type and time."""
    return [(_name(fault), fault) for fault in scenario.faults]


def _name(fault: Any) -> str:
    place = " ".join(str(getattr(fault, key)) for key in ("sensor", "actuator") if hasattr(fault, key))
    return f"{place} {fault.type.replace('_', ' ')} at {fault.at_s:g} s".strip()


def in_force(fault: Any, t_s: np.ndarray) -> np.ndarray:
    """Whether a fault is there, (n,) bool."""
    end_s = np.inf if fault.end_s is None else fault.end_s
    return (t_s >= fault.at_s - TIME_TOLERANCE_S) & (t_s < end_s - TIME_TOLERANCE_S)


def share(fault: Any, t_s: np.ndarray) -> np.ndarray:
    """B(t - T0) (n,): how far a fault has grown, 0 where it is not there [Zhang2005]."""
    age = np.maximum(t_s - fault.at_s, 0.0)
    grown = 1.0 - np.exp(-fault.kappa_per_s * age) if fault.profile == "incipient" else 1.0
    return np.where(in_force(fault, t_s), grown, 0.0)


def unanticipated(fault: Any, belief: Belief, states: States) -> np.ndarray:
    """The extra pitching moment on alpha^3 as an acceleration (n, 3) rad/s2 [Zhang2005]."""
    moment = states.y[:, 3] * GEOMETRY.wing_area_m2 * GEOMETRY.chord_m * states.y[:, 0] ** 3
    pitch = fault.Cm_alpha3 * share(fault, states.t_s) * belief.parts.inertia.Qm * moment
    return np.column_stack([0.0 * pitch, pitch, 0.0 * pitch])


def _deflections(
    scenario: "Scenario", states: States, healthy: np.ndarray
) -> Iterator[tuple[str, Any, np.ndarray]]:
    """(name, fault, what it moves the effective deflection by (n,) rad) for every fault of a surface."""
    for s, surface in enumerate(SURFACES):
        here = [(name, fault) for name, fault in named(scenario) if getattr(fault, "actuator", "") == surface]
        losses = [item for item in here if item[1].type == "loss_of_effectiveness"]
        mechanical = [item for item in here if item[1].type != "loss_of_effectiveness"]
        yield from _lost(losses, states, states.position[:, s])
        yield from _displaced(mechanical, states.t_s, states.position[:, s] - healthy[:, s])


def _lost(losses: list, states: States, position: np.ndarray) -> Iterator[tuple[str, Any, np.ndarray]]:
    left = np.ones_like(position)
    for name, fault in losses:
        taken = left * fault.magnitude * share(fault, states.t_s)
        left = left - taken
        yield name, fault, -taken * position


def _displaced(faults: list, t_s: np.ndarray, way: np.ndarray) -> Iterator[tuple[str, Any, np.ndarray]]:
    """Who struck last has the displacement, also what lingers after a repair."""
    order = sorted(faults, key=lambda item: item[1].at_s)
    struck = [t_s >= fault.at_s - TIME_TOLERANCE_S for _, fault in order]
    there = [in_force(fault, t_s) for _, fault in order]
    owner = np.full(t_s.size, -1)
    for of in (struck, there):  # who is there now goes before who has been
        for i, mask in enumerate(of):
            owner[mask] = i
    for i, (name, fault) in enumerate(order):
        yield name, fault, np.where(owner == i, way, 0.0)
