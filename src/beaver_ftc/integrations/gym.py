"""The Beaver as a Gymnasium environment, for those who learn laws; wants the extra `gym`.

    env = gymnasium.make("beaver_ftc/Beaver-v0", scenario="elevator-partial-loss")

The plant, the faults, the reference model and the accounts are those of a flight: what is learnt can be
plugged in afterwards as a law, and compared with the others.
"""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from beaver_ftc.control.base import Reference
from beaver_ftc.design.context import Context
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.base import Measured, Verdict
from beaver_ftc.loop.frame import FLYING
from beaver_ftc.loop.loop import Loop
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.loader import load_scenario
from beaver_ftc.scenario.schema import Scenario

ID = "beaver_ftc/Beaver-v0"
RATE_RAD_S = 0.1  # tracking error that costs one unit of reward a second
DEPARTURE = -100.0
AIRSPEED_MPS = 10.0
ANGLE_RAD = 0.1
LARGEST = 100.0  # of an observation: a departure is at 60


class Pilot:
    """The law in the loop: remembers what it is shown; the surfaces stay as the environment has set them."""

    def reset(self, context: Context) -> None:
        """Trimmed surfaces."""
        self.context = context
        self.deflections = context.trim_rad.copy()

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Look, and hold."""
        self.measured, self.reference, self.verdict = measured, reference, verdict
        return self.deflections

    def observation(self) -> np.ndarray:
        """What the environment shows of it; see BeaverEnv."""
        measured, reference, trim_y = self.measured, self.reference, self.context.trim_y
        y = measured.y
        seen = np.concatenate(
            (
                measured.x / RATE_RAD_S,
                (y[[ALPHA, BETA]] - trim_y[[ALPHA, BETA]]) / ANGLE_RAD,
                [(y[AIRSPEED] - trim_y[AIRSPEED]) / AIRSPEED_MPS],
                reference.rate / RATE_RAD_S,
                self.error() / RATE_RAD_S,
                (self.deflections - self.context.trim_rad) / ANGLE_RAD,
            )
        )
        return np.clip(seen, -LARGEST, LARGEST)

    def error(self) -> np.ndarray:
        """Tracking error (3,), rad/s."""
        return self.reference.rate - self.measured.x

    def deflect(self, action: np.ndarray) -> np.ndarray:
        """From an action in [-1, 1] to deflections (4,) rad: 0 is the trim, -1 and 1 are the stops."""
        low, high = self.context.travel_rad
        trim, action = self.context.trim_rad, np.clip(action, -1.0, 1.0)
        self.deflections = trim + np.where(action < 0.0, action * (trim - low), action * (high - trim))
        return self.deflections


class BeaverEnv(gymnasium.Env):
    """One flight an episode, one frame a step; the scenario's diagnosis watches.

    Action (4,) in [-1, 1]: each surface from its trim (0) to its lower or upper stop. Observation (16,): p,
    q, r over 0.1 rad/s; alpha and beta less trim over 0.1 rad; airspeed less trim over 10 m/s; the
    reference model's rates and the tracking error over 0.1 rad/s; the deflections less trim over 0.1 rad.
    Reward: minus the squared tracking error in units of 0.1 rad/s, times the frame's length in s; a
    departure costs 100 and ends the episode. `info["metrics"]` of the last step is the document metrics.json.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  (the name and form Gymnasium looks for)

    def __init__(self, scenario: str | Path | Scenario = "fault-free") -> None:
        self.scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-LARGEST, LARGEST, (16,), np.float64)
        self._loop: Loop | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Put the aircraft in trim; a seed replaces the scenario's."""
        super().reset(seed=seed)
        scenario = self.scenario if seed is None else self.scenario.model_copy(update={"seed": seed})
        self._pilot = Pilot()
        self._loop = Loop(scenario, law=self._pilot)
        self._loop.fly_chunk(0, 1)
        self._k = 1
        return self._pilot.observation(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Command the surfaces, fly one frame, look."""
        loop = self._loop
        if loop is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        loop.command_instead(self._pilot.deflect(np.asarray(action, dtype=float)))
        departed = loop.fly_chunk(self._k, 1) != FLYING
        self._k += 1
        over = self._k >= loop.n_frames and not departed
        info = {"metrics": metrics(loop.land())} if departed or over else {}
        return self._pilot.observation(), self._reward(departed), departed, over, info

    def _reward(self, departed: bool) -> float:
        error = self._pilot.error() / RATE_RAD_S
        return -float(error @ error) * self._pilot.context.dt_s + (DEPARTURE if departed else 0.0)


gymnasium.register(id=ID, entry_point="beaver_ftc.integrations.gym:BeaverEnv")
