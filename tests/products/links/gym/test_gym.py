"""The Gymnasium environment: the checker's rules, and that it is the same aircraft as in a flight."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from flying import scenario

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from beaver_ftc_links.environments import ID  # noqa: E402
from beaver_ftc_links.gym import BeaverEnv  # noqa: E402

FAULT = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 0.5}


@pytest.mark.filterwarnings("error::UserWarning")
def test_it_keeps_gymnasiums_rules():
    check_env(gymnasium.make(ID, scenario="fault-free").unwrapped, skip_render_check=True)


def _action(k):
    return np.array([0.0, 0.02 * np.sin(0.05 * k), 0.0, 0.0])


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
