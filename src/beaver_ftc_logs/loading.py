"""From files to samples: the columns that a vehicle file names, long logs in parts, and the samples for a
fit."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers import read_parts, split_long_recording
from beaver_ftc_logs.recording import RecordedFlight
from beaver_ftc_logs.samples import Samples, resample
from beaver_ftc_logs.time_base import median_step_s
from beaver_ftc_logs.vehicle import Vehicle

MAX_FIT_SAMPLES = 200_000  # largest number of samples for a fit from a log that is read in parts
_FIT_SAMPLES = 5000  # length of each stretch of these samples


def read_vehicle_columns(path: Path, vehicle: Vehicle) -> RecordedFlight:
    """The columns of a log that a vehicle file names. Raises BadInput if the log cannot be used."""
    return next(_read_vehicle_log(path, vehicle, None, in_parts=False))


def read_vehicle_parts(path: Path, vehicle: Vehicle, reader: str | None = None) -> Iterator[RecordedFlight]:
    """The columns of a log that a vehicle file names, a long log in parts: a table by its rows, another log
    by the number of samples after averaging.
    """
    for log in _read_vehicle_log(path, vehicle, reader, in_parts=True):
        column = log.columns.get(vehicle.rates.p.column)
        if column is None:  # the caller reports a missing column
            yield log
            continue
        ratio = 1.0 / (median_step_s(column.t_s) * vehicle.max_sample_rate_hz)
        yield from split_long_recording(log, column.t_s, max(ratio, 1.0))


def _read_vehicle_log(
    path: Path, vehicle: Vehicle, reader: str | None, in_parts: bool
) -> Iterator[RecordedFlight]:
    """A log with the columns of a vehicle file, a long table in parts."""
    time = (vehicle.time.column, vehicle.time.unit) if vehicle.time else None
    return read_parts(path, reader or vehicle.reader, time, vehicle.column_names(), in_parts)


def stream_flights(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> Iterator[Samples]:
    """The flights one by one, a long one in parts. Raises BadInput before the first flight, with a line for
    each log that cannot be used.
    """
    loaded = load_flights_for_fit(paths, vehicle, reader)
    flights = [flight if flight.n_log_parts == 1 else None for flight in loaded]
    del loaded  # a long log is read again below: its stretches need not stay in memory
    for path, samples in zip(paths, flights, strict=True):
        if samples is not None:
            yield samples
        else:
            yield from (resample(log, vehicle) for log in read_vehicle_parts(path, vehicle, reader))


def _read_flight_for_fit(path: Path, vehicle: Vehicle, reader: str | None) -> Samples:
    """A flight; if it is long, stretches of _FIT_SAMPLES samples that are spread over it evenly.

    Of the stretches so far, every `every`-th is kept. If the kept ones exceed MAX_FIT_SAMPLES, every second
    of them is dropped, and `every` doubles. until_s: end of the part before, since parts overlap.
    """
    kept: list[Samples] = []
    every = 1
    n_seen = 0
    until_s = -np.inf
    for part, log in enumerate(read_vehicle_parts(path, vehicle, reader), 1):
        samples = resample(log, vehicle)
        first = int(np.searchsorted(samples.t_s, until_s, side="right"))
        for begin in range(first, len(samples.t_s), _FIT_SAMPLES):
            if n_seen % every == 0:
                kept.append(select_rows(samples, slice(begin, begin + _FIT_SAMPLES)))
            n_seen += 1
        while len(kept) * _FIT_SAMPLES > MAX_FIT_SAMPLES and part > 1:
            kept = kept[::2]
            every = 2 * every
        until_s = samples.t_s[-1]
    return samples if part == 1 else _concatenate_samples(path.stem, kept, part)


def select_rows(samples: Samples, rows: slice) -> Samples:
    """Some of the samples, copied. Their own times `t_s` replace the stamps `log_stamps_s` of the log."""
    return _rebuilt([samples], lambda arrays: arrays[0][rows].copy())


def _rebuilt(parts: list[Samples], join: Callable[[list[Any]], Any]) -> Samples:
    """Samples whose arrays `join` makes of the arrays of the parts; all other fields are those of the first
    part."""
    first = parts[0]
    names = [name for name, value in vars(first).items() if isinstance(value, np.ndarray)]
    fields = {name: join([getattr(part, name) for part in parts]) for name in names}
    fields["log_stamps_s"] = fields["t_s"]
    unchanged = {name: join([part.unchanged_s[name] for part in parts]) for name in first.unchanged_s}
    return replace(first, unchanged_s=unchanged, **fields)


def _concatenate_samples(name: str, stretches: list[Samples], n_parts: int) -> Samples:
    """The samples of stretches one after the other, each a gap-free stretch of its own. name: of the log."""
    joined = _rebuilt(stretches, np.concatenate)
    is_begin = np.diff(joined.stretch_number, prepend=joined.stretch_number[0]) != 0
    is_begin[np.cumsum([len(stretch.t_s) for stretch in stretches])[:-1]] = True
    kept = f"{len(is_begin)} samples of it, spread evenly, are looked at"
    notes = dict.fromkeys(note for stretch in stretches for note in stretch.notes)
    return replace(
        joined,
        name=name,
        notes=(f"a long log, read in {n_parts} parts: {kept}", *notes),
        n_log_parts=n_parts,
        stretch_number=np.cumsum(is_begin),
        confirmed_rates=frozenset.intersection(*(stretch.confirmed_rates for stretch in stretches)),
    )


def load_flights_for_fit(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> list[Samples]:
    """The flights, each on one time base; of a long one the stretches for a fit. If no log has a label, they
    are averaged as in moving air, which `identify` then assumes, although the vehicle file may name labels.
    Raises BadInput with a line for each log that cannot be used.
    """
    flights: list[Samples] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            flights.append(_read_flight_for_fit(path, vehicle, reader))
        except BadInput as error:
            mistakes.append(str(error))
    if mistakes:
        raise BadInput("\n".join(mistakes))
    refuse_equal_names(samples.name for samples in flights)
    if vehicle.labels and vehicle.moving_air is None and not have_labels(flights):
        return load_flights_for_fit(paths, vehicle.model_copy(update={"moving_air": True}), reader)
    return flights


def have_labels(flights: Iterable[Samples]) -> bool:
    """Whether any of the flights has a known label."""
    return any(np.isfinite(flight.labels).any() for flight in flights)


def refuse_equal_names(names: Iterable[str]) -> None:
    """Raise BadInput if two flights have the same name."""
    for name, n in Counter(names).items():
        if n > 1:
            raise BadInput(f"two flights are named {name}: one result would replace the other")
