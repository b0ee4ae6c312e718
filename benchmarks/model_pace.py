"""How fast the error of a derived design model moves: the statistical detector takes it to be so fast.

    python benchmarks/model_pace.py [NAMES] [--flights 6] [--seed 1]

In still air with exact sensors what the design model leaves of the angular acceleration is its own error. It
may cross its bound, from the map at that instant, as surfaces move, and with `uncertainty_rad_s` as the state
does (docs/explanation/statistical.md). A row an aircraft: the largest error and the largest change in a
frame, as shares of the bound; of that change what a move of the surfaces explains by the detector's rule, and
what is left, rad/s, at 100 frames a second: the least `uncertainty_rad_s` that covers it.
"""

import argparse
from typing import Any

import numpy as np

from beaver_ftc import load
from beaver_ftc.diagnosis.detection.statistical import BOUNDS_PER_TRAVEL
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare.replay import Recorder
from beaver_ftc.studies.present.tables import markdown_table

NAMES = ("737", "A4", "B747", "MD11", "c172p", "c310", "J3Cub", "L410", "OV10", "T37", "pa28", "p51d")
DT_S, SETTLED = 0.01, 10
HEAD = ["aircraft", "error", "change in a frame", "by surfaces", "left, rad/s"]


def scenario(name: str, seed: int) -> Scenario:
    """A flight without a fault; sines and squares of the rates by turns."""
    rng = np.random.default_rng(seed)
    shape = ("sine", "square")[seed % 2]
    size, hz = rng.uniform(1.0, 8.0, 3).tolist(), rng.uniform(0.1, 0.6, 3).tolist()
    reference = {
        axis: [{shape: {"amplitude_deg_s": size[i], "frequency_hz": hz[i]}}] for i, axis in enumerate("pqr")
    }
    still: dict[str, Any] = {"inertia_coupling": 0.0, "constant_rad_s2": 0.0}
    given = {"name": "pace", "aircraft": f"jsbsim:{name}", "duration_s": 20, "reference": reference}
    return load(given | {"fdi": {"bounds": {k: dict.fromkeys("pqr", v) for k, v in still.items()}}})


def flown(scenario: Scenario) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Error (n, 3) rad/s2, its bound (n, 3) and the surfaces as shares of their travel (n, surfaces)."""
    nominal = scenario.control.model_copy(update={"law": "nominal"})
    recorder, bound = Recorder(), list[np.ndarray]()
    loop = Loop(scenario.model_copy(update={"control": nominal}), recorder)
    error_map, fly_frame = loop.frames["fdi"]["bound"]["error_map"], loop.plugin_frame
    assert fly_frame is not None

    def fly_and_note(frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> int:
        status = fly_frame(frames, references, log)
        bound.append(np.where(error_map["outside"][0], np.nan, error_map["e_now"][0]))
        return status

    loop.fly_frame = fly_and_note
    for _ in loop.chunks():
        pass
    x, expected = (np.array([getattr(m, of_it) for m, _ in recorder.seen]) for of_it in ("x", "acceleration"))
    travel = np.diff(recorder.context.travel_rad, axis=0)
    places = np.array([command for _, command in recorder.seen]) / travel
    error = np.diff(x, axis=0) / DT_S - expected[1:]
    return error[SETTLED:], np.array(bound)[SETTLED + 1 :], places[SETTLED:-1]


def row_of(name: str, flights: int, seed: int) -> list[str]:
    """The largest of each over an aircraft's flights."""
    largest = np.zeros(4)
    for k in range(flights):
        error, bound, places = flown(scenario(name, seed + k))
        change = np.abs(np.diff(error, axis=0)) / bound[1:]
        moved = BOUNDS_PER_TRAVEL * np.abs(np.diff(places, axis=0)).max(axis=1, keepdims=True)
        left = (change - moved) / DT_S
        found = np.abs(error) / bound, change, np.minimum(change, moved), left
        largest = np.fmax(largest, [np.nanmax(of_it, initial=0.0) for of_it in found])
    return [name, *(f"{value:.2g}" for value in largest)]


def main() -> None:
    """Print a row an aircraft."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", default=NAMES, metavar="NAME")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    print(markdown_table(HEAD, [row_of(name, args.flights, args.seed) for name in args.names]))


if __name__ == "__main__":
    main()
