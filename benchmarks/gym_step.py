"""A step of the Gymnasium environment by each way to fly many at a time.

    python benchmarks/gym_step.py [--many 16]

This package's vector environment and Gymnasium's two, with small random actions: us of wall time per
environment and step.
"""

import argparse
import statistics
import time

import gymnasium
import numpy as np

import beaver_ftc  # noqa: F401  (registers its environment)
from beaver_ftc_links.environments import ID

SCENARIO = "elevator-partial-loss"  # 30 s at 100 Hz: 3000 frames an episode
ROUNDS, STEPS = 10, 200  # steps of a round: no episode ends
SMALL = 0.02


def small_actions(space: gymnasium.spaces.Box, many: int) -> np.ndarray:
    """Actions near the middle of the space, one a step."""
    rng = np.random.default_rng(0)
    middle = (space.low + space.high) / 2
    return middle + SMALL * rng.uniform(-1.0, 1.0, (STEPS, many, *space.shape)) * (space.high - space.low)


def many_at_a_time(many: int) -> None:
    """Print what a step costs by each way to fly many."""
    for frames in (1, 12):
        kinds = {"ours": None, "Gymnasium's async": "async", "Gymnasium's sync": "sync"}
        vectors = {
            kind: gymnasium.make_vec(
                ID, num_envs=many, vectorization_mode=mode, scenario=SCENARIO, frames_per_step=frames
            )
            for kind, mode in kinds.items()
        }
        taken = [[_vector_us(vector) for vector in vectors.values()] for _ in range(ROUNDS + 1)][1:]
        for kind, column in zip(vectors, zip(*taken, strict=True), strict=True):
            print(f"{many} at a time, {frames:2} frames, {kind:18}{statistics.median(column):8.1f} us")
        for vector in vectors.values():
            vector.close()


def _vector_us(vector: gymnasium.vector.VectorEnv) -> float:
    vector.reset(seed=1)
    actions = small_actions(vector.single_action_space, vector.num_envs)
    vector.step(actions[0])
    began = time.perf_counter()
    for action in actions[1:]:
        vector.step(action)
    return 1e6 * (time.perf_counter() - began) / (STEPS - 1) / vector.num_envs


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--many", type=int, default=16)
    many_at_a_time(parser.parse_args().many)
