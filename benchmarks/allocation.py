"""What allocation by least squares costs a frame, beside a plain frame of JSBSim.

python benchmarks/allocation.py

A law of 4 to 20 surfaces is asked for what swings within and beyond reach, while surfaces fail; every frame
starts from the one before. The ratio says the same on every machine.
"""

import time

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control import allocation
from beaver_ftc.control.state import control_dtype
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim

FRAMES, ROUNDS, SURFACES, DT_S = 20_000, 7, (4, 6, 8, 12, 17, 20), 0.01
RATE_RAD_S = 1.0


@kernel
def allocate_all(control, prediction, demands, G, failed):
    """Every frame of a flight; returns how many systems were solved. failed (n,): from which frame."""
    total, n = 0, prediction.u.size
    for k in range(demands.shape[0]):
        for i in range(3):
            control.axes.demand[i] = demands[k, i]
            for s in range(n):
                control.axes.G[i, s] = G[i, s] if k < failed[s] else 0.0
        effectiveness = control.surfaces.output.effectiveness
        allocation.allocate_generally(
            control.axes, control.allocation, control.layout, effectiveness, prediction, 0.0, 0.0
        )
        total += control.allocation.memory.problem.steps
        prediction.u[:] = control.allocation.output.command
    return total


def us_a_frame(n: int, rng: np.random.Generator) -> tuple[float, float]:
    """Of n surfaces: time a frame, us, and systems solved."""
    G = rng.normal(0.0, [[3.0], [4.0], [1.5]], (3, n)) * (4.0 / n)
    t = np.arange(FRAMES)[:, None] * DT_S
    reach = 0.4 * np.abs(G).sum(axis=1)
    demands = 1.2 * reach * np.sin(t * rng.uniform(0.5, 6.0, 3)) + 0.02 * rng.normal(size=(FRAMES, 3))
    failed = np.where(rng.random(n) < 0.3, rng.integers(0, FRAMES, n), FRAMES)
    best, systems = np.inf, 0.0
    for _ in range(ROUNDS):
        control = np.zeros(1, control_dtype(n)).view(np.recarray)[0]
        prediction = np.zeros(1, prediction_dtype(n)).view(np.recarray)[0]
        layout = control["layout"]
        layout["low"], layout["high"], layout["stand_in"] = -0.4, 0.4, -1
        layout["authority"][:, 0] = 1.0
        control["surfaces"]["output"]["effectiveness"], prediction["w"] = 1.0, 1.0
        prediction["actuators"]["step"] = RATE_RAD_S * DT_S
        begun = time.perf_counter()
        systems = allocate_all(control, prediction, demands, G, failed) / FRAMES
        best = min(best, time.perf_counter() - begun)
    return 1e6 * best / FRAMES, systems


def us_of_jsbsim() -> float:
    """A plain frame of the Beaver, us."""
    plant = Plant(100)
    trim(45.0, 1828.8, plant=plant)
    best = np.inf
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        for _ in range(2000):
            plant.fdm.run()
        best = min(best, (time.perf_counter() - begun) / 2000)
    return 1e6 * best


def main() -> None:
    """Print a line for each number of surfaces."""
    plain_us = us_of_jsbsim()
    print(f"a plain frame of JSBSim: {plain_us:.2f} us")
    print(f"{'surfaces':>8}{'us a frame':>12}{'of JSBSim':>11}{'systems a frame':>17}")
    for n in SURFACES:
        us, systems = us_a_frame(n, np.random.default_rng(n))
        print(f"{n:8}{us:12.2f}{us / plain_us:11.2f}{systems:17.2f}")


if __name__ == "__main__":
    main()
