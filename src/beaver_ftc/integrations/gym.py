"""The Beaver as a Gymnasium environment, for those who learn laws; wants the extra `gym`.

    env = gymnasium.make(
        "beaver_ftc.integrations.gym:beaver_ftc/Beaver-v0", scenario="fault-free", frames_per_step=5
    )

Gymnasium imports what stands before the colon, and with it registers the name behind it.
The plant, the faults, the reference model and the accounts are those of a flight: what is learnt can be
plugged in afterwards as a law, and compared with the others.
"""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from beaver_ftc.aircraft import load as aircraft
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.agent import BESIDE_SURFACES, LARGEST, LOOK, act, cost, observe
from beaver_ftc.loop.direct import direct
from beaver_ftc.results.simulation import Simulation
from beaver_ftc.scenario.given import ScenarioLike, load
from beaver_ftc.scenario.schema import Scenario

ID = "beaver_ftc/Beaver-v0"
DEPARTURE = -100.0
NOBODY = {"control.law": "nominal", "control.options": {}}  # the surfaces are the agent's

Vector = NDArray[np.float64]


class Episode(Simulation):
    """A flight of an agent, frame 0 flown: its actions, its observations, what its steps cost."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario, log=False)

    def _make_ready(self) -> None:
        super()._make_ready()
        self._cost = 0.0
        frames, log = self._loop.frames, self._loop.log
        self._look = np.zeros(1, LOOK)
        self._look["measured"], self._look["model"] = (
            self.columns.index(f"p_{what}_rad_s") for what in ("measured", "model")
        )
        self._size = int(frames["held_rad"].size)
        seen = np.empty(0)
        self._acts = direct(act, frames, seen)
        self._costs = direct(cost, frames, log, self._look)
        self._observes = direct(observe, frames, log, self._look, seen)
        self._begin()
        for name, value in zip(("alpha", "beta", "airspeed"), self.measured.y, strict=False):
            self._look[name] = value

    def act(self, action: ArrayLike, frames: int) -> float:
        """Fly so many frames, or to the end, with an action (surfaces,) held; returns what they cost."""
        shares = np.ascontiguousarray(action, np.float64)
        if shares.shape != (self._size,) or not self._acts(self._loop.frames, shares):
            raise BadInput(f"action: {action!r:.80} is not usable, allowed: {self._size} finite numbers")
        self._cost, self._by_hand = 0.0, True
        self._fly_to(min(self._next + frames, self._loop.n_frames))
        return self._cost

    def _note(self, rows: Vector) -> None:
        self._cost += self._costs(self._loop.frames, rows, self._look)

    def observation(self) -> Vector:
        """What is seen of the frame just flown, (12 + surfaces,); an array of its own."""
        seen = np.empty(BESIDE_SURFACES + self._size)
        self._observes(self._loop.frames, self._loop.log, self._look, seen)
        return seen


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
        if not isinstance(frames_per_step, int) or frames_per_step < 1:
            raise BadInput(
                f"frames_per_step: {frames_per_step!r} is out of range, allowed: a whole number of at least 1"
            )
        self.frames_per_step = frames_per_step
        surfaces = len(aircraft(self.scenario.aircraft).surfaces)
        seen = (BESIDE_SURFACES + surfaces,)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (surfaces,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-LARGEST, LARGEST, seen, np.float64)
        self._episode: Episode | None = None
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Put the aircraft in trim. A seed replaces the scenario's, and those of the episodes to come follow
        from it; without any they all have the scenario's."""
        super().reset(seed=seed)
        self._seeded |= seed is not None
        if seed is None and self._seeded:
            seed = int(self.np_random.integers(2**31))
        if self._episode is None:
            self._episode = Episode(self.scenario if seed is None else self.scenario.with_({"seed": seed}))
        else:
            self._episode.reset(seed=seed)  # the aircraft is not loaded again
        return self._episode.observation(), {}

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Command the surfaces, fly, look."""
        episode = self._episode
        if episode is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        reward = -episode.act(action, self.frames_per_step)
        if not episode.done:
            return episode.observation(), reward, False, False, {}
        departed = episode.departed
        info = {"metrics": episode.land().metrics}
        return episode.observation(), reward + DEPARTURE * departed, departed, not departed, info


gymnasium.register(
    id=ID,
    entry_point="beaver_ftc.integrations.gym:BeaverEnv",
    vector_entry_point="beaver_ftc.integrations.gym_vector:BeaverVectorEnv",
)
