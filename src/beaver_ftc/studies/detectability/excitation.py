"""What a healthy flight excites: the moment of each surface, frame by frame, against the declared bound."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.design.model import AXES, N_Y, control_effectiveness
from beaver_ftc.design.variants import design_of
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.columns import Columns

SETTLED_S = 2.0  # the start of a reference is a step of its own


@dataclass(frozen=True)
class Excitation:
    """Along a flight of n frames: the moment of each surface that leads an axis, (n, 3) rad/s2 by its name,
    the bound on the uncertainty (n, 3) rad/s2, and the length of a frame dt s.
    """

    moment: Mapping[str, np.ndarray]
    bound: np.ndarray
    dt: float


def excitation(scenario: Scenario) -> Excitation:
    """Fly the scenario without its faults and weigh what the surfaces did with the design model.

    Raises BadInput when it cannot be trimmed, SimulationFailed when the flight ends before it has settled.
    """
    log = Columns()
    fly(scenario.model_copy(update={"faults": ()}), log)
    aircraft = scenario.airframe
    y = np.zeros((len(log.read("t_s")), N_Y))
    seen = log.read("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", *aircraft.signals)
    y[:, : seen.shape[1]] = seen
    u = log.read(*(f"{surface}_cmd_rad" for surface in aircraft.surfaces))
    bound = log.read(*(f"{axis}_eta_bar_rad_s2" for axis in AXES))
    design, G = design_of(scenario.design_model, aircraft)[0], np.zeros((len(y), 3, aircraft.n))
    for row, at in zip(y, G, strict=True):
        control_effectiveness(design, row, at)
    first = int(SETTLED_S * scenario.rate_hz)
    moment = (G * u[:, None, :])[first:]
    of = {name: moment[:, :, aircraft.surfaces.index(name)] for name in aircraft.primary}
    return Excitation(of, bound[first:], 1.0 / scenario.rate_hz)
