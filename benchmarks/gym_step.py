"""A step of the Gymnasium environment beside one of jsbgym, in one run; wants `pip install jsbgym`.

    python benchmarks/gym_step.py [--rounds N] [--many N]

jsbgym flies the Cessna of JSBSim by names of properties, twelve frames a step. Both are what `gymnasium.make`
gives, flown in turn with small random actions; resets are timed apart. Then as many environments as `--many`
says at a time, by this package's vector environment and by Gymnasium's two, us of wall time per environment.

Bars: a step of one frame at most a third of jsbgym's, a step of twelve frames at most jsbgym's.
"""

import argparse
import statistics
import sys
import time
import warnings

import gymnasium
import numpy as np

import beaver_ftc  # noqa: F401  (registers its environment)
from beaver_ftc_links.environments import ID

OURS = ID
THEIRS = "C172-HeadingControlTask-Shaping.STANDARD-NoFG-v0"
SCENARIO = "elevator-partial-loss"  # 30 s at 100 Hz: 3000 frames an episode
STEPS = 200  # a round: an episode of none ends
SMALL = 0.02


def small_actions(space: gymnasium.spaces.Box, many: tuple[int, ...] = ()) -> np.ndarray:
    """Actions near the middle of the space, one a step."""
    rng = np.random.default_rng(0)
    middle = (space.low + space.high) / 2
    return middle + SMALL * rng.uniform(-1.0, 1.0, (STEPS, *many, *space.shape)) * (space.high - space.low)


def reset_and_step_us(env: gymnasium.Env, seed: int) -> tuple[float, float]:
    """Microseconds a reset, and a step."""
    actions = small_actions(env.action_space)
    began = time.perf_counter()
    env.reset(seed=seed)
    ready = time.perf_counter()
    for action in actions:
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            raise SystemExit(f"{env}: the episode has ended, and a new one is not part of a step")
    return 1e6 * (ready - began), 1e6 * (time.perf_counter() - ready) / STEPS


def beside_jsbgym(rounds: int) -> None:
    """Print the steps of one run, and their ratios."""
    try:
        import jsbgym  # noqa: F401  (registers its environments)
    except ImportError:
        print("jsbgym is not installed: nothing to compare with (pip install jsbgym)")
        return
    envs = {"jsbgym, 12 frames": gymnasium.make(THEIRS)}
    for frames in (1, 12):
        envs[f"ours, {frames} frame{'s' if frames > 1 else ''}"] = gymnasium.make(
            OURS, scenario=SCENARIO, frames_per_step=frames
        )
    taken = [[reset_and_step_us(env, seed) for env in envs.values()] for seed in range(rounds + 1)][1:]
    for i, name in enumerate(envs):
        reset, step = (statistics.median(row[i][j] for row in taken) for j in range(2))
        ratio = statistics.median(row[i][1] / row[0][1] for row in taken)
        print(f"{name:20} step {step:8.1f} us  {ratio:6.3f} of jsbgym's    reset {reset / 1e3:6.2f} ms")
    print(f"medians of {rounds} rounds of {STEPS} steps; bars: 0.333 for one frame, 1 for twelve")


def many_at_a_time(many: int, rounds: int) -> None:
    """Print what a step costs by each way to fly many."""
    for frames in (1, 12):
        kinds = {"ours": None, "Gymnasium's async": "async", "Gymnasium's sync": "sync"}
        vectors = {
            kind: gymnasium.make_vec(
                OURS, num_envs=many, vectorization_mode=mode, scenario=SCENARIO, frames_per_step=frames
            )
            for kind, mode in kinds.items()
        }
        taken = [[_vector_us(vector) for vector in vectors.values()] for _ in range(rounds + 1)][1:]
        for kind, column in zip(vectors, zip(*taken, strict=True), strict=True):
            print(f"{many} at a time, {frames:2} frames, {kind:18}{statistics.median(column):8.1f} us")
        for vector in vectors.values():
            vector.close()


def _vector_us(vector: gymnasium.vector.VectorEnv) -> float:
    vector.reset(seed=1)
    actions = small_actions(vector.single_action_space, (vector.num_envs,))
    vector.step(actions[0])
    began = time.perf_counter()
    for action in actions[1:]:
        vector.step(action)
    return 1e6 * (time.perf_counter() - began) / (STEPS - 1) / vector.num_envs


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--many", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")  # jsbgym's at each reset
    beside_jsbgym(given.rounds)
    if given.many:
        many_at_a_time(given.many, given.rounds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
