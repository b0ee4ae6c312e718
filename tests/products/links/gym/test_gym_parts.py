"""What a step of the environment sees and costs, in the units that its docstring says."""

import numpy as np
import pytest

pytest.importorskip("gymnasium")
from beaver_ftc.loop.loop import fly
from beaver_ftc_links.gym import BeaverEnv, Episode
from flying import Memory, scenario


def action(k):
    return np.array([0.0, 0.02 * np.sin(0.05 * k), 0.0, 0.0])


class Wave:
    """A law that does what the actions of the test do."""

    def reset(self, context):
        self.context, self.k = context, 0

    def step(self, measured, reference, verdict):
        self.k += 1
        low, high = self.context.travel_rad
        share, trim = action(self.k)[1], self.context.trim_rad.copy()
        trim[1] += share * (trim[1] - low[1] if share < 0 else high[1] - trim[1])
        return trim


def test_what_a_step_sees_and_costs_is_in_the_log():
    """In the units of the environment's docstring, to the end of the flight."""
    fault = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 0.5}
    flown = scenario(
        duration_s=1.0, sensors={"q": {"bias_deg_s": 0.3}, "alpha": {"bias_deg": 0.2}}, faults=[fault]
    )
    log, env, over = Memory(), BeaverEnv(flown), False
    fly(flown, log, law=Wave())
    seen, rewards = [env.reset()[0]], []
    while not over:
        row, reward, departed, over, info = env.step(action(len(seen)))
        seen.append(row)
        rewards.append(reward)
        assert not departed
    assert (len(seen), info["metrics"]["frames"]) == (100, 100)
    assert info["metrics"]["fault"]["actuator"] == "elevator"
    seen, rows = np.array(seen)[:99], slice(0, 99)
    measured, model = (
        np.column_stack([log[f"{axis}_{what}_rad_s"] for axis in "pqr"])[rows] / 0.1
        for what in ("measured", "model")
    )
    np.testing.assert_allclose(seen[:, :3], measured, atol=1e-9)
    np.testing.assert_allclose(seen[:, 6:12], np.hstack([model, model - measured]), atol=1e-9)
    np.testing.assert_allclose(rewards[:98], -0.01 * ((model - measured) ** 2).sum(axis=1)[1:], rtol=1e-9)
    for place, name, unit in ((3, "alpha_rad", 0.1), (4, "beta_rad", 0.1), (5, "airspeed_mps", 10.0)):
        column = log[name][rows]
        np.testing.assert_allclose(seen[:, place], (column - column[0]) / unit, atol=1e-9)
    assert (np.ptp(seen[:, :12], axis=0) > 0.0).all()


def test_a_departure_costs_a_hundred():
    flown = scenario(duration_s=20)
    env, action = BeaverEnv(flown, 25), np.array([0.0, -1.0, 0.0, 0.0])
    env.reset()
    alone = Episode(env.scenario, log=False)
    departed, reward = False, 0.0
    while not departed:
        _, reward, departed, over, _ = env.step(action)
        cost = alone.act(action, 25)
        assert reward == pytest.approx(-cost - 100.0 * departed)
        assert not over
