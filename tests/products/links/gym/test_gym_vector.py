"""The vector environment: Gymnasium's own, in this process alone, says what each step must be."""

import os
import signal

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from flying import scenario

gymnasium = pytest.importorskip("gymnasium")

from beaver_ftc_links.environments import ID  # noqa: E402
from beaver_ftc_links.gym import BeaverEnv, BeaverVectorEnv  # noqa: E402

FLOWN = {
    "duration_s": 0.5,
    "sensors": {"q": {"noise_std_deg_s": 0.1}},
    "faults": [{"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 0.2}],
}
FRAMES = 5


@pytest.fixture(scope="module")
def three():
    """Three environments in two processes, as anyone gets them."""
    given = {"scenario": scenario(**FLOWN), "frames_per_step": FRAMES, "workers": 2}
    made = gymnasium.make_vec(ID, num_envs=3, **given)
    yield made
    made.close()


def test_it_is_gymnasiums_own_step_for_step_and_over_the_end_of_episodes(three):
    assert isinstance(three, BeaverVectorEnv)
    other = gymnasium.vector.SyncVectorEnv([lambda: BeaverEnv(scenario(**FLOWN), FRAMES)] * 3)
    assert three.action_space == other.action_space
    assert three.observation_space == other.observation_space
    assert three.metadata["autoreset_mode"] == other.metadata["autoreset_mode"]
    assert np.array_equal(three.reset(seed=7)[0], other.reset(seed=7)[0])
    rng = np.random.default_rng(1)
    over = 0
    for _ in range(25):
        actions = rng.uniform(-0.05, 0.05, (3, 4))
        ours, theirs = three.step(actions), other.step(actions)
        for mine, wanted in zip(ours[:4], theirs[:4], strict=True):
            assert mine.dtype == wanted.dtype
            assert np.array_equal(mine, wanted)
        assert ours[4].keys() == theirs[4].keys()
        if theirs[4]:
            over += 1
            assert ours[4]["_metrics"].tolist() == theirs[4]["_metrics"].tolist()
            seeds = [document["seed"] for document in ours[4]["metrics"]]
            assert seeds == theirs[4]["metrics"]["seed"].tolist()
    assert over == 2


def test_actions_of_another_shape_are_said_and_it_goes_on(three):
    three.reset()
    with pytest.raises(BadInput, match=r"actions: shape \(2, 4\), allowed: finite numbers of shape \(3, 4\)"):
        three.step(np.zeros((2, 4)))
    with pytest.raises(BadInput, match="seed: 2 of them, allowed: 3"):
        three.reset(seed=[1, 2])
    three.step(np.zeros((3, 4)))


def test_a_process_that_dies_is_said():
    two = BeaverVectorEnv(2, scenario=scenario(**FLOWN), workers=2)
    two.reset()
    os.kill(two._workers[0].process.pid, signal.SIGKILL)
    with pytest.raises(SimulationFailed, match="has ended"):
        two.step(np.zeros((2, 4)))


@pytest.mark.parametrize(
    "bad", [np.full((3, 4), 1j), np.full((3, 4), "0"), [[0.0] * 4, [0.0] * 3, [0.0] * 4], None]
)
def test_actions_that_are_no_numbers_are_refused(three, bad):
    three.reset(seed=1)
    with pytest.raises(BadInput, match=r"actions: .*, allowed: finite numbers of shape \(3, 4\)"):
        three.step(bad)
    assert np.isfinite(three.step(np.zeros((3, 4)))[0]).all()
