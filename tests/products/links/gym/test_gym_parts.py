"""What a step of the environment sees and costs, in the units that its docstring says."""

import numpy as np
import pytest

pytest.importorskip("gymnasium")
from beaver_ftc.loop.loop import fly
from beaver_ftc_links.gym import BeaverEnv, Episode
from flying import Memory, scenario

STILL = np.zeros(4)


class Still:
    """A law that leaves the surfaces at their trim, as an action of zeros does."""

    def reset(self, context):
        self.context = context

    def step(self, measured, reference, verdict):
        return self.context.trim_rad.copy()


def test_what_a_step_sees_and_costs_is_in_the_log():
    """In the units of the environment's docstring, of rates that roll and pitch move."""
    flown = scenario(duration_s=1.0, sensors={"q": {"bias_deg_s": 0.3}, "alpha": {"bias_deg": 0.2}})
    log = Memory()
    fly(flown, log, law=Still())
    env = BeaverEnv(flown)
    seen = [env.reset()[0]]
    rewards = []
    for _ in range(98):
        row, reward, *_ = env.step(STILL)
        seen.append(row)
        rewards.append(reward)
    seen = np.array(seen)
    measured, model = (
        np.column_stack([log[f"{axis}_{what}_rad_s"] for axis in "pqr"])[:99]
        for what in ("measured", "model")
    )
    np.testing.assert_allclose(seen[:, :3], measured / 0.1, atol=1e-9)
    np.testing.assert_allclose(seen[:, 6:9], model / 0.1, atol=1e-9)
    np.testing.assert_allclose(seen[:, 9:12], (model - measured) / 0.1, atol=1e-9)
    np.testing.assert_allclose(rewards, -0.01 * (((model - measured) / 0.1) ** 2).sum(axis=1)[1:], rtol=1e-9)
    for place, name, unit in ((3, "alpha_rad", 0.1), (4, "beta_rad", 0.1), (5, "airspeed_mps", 10.0)):
        column = log[name][:99]
        np.testing.assert_allclose(seen[:, place], (column - column[0]) / unit, atol=1e-9)
    assert np.abs(seen[:, 12:]).max() == 0.0
    assert [np.ptp(seen[:, place]) > 0.0 for place in range(12)] == [True] * 12


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
