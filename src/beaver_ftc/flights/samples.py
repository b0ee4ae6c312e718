"""A recording on one time base: rates, surface commands, further signals and labels, sample by sample.

The time base is the stamps of the roll rate. A column with other stamps is held: its value at t is the last
one received up to t, never a later one; the age that this adds is stated. A log faster than the vehicle's
`max_rate_hz` is averaged over the past interval first. A gap ends a stretch: there are no samples in it, so
that a log has as many as its rows ask for, whatever its clock does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.readers import read_flight
from beaver_ftc.flights.recording import Column, Event, Floats, Recording
from beaver_ftc.flights.vehicle import Vehicle

MIN_RATE_HZ, _MAX_RATE_HZ = 4.0, 1e5
_FIRST = 50
_LARGEST, _FASTEST_RAD_S = 1e6, 60.0
_GAP = 3.5
"""A step of more than this many usual steps is a gap: nothing is predicted across it."""


@dataclass(frozen=True)
class Samples:
    """One flight, ready for identification and filtering.

    t_s (n,) s; rates (n, 3) rad/s; commands (n, S) what each healthy surface would make of the commands;
    signals (n, X); labels (n, S) effectiveness, nan where unknown; run (n,) number of the gap-free stretch;
    age_s: mean age of each held column; stamps (m,) the log's own time stamps, s; notes: what is said of the
    reading.
    """

    name: str
    t_s: Floats
    rates: Floats
    commands: Floats
    signals: Floats
    labels: Floats
    run: NDArray[np.int64]
    dt_s: float
    age_s: dict[str, float]
    events: tuple[Event, ...]
    stamps: Floats
    notes: tuple[str, ...] = ()


def sample(recording: Recording, vehicle: Vehicle) -> Samples:
    """Put a recording on one time base. Raises BadInput with the reason where the log cannot be used."""
    names = [vehicle.rates.p, vehicle.rates.q, vehicle.rates.r]
    used = [*names, *vehicle.commands, *vehicle.signals]
    _require(recording, used)
    _require_rad_s(recording, names)
    stamps = recording.columns[vehicle.rates.p].t_s
    t_s, run, step = _time_base(recording.name, stamps, vehicle.max_rate_hz)
    grid = _Grid(recording, t_s, step)
    return Samples(
        name=recording.name,
        t_s=t_s,
        rates=grid.columns(names),
        commands=np.einsum("nc,sc->ns", grid.columns(vehicle.commands), mixer(vehicle)),
        signals=grid.columns(vehicle.signals),
        labels=_labels(recording, vehicle, t_s),
        run=run,
        dt_s=step,
        age_s=grid.age_s,
        events=recording.events,
        stamps=stamps,
        notes=(*recording.notes, *_left_out(recording, used)),
    )


def mixer(vehicle: Vehicle) -> Floats:
    """What each surface makes of each command, (surfaces, commands)."""
    rows = [[row.get(name, 0.0) for name in vehicle.commands] for row in vehicle.surfaces.values()]
    return np.array(rows, dtype=float)


def _require(recording: Recording, names: list[str]) -> None:
    missing = [name for name in dict.fromkeys(names) if name not in recording.columns]
    if missing:
        known = ", ".join(name if name.isprintable() else repr(name) for name in sorted(recording.columns))
        raise BadInput(
            f"{recording.name}: no column {missing[0]}, allowed: a log that has it; it has {known or 'none'}"
        )
    for name in names:
        values = recording.columns[name].values
        if not np.isfinite(values).any():
            raise BadInput(f"{recording.name}: column {name} holds no number, allowed: a logged quantity")
        if (largest := float(np.nanmax(np.abs(values)))) > _LARGEST:
            raise BadInput(f"{recording.name}: column {name} holds {largest:g}, allowed: up to {_LARGEST:g}")


def _left_out(recording: Recording, names: list[str]) -> list[str]:
    """What readers say of rows they left out, once each."""
    return list(dict.fromkeys(note for name in names if (note := recording.columns[name].note)))


def _require_rad_s(recording: Recording, names: list[str]) -> None:
    """Rates that no vehicle turns at are in another unit."""
    for name in names:
        largest = float(np.nanmax(np.abs(recording.columns[name].values)))
        if largest > _FASTEST_RAD_S:
            raise BadInput(
                f"{recording.name}: column {name} reaches {largest:g}, allowed: rates in rad/s, "
                f"up to {_FASTEST_RAD_S:g}"
            )


def _time_base(name: str, stamps: Floats, max_rate_hz: float) -> tuple[Floats, NDArray[np.int64], float]:
    """Times of the samples and the number of the gap-free stretch of each, (n,), and the usual step, s."""
    if len(stamps) < _FIRST:
        raise BadInput(f"{name}: has {len(stamps)} samples of the rates, allowed: at least {_FIRST}")
    step = _step(stamps)
    rate_hz = 1.0 / step
    if rate_hz < MIN_RATE_HZ:
        raise BadInput(
            f"{name}: rates are logged at {rate_hz:.2g} Hz, allowed: at least {MIN_RATE_HZ:g} Hz to tell "
            "a surface's effect from the vehicle's own motion"
        )
    if rate_hz > _MAX_RATE_HZ:
        raise BadInput(
            f"{name}: rates are logged at {rate_hz:.2g} Hz, allowed: up to {_MAX_RATE_HZ:g} Hz, "
            "time in seconds"
        )
    if rate_hz <= 1.05 * max_rate_hz:
        return stamps, np.cumsum(np.diff(stamps, prepend=stamps[0]) > _GAP * step), step
    return _regular(stamps, 1.0 / max_rate_hz)


def _regular(stamps: Floats, step: float) -> tuple[Floats, NDArray[np.int64], float]:
    """Samples a step apart over each stretch of the log, from its first stamp on: as `_time_base`."""
    first = np.flatnonzero(np.diff(stamps, prepend=-np.inf) > _GAP * step)
    last = np.append(first[1:], len(stamps)) - 1
    counts = np.ceil((stamps[last] - stamps[first]) / step + 0.5).astype(np.int64)
    run = np.repeat(np.arange(len(first)), counts)
    within = np.arange(len(run)) - np.repeat(np.cumsum(counts) - counts, counts)
    return stamps[first][run] + within * step, run, step


def _step(stamps: Floats) -> float:
    """The usual step of the first stamps, s: a log cut short later has the same."""
    return float(np.median(np.diff(stamps[:_FIRST]))) if len(stamps) > 1 else float("inf")


class _Grid:
    """Columns of a recording at given times; remembers how old what it holds is."""

    def __init__(self, recording: Recording, t_s: Floats, step_s: float) -> None:
        self._recording, self._t_s, self._step_s = recording, t_s, step_s
        self.age_s: dict[str, float] = {}

    def columns(self, names: list[str]) -> Floats:
        return (
            np.column_stack([self.column(name) for name in names]) if names else np.empty((len(self._t_s), 0))
        )

    def column(self, name: str) -> Floats:
        column = self._recording.columns[name]
        if len(column.t_s) == len(self._t_s) and np.array_equal(column.t_s, self._t_s):
            return column.values
        faster = _step(column.t_s) < 0.6 * self._step_s
        values, age_s = _averaged(column, self._t_s, self._step_s) if faster else _held(column, self._t_s)
        self.age_s[name] = age_s
        return values


def _held(column: Column, t_s: Floats) -> tuple[Floats, float]:
    """The last value up to each time, nan before the first; and its mean age, s."""
    known = np.isfinite(column.values)
    stamps, values = column.t_s[known], column.values[known]
    last = np.searchsorted(stamps, t_s, side="right") - 1
    held = np.where(last >= 0, values[np.maximum(last, 0)], np.nan)
    age_s = (t_s - stamps[np.maximum(last, 0)])[last >= 0]
    return held, float(age_s.mean()) if age_s.size else float("nan")


def _averaged(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float]:
    """The mean over the interval that ends at each time, and half that interval: the delay it adds, s."""
    known = np.isfinite(column.values)
    stamps, total = column.t_s[known], np.concatenate([[0.0], np.cumsum(column.values[known])])
    rounding = 1e-6 * step_s  # of stamps that are meant to fall on the edge
    end = np.searchsorted(stamps, t_s + rounding, side="right")
    start = np.searchsorted(stamps, t_s - step_s + rounding, side="right")
    count = end - start
    held, _ = _held(column, t_s)
    mean = (total[end] - total[start]) / np.maximum(count, 1)
    return np.where(count > 0, mean, held), 0.5 * step_s


def _labels(recording: Recording, vehicle: Vehicle, t_s: Floats) -> Floats:
    """Labels (n, S) as the log gives them, nan for a surface without one and where the log says nothing."""
    labels = np.full((len(t_s), len(vehicle.surfaces)), np.nan)
    for i, surface in enumerate(vehicle.surfaces):
        column = recording.columns.get(vehicle.labels.get(surface, ""))
        if column is not None:
            labels[:, i] = _at_stamps(column, t_s)
    return labels


def _at_stamps(column: Column, t_s: Floats) -> Floats:
    """A label is held without skipping its gaps: where the log says nothing it is unknown."""
    last = np.searchsorted(column.t_s, t_s, side="right") - 1
    return np.where(last >= 0, column.values[np.maximum(last, 0)], np.nan)


def load_flights(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> list[Samples]:
    """The flights, each on one time base. Raises BadInput with a line for each that cannot be used."""
    loaded: list[Samples] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            loaded.append(sample(read_flight(path, reader or vehicle.reader), vehicle))
        except BadInput as error:
            mistakes.append(str(error))
    mistakes += _repeated([samples.name for samples in loaded])
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded


def _repeated(names: list[str]) -> list[str]:
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    return [f"two flights are named {name}: one result would replace the other" for name in twice]
