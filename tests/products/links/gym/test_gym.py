"""The Gymnasium environment: the checker's rules, and that it is the same aircraft as in a flight."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from flying import Memory, scenario

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from beaver_ftc_links.environments import ID  # noqa: E402
from beaver_ftc_links.gym import BeaverEnv  # noqa: E402

FAULT = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 0.5}


@pytest.mark.filterwarnings("error::UserWarning")
def test_it_keeps_gymnasiums_rules():
    check_env(gymnasium.make(ID, scenario="fault-free").unwrapped, skip_render_check=True)


class _Wave:
    """A law that does what the actions of the test do."""

    def reset(self, context):
        self.context, self.k = context, 0

    def step(self, measured, reference, verdict):
        self.k += 1
        low, high = self.context.travel_rad
        share, trim = _action(self.k)[1], self.context.trim_rad.copy()
        trim[1] += share * (trim[1] - low[1] if share < 0 else high[1] - trim[1])
        return trim


def _action(k):
    return np.array([0.0, 0.02 * np.sin(0.05 * k), 0.0, 0.0])


def test_an_episode_is_a_flight():
    flown = scenario(duration_s=2, faults=[FAULT])
    log = Memory()
    fly(flown, log, law=_Wave())
    env = BeaverEnv(flown)
    seen, _ = env.reset()
    rows = [seen]
    over = False
    while not over:
        seen, _, departed, over, info = env.step(_action(len(rows)))
        rows.append(seen)
    assert not departed
    assert len(rows) == 200
    assert np.array(rows)[:, 1] * 0.1 == pytest.approx(log["q_rad_s"], abs=1e-12)
    assert info["metrics"]["frames"] == 200
    assert info["metrics"]["fault"]["actuator"] == "elevator"


def test_an_action_held_over_frames_is_the_same_given_frame_by_frame():
    flown = scenario(duration_s=2, faults=[FAULT])
    one, ten = BeaverEnv(flown), BeaverEnv(flown, frames_per_step=10)
    one.reset()
    ten.reset()
    for k in range(1, 20):
        action = _action(10 * k)
        singles = [one.step(action) for _ in range(10)]
        seen, reward, departed, over, _ = ten.step(action)
        assert np.array_equal(seen, singles[-1][0])
        assert reward == pytest.approx(sum(single[1] for single in singles), rel=1e-12)
        assert not departed
        assert not over
    *_, over, info = ten.step(_action(1))
    assert over
    assert info["metrics"]["frames"] == 200


def test_episodes_after_a_seeded_one_differ_and_follow_from_the_seed():
    noisy = scenario(duration_s=2, sensors={"q": {"noise_std_deg_s": 0.1}})
    one, again = BeaverEnv(noisy), BeaverEnv(noisy)
    seen = [[env.reset(seed=seed)[0] for seed in (5, None, None)] for env in (one, again)]
    assert np.array_equal(*seen)
    assert not np.array_equal(seen[0][0], seen[0][1])
    assert not np.array_equal(seen[0][1], seen[0][2])


@pytest.mark.parametrize("action", [[0.0, np.nan, 0.0, 0.0], [0.0, 0.0], [[0.0] * 4]])
def test_an_action_that_is_none_is_said(action):
    env = BeaverEnv(scenario(duration_s=1))
    env.reset()
    with pytest.raises(BadInput, match=r"action: .* allowed: (4 )?finite numbers"):
        env.step(np.array(action))
    seen, *_ = env.step(np.zeros(4))  # and the flight goes on
    assert env.observation_space.contains(seen)


def test_stepping_before_reset_is_said():
    with pytest.raises(gymnasium.error.ResetNeeded):
        BeaverEnv(scenario(duration_s=1)).step(np.zeros(4))
