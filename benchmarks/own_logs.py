"""Our own logs, diagnosed by the aircraft's own model: bounds, names and alarms where the truth is known.

    python benchmarks/own_logs.py [--flights 1] [--seed 1] [--as table]

Three laws, two airspeeds, references drawn by the seed (sines and doublets on three axes), admitted errors of
inertia and air drawn as well, gyros ideal or with declared noise. Healthy flights, and losses of 0.3, 0.6 and
0.9 of aileron, elevator and rudder. Each flight is written as a recorder on board would have, read again, and
diagnosed as `diagnose --aircraft` does. Prints a row for each size of the loss: flights, alarms before the
fault, found, named rightly, named wrongly, share of samples and surfaces whose effectiveness the bounds hold,
share of those of which more is said than 0 to 1, their width, and the share of credible samples.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.flights.by_aircraft import diagnose_as, known
from beaver_ftc.flights.samples import read_for
from beaver_ftc.flights.vehicle import load_vehicle
from beaver_ftc.results.exports import RECORDINGS
from beaver_ftc.results.writer import run
from beaver_ftc.studies.present.tables import markdown_table

LAWS = ("nominal", "adaptive", "fault-tolerant")
AIRSPEEDS_MPS = (38.0, 48.0)
SURFACES = ("aileron", "elevator", "rudder")
LOSSES = (0.3, 0.6, 0.9)
LOSS = "loss_of_effectiveness"
DURATION_S, FAULT_S = 20.0, 10.0
HEALTHY = 5  # of each law and airspeed
NOISE = {"noise_std_deg_s": 0.05}
HEAD = [
    "loss", "flights", "false alarms", "found", "named rightly", "named wrongly", "held by bounds",
    "said of", "median width", "credible",
]  # fmt: skip
Document = dict[str, Any]


def scenarios(count: int, seed: int) -> Iterator[Document]:
    """Scenario after scenario: every law and airspeed, healthy and with each loss of each surface."""
    for law in LAWS:
        for airspeed_mps in AIRSPEEDS_MPS:
            for i in range(HEALTHY * count):
                yield _drawn(law, airspeed_mps, (seed, i), [])
            for surface in SURFACES:
                for loss in LOSSES:
                    fault = {"actuator": surface, "type": LOSS, "magnitude": loss, "at_s": FAULT_S}
                    for i in range(count):
                        yield _drawn(
                            law, airspeed_mps, (seed, SURFACES.index(surface), i, round(10 * loss)), [fault]
                        )


def _drawn(law: str, airspeed_mps: float, drawn_by: tuple[int, ...], faults: list[Document]) -> Document:
    rng = np.random.default_rng([*drawn_by, LAWS.index(law), round(airspeed_mps)])
    noisy = rng.uniform() < 0.5
    fdi: Document = {"bounds": {"sensors": dict.fromkeys("pqr", NOISE)}} if noisy else {}
    return {
        "name": f"own-{'-'.join(map(str, rng.integers(0, 1_000_000, 2)))}",
        "duration_s": DURATION_S,
        "seed": int(rng.integers(1, 1_000_000)),
        "initial": {"airspeed_mps": airspeed_mps},
        "reference": {axis: _reference(rng) for axis in "pqr"},
        "uncertainty": {
            "inertia_coupling": {axis: float(rng.uniform(-0.25, 0.25)) for axis in "pqr"},
            "sinusoid": {axis: _sinusoid(rng) for axis in "pqr"},
        },
        "sensors": dict.fromkeys("pqr", NOISE) if noisy else "ideal",
        "fdi": fdi,
        "control": {"law": law},
        "faults": faults,
    }


def _reference(rng: np.random.Generator) -> list[Document]:
    size = float(rng.uniform(1.0, 4.0))
    sine = {"amplitude_deg_s": size, "frequency_hz": float(rng.uniform(0.1, 0.5))}
    start_s = float(rng.uniform(0.0, 15.0))
    doublet = {"amplitude_deg_s": size, "start_s": start_s, "width_s": float(rng.uniform(0.5, 2.0))}
    return [{"sine": sine}, {"doublet": doublet}][: int(rng.integers(1, 3))]


def _sinusoid(rng: np.random.Generator) -> Document:
    size, frequency = float(rng.uniform(0.0, 0.02)), float(rng.uniform(1.0, 30.0))
    return {"amplitude_rad_s2": size, "frequency_rad_s": frequency}


def judged(document: Document, kind: str, folder: Path) -> Document:
    """Fly it, write it as a log, diagnose the log: what was right."""
    scenario = bf.load(document)
    run(scenario, folder, report=False, recording=kind)
    place = folder / scenario.name
    vehicle = load_vehicle(str(place / "vehicle.yaml"))
    recording = read_for(place / RECORDINGS[kind], vehicle)
    samples, rows, verdict = diagnose_as(recording, vehicle, known("beaver", str(place / "scenario.yaml")))
    truth = np.ones_like(rows.low)
    for fault in scenario.faults:
        surface = list(scenario.airframe.surfaces).index(fault.actuator)
        truth[samples.t_s >= fault.at_s - 1e-6, surface] = 1.0 - fault.magnitude
    said = rows.high - rows.low < 1.0
    held = (rows.low <= truth) & (truth <= rows.high)
    actual = scenario.faults[0].actuator if scenario.faults else None
    began_s = scenario.faults[0].at_s if scenario.faults else np.inf
    found_s = verdict["detection_s"]
    names = set(rows.named[rows.faulty == 1]) - {"unknown"}
    return {
        "loss": scenario.faults[0].magnitude if scenario.faults else 0.0,
        "false": found_s is not None and found_s < began_s - 1e-6,
        "found": found_s is not None and found_s >= began_s - 1e-6,
        "right": actual is not None and verdict["isolated"] == actual,
        "wrong": bool(names - {actual}),
        "held": int(held[said].sum()),
        "said": int(said.sum()),
        "samples": said.size,
        "width": (rows.high - rows.low)[said],
        "credible": float(rows.credible.mean()),
    }


def table(results: list[Document]) -> list[list[str]]:
    """A row for each size of the loss."""
    rows = []
    for loss in (0.0, *LOSSES):
        of = [one for one in results if abs(one["loss"] - loss) < 1e-9]
        said = sum(one["said"] for one in of)
        rows.append([
            f"{loss:g}" if loss else "none", str(len(of)),
            *(str(sum(one[key] for one in of)) for key in _COUNTED),
            f"{sum(one['held'] for one in of) / max(said, 1):.3f}",
            f"{said / max(sum(one['samples'] for one in of), 1):.2f}",
            f"{np.median(np.concatenate([one['width'] for one in of])):.3f}",
            f"{np.mean([one['credible'] for one in of]):.2f}",
        ])  # fmt: skip
    return rows


_COUNTED = ("false", "found", "right", "wrong")


def main() -> None:
    """Fly, write, read, diagnose, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=1, help="of each law, airspeed, surface and loss")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--as", dest="kind", choices=sorted(RECORDINGS), default="table")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        each = [judged(one, asked.kind, Path(folder)) for one in scenarios(asked.flights, asked.seed)]
    print(markdown_table(HEAD, table(each)))


if __name__ == "__main__":
    main()
