"""The Beaver as a Gymnasium environment, for those who learn laws; wants the extra `gym`.

    env = gymnasium.make("beaver_ftc/Beaver-v0", scenario="elevator-partial-loss", frames_per_step=5)

The plant, the faults, the reference model and the accounts are those of a flight: what is learnt can be
plugged in afterwards as a law, and compared with the others.
"""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from beaver_ftc.aircraft import load as aircraft
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA
from beaver_ftc.results.simulation import Simulation
from beaver_ftc.scenario.given import ScenarioLike, load

ID = "beaver_ftc/Beaver-v0"
RATE_RAD_S = 0.1  # tracking error that costs one unit of reward a second
DEPARTURE = -100.0
AIRSPEED_MPS = 10.0
ANGLE_RAD = 0.1
LARGEST = 100.0  # of an observation: a departure is at 60
NOBODY = {"control.law": "nominal", "control.options": {}}  # the surfaces are the agent's

Vector = NDArray[np.float64]


class BeaverEnv(gymnasium.Env[Vector, Vector]):
    """One flight an episode, so many frames a step; the scenario's diagnosis watches.

    Action (surfaces,) in [-1, 1]: each surface from its trim (0) to its lower or upper stop, held over the
    step. Observation (12 + surfaces,), after the step: p, q, r over 0.1 rad/s; alpha and beta less trim over
    0.1 rad; airspeed less trim over 10 m/s; the reference model's rates and the tracking error over
    0.1 rad/s; the deflections less trim over 0.1 rad. Reward: minus the squared tracking error in units of
    0.1 rad/s, times the frame's length in s, summed over the frames; a departure costs 100 and ends the
    episode.
    `info["metrics"]` of the last step is the document metrics.json.

    scenario: a name, a path, a mapping or a Scenario. frames_per_step: how long an action is held.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  (the name and form Gymnasium looks for)

    def __init__(self, scenario: ScenarioLike = "fault-free", frames_per_step: int = 1) -> None:
        self.scenario = load(scenario).with_(NOBODY)
        self.frames_per_step = frames_per_step
        surfaces = len(aircraft(self.scenario.aircraft).surfaces)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (surfaces,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-LARGEST, LARGEST, (12 + surfaces,), np.float64)
        self._sim: Simulation | None = None
        self._seed: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Put the aircraft in trim; a seed replaces the scenario's."""
        super().reset(seed=seed)
        if self._sim is not None and seed == self._seed:
            self._sim.reset()  # the aircraft is not loaded again
        else:
            scenario = self.scenario if seed is None else self.scenario.with_({"seed": seed})
            self._sim, self._seed = Simulation(scenario, log=False), seed
        sim = self._sim
        self._deflections = sim.trim_rad
        self._trim_y = sim.measured.y
        self._columns = _places(sim.columns)
        return self._observation(sim), {}

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Command the surfaces, fly, look."""
        sim = self._sim
        if sim is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        self._deflections = _deflections(sim, np.asarray(action, dtype=float))
        flown = sim.frames
        sim.step(self._deflections, frames=self.frames_per_step)
        rows = sim.rows[-(sim.frames - flown) :]
        over = sim.done and not sim.departed
        info = {"metrics": sim.land().metrics} if sim.done else {}
        return self._observation(sim), self._reward(rows, sim), sim.departed, over, info

    def _reward(self, rows: Vector, sim: Simulation) -> float:
        rate, wanted = (rows[:, places] for places in self._columns)
        errors = (wanted - rate) / RATE_RAD_S
        return -float((errors**2).sum()) / sim.rate_hz + (DEPARTURE if sim.departed else 0.0)

    def _observation(self, sim: Simulation) -> Vector:
        y, trim_y = sim.measured.y, self._trim_y
        rate, wanted = (sim.values[places] for places in self._columns)
        seen = np.concatenate(
            (
                rate / RATE_RAD_S,
                (y[[ALPHA, BETA]] - trim_y[[ALPHA, BETA]]) / ANGLE_RAD,
                [(y[AIRSPEED] - trim_y[AIRSPEED]) / AIRSPEED_MPS],
                wanted / RATE_RAD_S,
                (wanted - rate) / RATE_RAD_S,
                (self._deflections - sim.trim_rad) / ANGLE_RAD,
            )
        )
        clipped: Vector = np.clip(seen, -LARGEST, LARGEST)
        return clipped


def _places(columns: tuple[str, ...]) -> tuple[list[int], list[int]]:
    """Where a row of the log has the measured rates and the reference model's."""
    names = ([f"{axis}_{what}_rad_s" for axis in "pqr"] for what in ("measured", "model"))
    measured, model = ([columns.index(name) for name in axes] for axes in names)
    return measured, model


def _deflections(sim: Simulation, action: Vector) -> Vector:
    """From an action in [-1, 1] to deflections (surfaces,) rad: 0 is the trim, -1 and 1 are the stops."""
    trim, (low, high) = sim.trim_rad, sim.travel_rad
    action = np.clip(action, -1.0, 1.0)
    wanted: Vector = trim + np.where(action < 0.0, action * (trim - low), action * (high - trim))
    return wanted


gymnasium.register(id=ID, entry_point="beaver_ftc.integrations.gym:BeaverEnv")
