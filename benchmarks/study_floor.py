"""How far a study is from its floor: the share of its processor time that JSBSim's frames alone take.

    python benchmarks/study_floor.py [--cases N]

Cases of `matrix`, `detectability --grid` and `sweep --rare` are flown as a worker flies them. After each
flight, JSBSim alone flies as many frames of the same aircraft, surfaces held. The last column is the largest
factor by which the study can become faster if it still flies these frames. Imports, start of the workers and
figures of the command are not included: `waits.py --long` measures them together with the cases.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.detectability import schemes as survey
from beaver_ftc.studies.matrix import fault_matrix
from beaver_ftc.studies.sweep import rare

SWEEP, EXPECTATION = "elevator-effectiveness", "no_departure"


class Alone:
    """Seconds of JSBSim alone, which flies again the frames of each flight that is given back."""

    def __init__(self) -> None:
        self.taken_s, self._release = 0.0, Loop.release

    def __enter__(self) -> "Alone":
        def release(loop: Loop) -> None:
            self.fly_again(loop)
            self._release(loop)

        Loop.release = release  # type: ignore[method-assign]
        return self

    def __exit__(self, *raised: object) -> None:
        Loop.release = self._release  # type: ignore[method-assign]

    def fly_again(self, loop: Loop) -> None:
        """As many frames as the flight has had."""
        run, runs = loop.plant.run, int(loop.frames["k"][0]) * loop.scenario.substeps
        began = time.process_time()
        for _ in range(runs):
            run()
        self.taken_s += time.process_time() - began


def of_matrix(count: int) -> list[Callable[[], object]]:
    """Cases from all over the matrix."""
    cases = fault_matrix.cases(fault_matrix.AIRSPEEDS_MPS)
    return [partial(fault_matrix.fly_case, case) for case in cases[:: max(1, len(cases) // count)]]


def of_power(count: int) -> list[Callable[[], object]]:
    """Blocks of the quick grid, with faults and without: as many of each as it has, all schemes."""
    grid, schemes = survey.GRIDS["quick"], survey.contenders()
    cases = [*((block, False) for block in grid.healthy()), *((block, True) for block in grid.faulted())]
    some = cases[:: max(1, 8 * len(cases) // count)]  # a block has up to 24 flights
    return [partial(survey.fly_block, case, grid, schemes) for case in some]


def of_rare(count: int) -> list[Callable[[], object]]:
    """Flights of the first round: points of standard normals."""
    sweep = load_sweep(SWEEP)
    points = np.random.default_rng(1).standard_normal((count, len(sweep.keys)))

    def fly(run: int) -> float:
        return rare.score_of(rare.scenario_at(sweep, run, points[run].tolist()), EXPECTATION)

    return [partial(fly, run) for run in range(count)]


STUDIES = {"matrix": of_matrix, "detectability --grid": of_power, "sweep --rare": of_rare}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=40, help="of each study; of power an eighth")
    count = parser.parse_args().cases
    print(f"{'study':14}{'a case, ms':>12}{'JSBSim alone, ms':>18}{'share':>8}{'at most, x':>12}")
    for name, cases_of in STUDIES.items():
        cases = cases_of(count)
        cases[0]()  # compiles, loads and trims
        with Alone() as alone:
            began = time.process_time()
            for fly in cases:
                fly()
            taken_s = time.process_time() - began - alone.taken_s
        share = alone.taken_s / taken_s
        each_ms, alone_ms = (1e3 * s / len(cases) for s in (taken_s, alone.taken_s))
        print(f"{name:14}{each_ms:12.1f}{alone_ms:18.1f}{share:8.2f}{1.0 / share:12.2f}", flush=True)


if __name__ == "__main__":
    main()
