"""Our own logs, diagnosed by two models: bounds, names and alarms where the truth is known.

    python -m benchmarks.own_logs [--seed 1] [--aircraft beaver] [--air none] [--by identified]

The flights have three laws, two airspeeds, random references (sines and doublets on three axes), random
errors of inertia and air within the declared bounds, and gyros that are ideal or have the declared noise.
They are healthy, or a primary surface loses 0.3, 0.6 or 0.9 of its effectiveness. Each flight is written
as a recorder on board would write it, and read again. It is diagnosed as `diagnose --aircraft` does (`by`
aircraft), and by a model that `identify` made of twelve healthy flights of a minute, with two of the laws,
other airspeeds and other random numbers (`by` identified). Both read the log by the vehicle file that `run
--as table` writes. With `--air light` the flights are in turbulence. The scenario declares it to the
aircraft's own model; `identify` gets no declaration.

The table has a row for each model and size: flights, refused logs, alarms before the fault, detected
faults, right names, wrong names in any row (the name of a group is wrong if the surface at fault is not in
it). Then it has the share of samples and surfaces whose effectiveness lies within the bounds, and the same
for the surface at fault alone, both where the bounds are narrower than 0 to 1; the share and the median
width of these bounds; and the share of credible samples. The last column counts the losses that an
informed test detects (own_logs_informed.py).
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from benchmarks.own_logs_informed import noises, told

import beaver_ftc as bf
from beaver_ftc.documents import BadInput
from beaver_ftc.results.recordings import RECORDING_FILE_OF_KIND
from beaver_ftc.results.writer import run
from beaver_ftc.studies.present.tables import grouped, markdown_table
from beaver_ftc_logs.by_aircraft import diagnose_aircraft, load_diagnosed
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.identification import identify
from beaver_ftc_logs.loading import load_flights_for_fit, read_vehicle_columns
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model, model_file_text
from beaver_ftc_logs.preparation import scale_if_better
from beaver_ftc_logs.samples import resample
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle

Document = dict[str, Any]
LAWS, TRAINING_LAWS = ("nominal", "adaptive", "fault-tolerant"), ("nominal", "adaptive")
TESTED, TRAINED = (38.0 / 45.0, 48.0 / 45.0), (40.0 / 45.0, 46.0 / 45.0)
"""Airspeeds, of the usual one."""
BY = ("aircraft", "identified")
LOSS = "loss_of_effectiveness"
SIZES = (0.3, 0.6, 0.9)
DURATION_S, FAULT_S = 20.0, 10.0
HEALTHY = 5  # of each law and airspeed
TRAINING, TRAINING_S = 12, 60.0
NOISE = {"noise_std_deg_s": 0.05}
_COUNTED = ("refused", "false", "found", "right", "wrong")
_SUMMED = ("held", "said", "held_lost", "lost", "samples")
NO_SURFACE = {"", "unknown", "unanticipated", "engine"}  # in the place of a name
HEAD = [
    "by", "fault", "flights", "refused", "false alarms", "found", "named rightly", "named wrongly",
    "held by bounds", "held at fault", "said of", "median width", "credible", "told",
]  # fmt: skip


class Campaign(NamedTuple):
    """The flights: reference of the aircraft, severity of the turbulence, and seed of the random numbers."""

    aircraft: str = "beaver"
    air: str = "none"
    seed: int = 1


def scenarios(of: Campaign) -> Iterator[Document]:
    """Yield the scenarios: each law and airspeed, healthy and with each loss on each surface."""
    plain = bf.load({"name": "plain", "aircraft": of.aircraft})
    for law in LAWS:
        for share in TESTED:
            airspeed_mps = plain.initial.airspeed_mps * share
            for i in range(HEALTHY):
                yield _drawn(of, law, airspeed_mps, (of.seed, i), [])
            for place, surface in enumerate(plain.airframe.primary):
                for size in SIZES:
                    loss = {"actuator": surface, "type": LOSS, "at_s": FAULT_S, "magnitude": size}
                    yield _drawn(of, law, airspeed_mps, (of.seed, place, 0, round(10 * size)), [loss])


def training(of: Campaign) -> Iterator[Document]:
    """Yield healthy flights with other random numbers, with some of the laws, at other airspeeds."""
    usual_mps = bf.load({"name": "plain", "aircraft": of.aircraft}).initial.airspeed_mps
    for i in range(TRAINING):
        law, share = TRAINING_LAWS[i % 2], TRAINED[i // 2 % 2]
        drawn = _drawn(of, law, usual_mps * share, (of.seed + 4, 777, i), [])
        yield drawn | {"name": f"day-{i}", "duration_s": TRAINING_S}


def _drawn(
    of: Campaign, law: str, airspeed_mps: float, drawn_by: tuple[int, ...], faults: list[Document]
) -> Document:
    """The scenario of a log: references, errors and noise are drawn."""
    rng = np.random.default_rng([*drawn_by, LAWS.index(law), round(airspeed_mps)])
    noisy, moves = rng.uniform() < 0.5, of.air != "none"
    bounds: Document = {"sensors": dict.fromkeys("pqr", NOISE)} if noisy else {}
    return {
        "name": f"own-{'-'.join(map(str, rng.integers(0, 1_000_000, 2)))}",
        "aircraft": of.aircraft,
        "duration_s": DURATION_S,
        "seed": int(rng.integers(1, 1_000_000)),
        "initial": {"airspeed_mps": airspeed_mps},
        "reference": {axis: _reference(rng) for axis in "pqr"},
        "uncertainty": {
            "inertia_coupling": {axis: float(rng.uniform(-0.25, 0.25)) for axis in "pqr"},
            "sinusoid": {axis: _sinusoid(rng) for axis in "pqr"},
        }
        if of.aircraft.startswith("beaver")
        else {},  # another has no such errors but its own
        "environment": {"turbulence": "dryden", "severity": of.air} if moves else {},
        "sensors": dict.fromkeys("pqr", NOISE) if noisy else "ideal",
        "fdi": {
            "fault_class": "published",
            "bounds": bounds | ({"turbulence": of.air} if moves else {}),
        },
        "control": {"law": law},
        "faults": faults,
    }


def _reference(rng: np.random.Generator) -> list[Document]:
    """A sine, and in half of the cases a doublet too."""
    size = float(rng.uniform(1.0, 4.0))
    sine = {"amplitude_deg_s": size, "frequency_hz": float(rng.uniform(0.1, 0.5))}
    start_s = float(rng.uniform(0.0, 15.0))
    doublet = {"amplitude_deg_s": size, "start_s": start_s, "width_s": float(rng.uniform(0.5, 2.0))}
    return [{"sine": sine}, {"doublet": doublet}][: int(rng.integers(1, 3))]


def _sinusoid(rng: np.random.Generator) -> Document:
    size, frequency = float(rng.uniform(0.0, 0.02)), float(rng.uniform(1.0, 30.0))
    return {"amplitude_rad_s2": size, "frequency_rad_s": frequency}


class Log(NamedTuple):
    """The log of a flight as a recorder on board writes it, with its scenario beside it."""

    flown: Any
    folder: Path
    path: Path


def recorded(document: Document, folder: Path) -> Log:
    """Fly a scenario, and write its log."""
    scenario = bf.load(document)
    run(scenario, folder, report=False, recording="table")
    place = folder / scenario.name
    return Log(scenario, place, place / RECORDING_FILE_OF_KIND["table"])


Said = tuple[LogRows, str | None]
"""The rows, and the surface that is named at the end."""


def by_aircraft(log: Log, of: Campaign) -> Said:
    """The diagnosis as of `diagnose --aircraft`."""
    vehicle = load_vehicle(str(log.folder / "vehicle.yaml"))
    told = load_diagnosed(of.aircraft, str(log.folder / "scenario.yaml"))
    _, rows, verdict = diagnose_aircraft(read_vehicle_columns(log.path, vehicle), vehicle, told)
    return rows, verdict["isolated"]


def identified(logs: list[Log]) -> Model:
    """The model that `identify` writes to a file, from healthy flights."""
    vehicle: Vehicle = load_vehicle(str(logs[0].folder / "vehicle.yaml"))
    vehicle = vehicle.model_copy(update={"faults": ["loss"]})
    named = [log.path.rename(log.path.with_stem(log.flown.name)) for log in logs]
    found = identify(*scale_if_better(load_flights_for_fit(named, vehicle), vehicle))
    return Model.model_validate_json(model_file_text(found))


def by_model(log: Log, model: Model) -> Said:
    """The diagnosis as of `diagnose --model`."""
    rows = diagnose(resample(read_vehicle_columns(log.path, model.vehicle), model.vehicle), model)
    names, count = np.unique(rows.isolated_surfaces[rows.faulty == 1].astype(str), return_counts=True)
    return rows, str(names[count.argmax()]) if len(names) else None


def _tried(by: str, log: Log, way: Callable[[Log], Said]) -> Document:
    """The row of a diagnosed log; that of a refused log has no results."""
    size = f"{LOSS} {log.flown.faults[0].magnitude:g}" if log.flown.faults else "none"
    found = {"by": by, "size": size, "refused": False}
    try:
        return found | judged(log, way(log))
    except BadInput:
        nothing = dict.fromkeys((*_COUNTED, *_SUMMED), 0)
        return found | nothing | {"refused": True, "width": np.empty(0), "credible": 0.0}


def judged(log: Log, said_of: Said) -> Document:
    """The row of a diagnosed log: which alarms, names and bounds are right."""
    (rows, isolated), low, high = said_of, said_of[0].effectiveness_low, said_of[0].effectiveness_high
    truth, actual, began_s = np.ones_like(low), None, np.inf
    for fault in log.flown.faults:
        actual, began_s = fault.actuator, fault.at_s
        surface = list(log.flown.airframe.surfaces).index(actual)
        truth[rows.t_s >= began_s - 1e-6, surface] = 1.0 - fault.magnitude
    said = high - low < 0.999
    held = (low <= truth + 1e-9) & (truth <= high + 1e-9)
    lost = said & (truth < 1.0)
    alarmed = rows.t_s[rows.faulty == 1]
    named = {str(name) for name in rows.isolated_surfaces[rows.faulty == 1]} - NO_SURFACE
    return {
        "false": bool((alarmed < began_s - 1e-6).any()), "found": bool((alarmed >= began_s - 1e-6).any()),
        "right": actual is not None and isolated == actual,
        "wrong": any(actual not in name.split("+") for name in named),
        "held": int(held[said].sum()), "said": int(said.sum()),
        "held_lost": int(held[lost].sum()), "lost": int(lost.sum()), "samples": truth.size,
        "width": (high - low)[said], "credible": float(rows.credible.mean()),
    }  # fmt: skip


def table(results: list[Document]) -> list[list[str]]:
    """The table: a row for each model and size of the fault."""
    rows = []
    for (by, size), of in grouped(results, "by", "size").items():
        total = {key: sum(one[key] for one in of) for key in (*_COUNTED, *_SUMMED)}
        widths = np.concatenate([one["width"] for one in of])
        rows.append([
            by, size, str(len(of)), *(str(total[key]) for key in _COUNTED),
            _share(total["held"], total["said"]), _share(total["held_lost"], total["lost"]),
            f"{total['said'] / max(total['samples'], 1):.2f}",
            f"{np.median(widths):.3f}" if len(widths) else "",
            f"{np.mean([one['credible'] for one in of]):.2f}", _told(of),
        ])  # fmt: skip
    return sorted(rows, key=lambda row: row[0])


def _told(of: list[Document]) -> str:
    losses = [one["told"] for one in of if one["told"] is not None]
    return str(sum(losses)) if losses else ""


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else ""


def ways(of: Campaign, by: Sequence[str], logs: list[Log]) -> dict[str, Callable[[Log], Said]]:
    """The function that diagnoses a log by each of these models. logs: of the training flights."""
    found: dict[str, Callable[[Log], Said]] = {"aircraft": lambda log: by_aircraft(log, of)}
    if "identified" in by:
        model = identified(logs)
        found["identified"] = lambda log: by_model(log, model)
    return {name: found[name] for name in by}


def flown(of: Campaign, by: Sequence[str]) -> list[Document]:
    """Fly a campaign and diagnose each log: a row for each flight and model."""
    results = []
    with tempfile.TemporaryDirectory() as folder:
        logs = [recorded(one, Path(folder)) for one in training(of)]
        noise, tried = noises(logs), ways(of, by, logs)
        for document in scenarios(of):
            log = recorded(document, Path(folder))
            certain = told(log, noise) if log.flown.faults else None
            results += [_tried(name, log, way) | {"told": certain} for name, way in tried.items()]
    return results


def main() -> None:
    """Fly, write, read and diagnose the flights, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--aircraft", default="beaver")
    parser.add_argument("--air", choices=("none", "light", "moderate", "severe"), default="none")
    parser.add_argument("--by", choices=BY, nargs="*", default=BY)
    asked = parser.parse_args()
    of = Campaign(asked.aircraft, asked.air, asked.seed)
    print(markdown_table(HEAD, table(flown(of, asked.by))))


if __name__ == "__main__":
    main()
