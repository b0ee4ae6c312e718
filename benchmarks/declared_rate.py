"""The rate of false alarms that a model declares, and what flights nobody fitted show of it.

    python benchmarks/declared_rate.py [--hours 5] [--seed 1]

Flights of difference equations whose coefficients are known (tests/products/logs/synthetic.py), each with a
trim and a gain of its own, without labels. Prints a row for each rate asked: minutes fitted, threshold, mean
and 90 % interval of the rate that the parts left out give, and alarms an hour in healthy flights of other
days.
With BEAVER_FTC_FLIGHTS set the ALFA flights with a failure follow, by the model of those without: alarms
before the failure, when it is found, and what is named.
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np

from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_logs import extremes, fitting
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Column, RecordedFlight
from beaver_ftc_logs.samples import Samples, load_flights_for_fit, resample
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "flights"))
CASES = ((5.0, 6, 240.0), (1.0, 10, 600.0))  # rate, flights, seconds of each
LENGTH_S = 300.0
HEAD = ["asked, 1/h", "fitted, min", "threshold", "declared, 1/h (90 %)", "seen, 1/h", "hours"]


def flown(vehicle: Vehicle, seed: int, duration_s: float) -> Samples:
    """A healthy flight of a day of its own."""
    import synthetic

    rng = np.random.default_rng([5, seed])
    trim, gain = 0.1 * rng.standard_normal(2), float(np.exp(0.05 * rng.standard_normal()))
    log = synthetic.fly(duration_s, seed=seed, trim=tuple(trim), gain=gain)
    columns = {name: Column(log["t_s"], values) for name, values in log.items() if name != "t_s"}
    return resample(RecordedFlight(f"day-{seed}", columns), vehicle)


def row(per_hour: float, flights: int, duration_s: float, hours: float, seed: int) -> list[str]:
    """One rate: declared by some flights, seen in others."""
    import synthetic
    import yaml

    given = yaml.safe_load(synthetic.VEHICLE) | {"labels": {}, "false_alarms_per_hour": per_hour}
    vehicle = Vehicle.model_validate(given)
    fitted = [flown(vehicle, 1000 * seed + i, duration_s) for i in range(flights)]
    model = identified(fitted, vehicle)
    known, threshold = model.fitted_ranges, model.settings.alarm_threshold
    assert known is not None
    assert known.alarm_peak_tail is not None
    assert threshold is not None
    rate, count = (
        extremes.false_alarm_rate(known.alarm_peak_tail, threshold),
        round(hours * 3600.0 / LENGTH_S),
    )
    alarms = sum(
        begun(diagnose(flown(vehicle, 10**6 + 1000 * seed + i, LENGTH_S), model).faulty) for i in range(count)
    )
    declared = f"{rate.value:.2f} ({rate.low:.2f} to {rate.high:.2f})"
    return [
        f"{per_hour:g}", f"{flights * duration_s / 60.0:.0f}", f"{threshold:.1f}", declared,
        f"{alarms / hours:.2f}", f"{hours:g}",
    ]  # fmt: skip


def identified(flights: list[Samples], vehicle: Vehicle) -> Model:
    """The model of flights, with its threshold."""
    usable_flights = fitting.fit_parts(flights)
    return fitting.add_ranges_and_threshold(usable_flights, fitting.fit_model(usable_flights, vehicle))


def begun(faulty: np.ndarray) -> int:
    """How many alarms there are."""
    return int((np.diff(faulty, prepend=0) == 1).sum())


def alfa(folder: Path) -> list[list[str]]:
    """A row a flight with a failure, by the model of the healthy ones."""
    vehicle, rows = load_vehicle("alfa"), []
    healthy = sorted(folder.glob("*no_failure"))
    model = identified(list(load_flights_for_fit(healthy, vehicle)), vehicle)
    for one in load_flights_for_fit(sorted({*folder.iterdir()} - {*healthy}), vehicle):
        said, begins = diagnose(one, model), min(event.t_s for event in one.logged_failures)
        after = (said.t_s >= begins) & (said.faulty == 1)
        names, count = np.unique(said.isolated_surfaces[after].astype(str), return_counts=True)
        shares = [f"{name} {part / after.sum():.2f}" for name, part in zip(names, count, strict=True)]
        delay = f"{said.t_s[after][0] - begins:.1f}" if after.any() else "never"
        failed = "+".join(sorted({event.surface for event in one.logged_failures}))
        early = begun(said.faulty[said.t_s < begins])
        rows.append([failed, f"{begins - said.t_s[0]:.0f}", str(early), delay, ", ".join(shares)])
    return rows


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=5.0, help="of other days")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    print(markdown_table(HEAD, [row(*case, asked.hours, asked.seed) for case in CASES]))
    if folder := os.environ.get("BEAVER_FTC_FLIGHTS"):
        head = ["failure", "healthy, s", "alarms in health", "found after, s", "named, share of the alarm"]
        print(f"\n{markdown_table(head, alfa(Path(folder) / 'alfa'))}")


if __name__ == "__main__":
    main()
