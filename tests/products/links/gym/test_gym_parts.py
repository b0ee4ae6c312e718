"""The environment's parts by hand: spaces, seeds, what a step sees and costs, who flies which episode."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.loop.loop import fly
from flying import Memory, scenario

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.seeding import np_random  # noqa: E402

from beaver_ftc_links import gym  # noqa: E402
from beaver_ftc_links.gym import BeaverEnv, BeaverVectorEnv, Episode  # noqa: E402

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


def test_a_surface_goes_to_its_stops_and_is_seen_there():
    env = BeaverEnv(scenario(duration_s=1.0))
    env.reset()
    low, high = (env.step(np.full(4, share))[0][12:] for share in (-1.0, 1.0))
    half = env.step(np.full(4, 0.5))[0][12:]
    assert (low <= 0.0).all()
    assert (high > 0.0).all()
    np.testing.assert_allclose(half, 0.5 * high)
    assert low.min() < -1.0


def test_spaces_and_defaults():
    env = BeaverEnv()
    assert (env.scenario.name, env.frames_per_step) == ("fault-free", 1)
    assert env.action_space == gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float64)
    assert env.observation_space == gymnasium.spaces.Box(-100.0, 100.0, (16,), np.float64)
    assert BeaverVectorEnv().num_envs == 1


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


def test_seeds_that_follow_are_drawn_from_the_first():
    env = BeaverEnv(scenario(duration_s=0.1), 100)
    drawn = np_random(5)[0]
    for seed in (5, int(drawn.integers(2**31)), int(drawn.integers(2**31))):
        env.reset(seed=5) if seed == 5 else env.reset()
        assert env.step(STILL)[-1]["metrics"]["seed"] == seed


def test_without_a_seed_every_episode_has_the_scenarios():
    env = BeaverEnv(scenario(duration_s=0.1, seed=17), 100)
    for _ in range(2):
        env.reset()
        assert env.step(STILL)[-1]["metrics"]["seed"] == 17
    other = BeaverEnv(env.scenario, 100)
    other.reset(seed=0)
    assert other.step(STILL)[-1]["metrics"]["seed"] == 0


@pytest.mark.parametrize(("envs", "workers", "rows"), [
    (5, 2, [(0, 2), (2, 5)]), (7, 3, [(0, 2), (2, 4), (4, 7)]), (2, 9, [(0, 1), (1, 2)]), (4, 1, [(0, 4)]),
    (6, None, [(0, 2), (2, 4), (4, 6)]),
])  # fmt: skip
def test_who_flies_which_episodes(monkeypatch, envs, workers, rows):
    """As even as can be; this process the last of them."""
    given = []
    monkeypatch.setattr(gym, "_Worker", lambda part: given.append(("other", part)))
    monkeypatch.setattr(gym, "_Episodes", lambda part: given.append(("own", part)))
    monkeypatch.setattr(gym, "cores", lambda: 3)
    made = BeaverVectorEnv(envs, workers=workers, frames_per_step=4)
    monkeypatch.setattr(made, "_workers", ())
    assert [(part.rows.start, part.rows.stop) for _, part in given] == rows
    assert [who for who, _ in given] == ["other"] * (len(rows) - 1) + ["own"]
    assert {part.sizes for _, part in given} == {(4, 16)}
    assert len(given[0][1].block) == envs * 23
    assert given[0][1].options["frames_per_step"] == 4
    assert made.action_space.shape == (envs, 4)


def test_an_episode_has_a_row_of_its_own():
    """Action, observation, reward and both ends: 23 numbers, none of them shared."""
    block = gym.context().RawArray(gym.c_double, 3 * 23)
    shared = gym._Shared(block, (4, 16), slice(1, 3))
    parts = [
        shared.actions,
        shared.seen,
        shared.rewards[:, None],
        shared.terminated[:, None],
        shared.truncated[:, None],
    ]
    for value, part in enumerate(parts, 1):
        part[:] = value
    row = [1.0] * 4 + [2.0] * 16 + [3.0, 4.0, 5.0]
    assert list(block) == [0.0] * 23 + row * 2


class Line:
    """One end of a pipe: what comes, and what was sent."""

    def __init__(self, *comes):
        self.comes, self.sent = iter(comes), []

    def recv_bytes(self):
        said = next(self.comes, None)
        if said is None:
            raise EOFError
        return said

    def send_bytes(self, what):
        self.sent.append(what)

    def close(self):
        self.sent.append("closed")


def test_what_a_worker_does(monkeypatch):
    """A reset, steps to the end of an episode, until nobody tells it more; not interrupted by Ctrl-C."""
    ignored = []
    monkeypatch.setattr(gym.signal, "signal", lambda *given: ignored.append(given))
    block = gym.context().RawArray(gym.c_double, 2 * 23)
    options = {"scenario": scenario(duration_s=0.05), "frames_per_step": 2}
    part = gym._Part(block, (4, 16), slice(1, 2), options)
    line = Line(pickle.dumps([3]), b"", b"", b"")
    gym._serve(line, part)
    assert ignored == [(gym.signal.SIGINT, gym.signal.SIG_IGN)]
    first, going, ended, again = line.sent
    assert [first, going, again] == [b""] * 3
    (told,) = pickle.loads(ended).items()
    assert (told[0], told[1]["metrics"]["seed"]) == (1, 3)
    values = np.frombuffer(memoryview(block)).reshape(2, 23)
    assert values[0].tolist() == [0.0] * 23
    assert values[1, -3:].tolist() == [0.0] * 3  # begun anew


def test_a_worker_that_does_not_end_by_itself_is_terminated():
    for alive, calls in ((False, []), (True, ["terminate"])):
        done = []
        process = SimpleNamespace(
            join=lambda wait_s, done=done: done.append(("join", wait_s)),
            is_alive=lambda alive=alive: alive,
            terminate=lambda done=done: done.append("terminate"),
        )
        worker = SimpleNamespace(_line=Line(), process=process)
        gym._Worker.end(worker)
        assert worker._line.sent == ["closed"]
        assert done == [("join", 5.0), *calls]


def test_what_a_worker_answers():
    said = {1: {"metrics": 2}}
    asked = [
        gym._Worker.answer(SimpleNamespace(_line=Line(*comes))) for comes in ([b""], [pickle.dumps(said)], [])
    ]
    assert asked[:2] == [{}, said]
    assert isinstance(asked[2], SimulationFailed)


def test_a_reset_answers_nothing_and_what_goes_wrong_is_the_answer():
    """Not what the step before it answered."""
    begun = []
    made = SimpleNamespace(
        _answer=None, _step=lambda: {0: {"metrics": "a"}}, _begin=lambda *of: begun.append(of)
    )
    gym._Episodes.tell(made, gym._STEP)
    assert made._answer == {0: {"metrics": "a"}}
    gym._Episodes.tell(made, pickle.dumps([7, None]))
    assert (made._answer, begun) == ({}, [(0, 7), (1, None)])
    made._step = lambda: 1 / 0
    gym._Episodes.tell(made, gym._STEP)
    assert isinstance(made._answer, ZeroDivisionError)


def test_answers_of_all_are_one_by_gymnasiums_rule():
    told = [{0: {"metrics": "a"}}, {}, {2: {"metrics": "b", "other": 1}}]
    workers = [SimpleNamespace(answer=lambda said=said: said) for said in told]
    made = SimpleNamespace(_workers=workers, num_envs=3)
    infos = BeaverVectorEnv._answers(made)
    assert {key: values.tolist() for key, values in infos.items()} == {
        "metrics": ["a", None, "b"], "_metrics": [True, False, True],
        "other": [None, None, 1], "_other": [False, False, True],
    }  # fmt: skip
    closed = []
    fails = SimpleNamespace(answer=lambda: BadInput("no"))
    made = SimpleNamespace(_workers=[fails, *workers], num_envs=3, close=lambda: closed.append(1))
    with pytest.raises(BadInput, match="no"):
        BeaverVectorEnv._answers(made)
    assert closed == [1]


@pytest.mark.parametrize("count", [-1, 0, 1.0, "1", None])
def test_a_count_that_is_none(count):
    with pytest.raises(BadInput, match="allowed: a whole number of at least 1"):
        gym._check_count("num_envs", count)
    assert gym._check_count("num_envs", 1) is None
