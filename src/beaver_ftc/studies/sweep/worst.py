"""The flights worth looking at, and the command that flies each again."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.studies.sweep.flights import Flights
from beaver_ftc.studies.sweep.flying import flight_name

if TYPE_CHECKING:
    from beaver_ftc.scenario.sweep_loader import Sweep

OF_EACH_KIND = 3


def worst_flights(flights: Flights, sweep: "Sweep", command: str) -> list[dict[str, Any]]:
    """A few flights of each bad kind, each once: `run`, `name`, `why` (all that is bad), `replay`."""
    whys: dict[int, list[str]] = {}
    for position, why in _candidates(flights):
        whys.setdefault(position, []).append(why)
    return [
        {
            "run": (run := int(flights["run"][position])),
            "name": flight_name(sweep, run),
            "why": why,
            "values": {key: _plain(flights.values(key)[position]) for key in flights.vary},
            "replay": f"{command} --replay {run}",
        }
        for position, why in whys.items()
    ]


def replay_command(source: str, out: Path, search: str | None = None) -> str:
    """The command line that replays a flight, but for its index."""
    words = ["beaver-ftc", "sweep", source]
    words += ["--search", search] if search else []
    words += ["--out", str(out)] if str(out) != "runs" else []
    return shlex.join(words)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _candidates(flights: Flights) -> Iterator[tuple[int, str]]:
    """(position, what is bad about it), the worst kind first."""
    yield from _those(flights, ~flights.measured, lambda i: f"{flights['status'][i]}: {flights['reason'][i]}")
    yield from _those(flights, flights["false_alarm"] & flights.measured, lambda i: "false alarm")
    yield from _those(flights, flights.departed, lambda i: f"departed: {flights['reason'][i]}")
    wrong = flights.faulted & (flights["isolation.fault"] != "") & ~flights["isolation.correct"]
    yield from _those(flights, wrong, lambda i: f"named {flights['isolation.fault'][i]}")
    yield from _those(flights, flights.faulted & ~flights.detected, lambda i: "fault not detected")
    delays = np.where(flights.detected, flights.detection_delay_s, -np.inf)
    yield from _largest(delays, lambda i: f"detected after {delays[i]:.3g} s")
    rms = np.where(flights.faulted & np.isfinite(flights.worst_rms_deg_s), flights.worst_rms_deg_s, -np.inf)
    yield from _largest(rms, lambda i: f"tracking error {rms[i]:.3g} deg/s RMS")
    ratio = np.nan_to_num(flights["worst_residual_ratio"], nan=-np.inf)
    yield from _largest(ratio, lambda i: f"residual {ratio[i]:.4g} of its threshold without a fault")


def _those(flights: Flights, which: np.ndarray, why: Any) -> Iterator[tuple[int, str]]:
    for position in np.flatnonzero(which)[:OF_EACH_KIND].tolist():
        yield position, why(position)


def _largest(values: np.ndarray, why: Any) -> Iterator[tuple[int, str]]:
    for position in np.argsort(-values, kind="stable")[:OF_EACH_KIND].tolist():
        if np.isfinite(values[position]):
            yield position, why(position)
