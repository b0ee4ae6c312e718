"""The worst flights of a sweep, and the command that flies one of them again."""

import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from beaver_ftc.documents.files import Document
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.sweep.one_flight import flight_name
from beaver_ftc.studies.sweep.outcomes import Flights

OF_EACH_KIND = 3  # most flights of each kind of bad result

Candidates = Iterator[tuple[int, str]]
"""(position of a flight in the table, its bad result in words)."""


def worst_flights(flights: Flights, sweep: Sweep, command: str) -> list[Document]:
    """A few flights with each kind of bad result: `run`, `name`, `why` (the kinds for which it was chosen),
    `values`, and `replay`, the command that flies it again. Each flight is listed once."""
    whys: dict[int, list[str]] = {}
    for position, why in _candidates(flights):
        whys.setdefault(position, []).append(why)
    return [
        {
            "run": (run := flights["run"].item(position)),
            "name": flight_name(sweep, run),
            "why": why,
            "values": {key: flights[key].item(position) for key in flights.vary},
            "replay": f"{command} --replay {run}",
        }
        for position, why in whys.items()
    ]


def replay_command(source: str, out: Path, search: str | None) -> str:
    """The command line that replays a flight, without `--replay` and the index of the flight."""
    words = ["beaver-ftc", "sweep", source]
    words += ["--search", search] if search else []
    words += ["--out", str(out)] if str(out) != "runs" else []
    return shlex.join(words)


def _candidates(flights: Flights) -> Candidates:
    """The candidates of all kinds, the worst kind first."""
    faulted = flights.faulted
    diagnosis = flights["isolation.fault"]
    reason = flights["reason"]
    wrong = faulted & (diagnosis != "") & ~flights["isolation.correct"]
    yield from _first(~flights.measured, lambda i: f"{flights['status'][i]}: {reason[i]}")
    yield from _first(flights["false_alarm"] & flights.measured, lambda i: "false alarm")
    yield from _first(flights.departed, lambda i: f"departed: {reason[i]}")
    yield from _first(wrong, lambda i: f"named {diagnosis[i]}")
    yield from _first(faulted & ~flights.detected, lambda i: "fault not detected")
    delay = np.where(flights.detected, flights.detection_delay_s, -np.inf)
    yield from _largest(delay, lambda i: f"detected after {delay[i]:.3g} s")
    rms = flights.worst_rms_deg_s
    rms = np.where(faulted & np.isfinite(rms), rms, -np.inf)
    yield from _largest(rms, lambda i: f"tracking error {rms[i]:.3g} deg/s RMS")
    ratio = np.nan_to_num(flights["worst_residual_ratio"], nan=-np.inf)
    yield from _largest(ratio, lambda i: f"residual {ratio[i]:.4g} of its threshold without a fault")


def _first(mask: np.ndarray, why: Callable[[int], str]) -> Candidates:
    """The first flights of a mask (flights,)."""
    return ((i, why(i)) for i in np.flatnonzero(mask)[:OF_EACH_KIND].tolist())


def _largest(values: np.ndarray, why: Callable[[int], str]) -> Candidates:
    """The flights with the largest finite values (flights,), and how many have the same value."""
    largest = np.argsort(-values, kind="stable")[:OF_EACH_KIND]
    for i in largest[np.isfinite(values[largest])].tolist():
        n_equal = int(np.isclose(values, values[i], rtol=1e-9, atol=0.0).sum())
        yield i, why(i) + (f", as in {n_equal - 1} more" if n_equal > 1 else "")
