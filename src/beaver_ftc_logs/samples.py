"""A recording on one time base: rates, surface commands, further signals and labels, sample by sample.

The time base is the stamps of the roll rate. A column with other stamps is held: its value at t is the last
one received up to t, never a later one; the age that this adds is stated. A log faster than the vehicle's
`max_rate_hz` is averaged over the past interval first. A gap ends a stretch: there are no samples in it, so
that a log has as many as its rows ask for, whatever its clock does.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, physics, signals
from beaver_ftc_logs.readers import read_flight, read_parts
from beaver_ftc_logs.recording import Column, Event, Floats, Recording, nearest_ten
from beaver_ftc_logs.units import SECONDS
from beaver_ftc_logs.vehicle import Vehicle

MIN_RATE_HZ, _MAX_RATE_HZ = 4.0, 1e5
_FIRST = 50
_LARGEST, _FASTEST_RAD_S, _WILD_RAD_S = 1e6, 60.0, 3.0
_PRESSURES = (0.1, 10.0)
"""Least and largest dynamic pressure over that at the reference, whatever the airspeed says."""
MOST_SAMPLES, _STRETCH = 200_000, 5000
"""Samples of a log read in parts that a fit takes at most, and how many of them in turn."""
NOISE_COLOURS = (
    (1.0,), (1.0, 0.5),
    *((1.0, -2.0 * c, c**2) for c in (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9)),
)  # fmt: skip
"""Moving averages of the noise: gusts held within a sample add to the next, gyros' noise takes from it."""
UNSEEN_NOISE = NOISE_COLOURS[:2]
UNSEEN_GYROS_RAD_S = tuple(np.geomspace(1e-5, 1e-2, 7).tolist())
"""What a flight is tried with where no fitted flight had it: gusts of both kinds, and gyros from a
laboratory's to a toy's, so close together that none is 1.8 times off."""
_GAP = 3.5
"""A step of more than this many usual steps is a gap: nothing is predicted across it."""


@dataclass(frozen=True)
class Samples:
    """One flight, ready for identification and filtering.

    t_s (n,) s; rates (n, 3) rad/s; commands (n, S) what each healthy surface would make of the commands;
    signals (n, X); labels (n, S) effectiveness, nan where unknown; run (n,) number of the gap-free stretch;
    age_s: mean age of each held column; stamps (m,) the log's own time stamps, s; notes: what is said of the
    reading; airspeed (n,) m/s, nan where unknown; still_s: for how long each column of rates, commands and
    signals has been the same, (n,) s; clipped (n,): whether a rate is; energy_climb (n,) m/s: rate of
    the energy height over the last seconds, None where it is not logged; colour: the moving average of the
    noise, that rates, commands and signals are whitened by, none where empty; weight: of a sample in a fit;
    parts: in how many the log was read, of which these are stretches where there are several.
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
    airspeed: Floats | None = None
    still_s: Mapping[str, Floats] = field(default_factory=dict)
    clipped: NDArray[np.bool_] | None = None
    energy_climb: Floats | None = None
    colour: tuple[float, ...] = ()
    weight: float = 1.0
    parts: int = 1


_BY_SAMPLE = (
    "t_s", "rates", "commands", "signals", "labels", "run", "airspeed", "clipped", "energy_climb",
)  # fmt: skip


def sample(recording: Recording, vehicle: Vehicle) -> Samples:
    """Put a recording on one time base. Raises BadInput with the reason where the log cannot be used."""
    names = [getattr(vehicle.rates, axis).column for axis in "pqr"]
    used = list(dict.fromkeys([*names, *vehicle.command_names, *vehicle.signal_names]))
    recording = in_si(recording, vehicle)
    _require(recording, used, rates=names)
    _consistent(recording, vehicle)
    stamps = recording.columns[names[0]].t_s
    t_s, run, step = _time_base(recording.name, stamps, vehicle.rate_hz)
    found = {name: at_samples(recording.columns[name], t_s, step) for name in used}
    for name in names:
        values, age_s = found[name]
        found[name] = np.where(_old(recording.columns[name], t_s, step), np.nan, values), age_s

    def columns(names: list[str]) -> Floats:
        return np.column_stack([found[name][0] for name in names]) if names else np.empty((len(t_s), 0))

    samples = Samples(
        name=recording.name,
        t_s=t_s,
        rates=columns(names),
        commands=np.einsum("nc,sc->ns", columns(vehicle.command_names), mixer(vehicle)),
        signals=columns(vehicle.signal_names),
        labels=_labels(recording, vehicle, t_s),
        run=run,
        dt_s=step,
        age_s={name: age_s for name, (_, age_s) in found.items() if age_s is not None},
        events=recording.events,
        stamps=stamps,
        notes=(*recording.notes, *dict.fromkeys(_remarks(recording, used, names))),
        airspeed=_airspeed(recording, vehicle, t_s, step),
        still_s={name: _still(recording.columns[name], t_s) for name in used},
        clipped=_clipped([recording.columns[name] for name in names], t_s),
        energy_climb=_energy_climb(recording, vehicle, (t_s, run, step)),
    )
    reference_mps = vehicle.reference_airspeed_mps
    return samples if reference_mps is None else with_pressure(samples, reference_mps, vehicle.powers)


def with_pressure(samples: Samples, reference_mps: float, powers: Sequence[float] = (2.0,)) -> Samples:
    """The flight with what the airspeed V does of its own: commands times V / reference to the power of each
    surface, (S,) or one, and, as further signals, rates and signals times V / reference - 1, since damping
    and stability grow with it; as at the reference where the airspeed is unknown."""
    airspeed = np.full(len(samples.t_s), np.nan) if samples.airspeed is None else samples.airspeed
    pressure = np.clip(np.nan_to_num(airspeed / reference_mps, nan=1.0) ** 2, *_PRESSURES)[:, None]
    moved = np.column_stack([samples.rates, samples.signals]) * (np.sqrt(pressure) - 1.0)
    signals = np.column_stack([samples.signals, moved])
    return replace(samples, commands=samples.commands * pressure ** (0.5 * np.array(powers)), signals=signals)


def whitened(samples: Samples, colour: Sequence[float], weight: float = 1.0) -> Samples:
    """The flight with rates, commands and signals filtered by C(1) / C(z), C the moving average of the noise
    (1, c1, ...): what is left of an autoregressive model is then white [Ljung1999, section 4.2]. Begins again
    after a gap, and where a number is missing."""
    from scipy.signal import lfilter

    parts = (samples.rates, samples.commands, samples.signals)
    values = np.hstack(parts)
    known = np.isfinite(values).all(axis=1)
    edges = np.flatnonzero((np.diff(known) != 0) | (np.diff(samples.run) != 0)) + 1
    values[~known] = np.nan
    for begin, end in pairwise([0, *edges.tolist(), len(values)]):
        first = values[begin]
        values[begin:end] = first + lfilter([sum(colour)], colour, values[begin:end] - first, axis=0)
    rates, commands, felt = np.split(values, np.cumsum([part.shape[1] for part in parts])[:2], axis=1)
    return replace(samples, rates=rates, commands=commands, signals=felt, colour=tuple(colour), weight=weight)


def _remarks(recording: Recording, used: list[str], rates: list[str]) -> Iterator[str]:
    """What is wrong with the columns that are used, in lines."""
    for name in used:
        yield from signals.remarks(name, recording.columns[name], measured=name in rates)
        if name in rates and (spread := float(np.nanstd(recording.columns[name].values))) > _WILD_RAD_S:
            yield (
                f"{name}: spreads {spread:.3g} rad/s, as hardly an aircraft does: is it in deg/s? a factor "
                "of 0.01745 fits (`unit: deg/s`)"
            )


def _still(column: Column, t_s: Floats) -> Floats:
    """For how long a column has been the same at each sample, s, its age included: rows without a number
    stand still."""
    column = _known(column)
    return np.nan_to_num(_latest(t_s, column.t_s, signals.still_s(column)) + _age(column, t_s))


def _old(column: Column, t_s: Floats, step_s: float) -> NDArray[np.bool_]:
    """Whether at each sample a gap has opened since the last number of a column."""
    column = _known(column)
    usual_s = max(_step(column.t_s), step_s) if len(column.t_s) > 1 else step_s
    return np.asarray(_age(column, t_s) > _GAP * usual_s)


def _clipped(rates: list[Column], t_s: Floats) -> NDArray[np.bool_]:
    """Whether a rate is clipped at each sample."""
    found = [_latest(t_s, rate.t_s, signals.clipped(rate.values).astype(float)) for rate in rates]
    return np.asarray(np.nan_to_num(found).any(axis=0))


def _airspeed(recording: Recording, vehicle: Vehicle, t_s: Floats, step_s: float) -> Floats | None:
    """The airspeed at each sample, nan where it is unknown; None where the vehicle has none."""
    column = recording.columns.get(vehicle.airspeed.column) if vehicle.airspeed else None
    return None if column is None else at_samples(column, t_s, step_s)[0]


def _energy_climb(
    recording: Recording, vehicle: Vehicle, base: tuple[Floats, NDArray[np.int64], float]
) -> Floats | None:
    """As in Samples; base: times, stretches and step of the samples."""
    wanted = [vehicle.energy.altitude, vehicle.energy.airspeed] if vehicle.energy else []
    known = [recording.columns[one.column] for one in wanted if one.column in recording.columns]
    if len(known) < 2 or not all(len(column.t_s) > 1 for column in known):
        return None
    t_s, run, step = base
    altitude, airspeed = (at_samples(column, t_s, step)[0] for column in known)
    return energy.climb_of(t_s, altitude, airspeed, run)


def _consistent(recording: Recording, vehicle: Vehicle) -> None:
    """Raise BadInput where rates, roll and gravity contradict one another: what is in another unit."""
    columns, attitude, says = recording.columns, vehicle.attitude, None
    rates = {(name := getattr(vehicle.rates, axis).column): columns[name] for axis in "pqr"}
    if attitude and not signals.clipped(next(iter(rates.values())).values).any():
        wanted = [attitude.roll, attitude.pitch, attitude.yaw]
        angles = [
            (one.column, columns[one.column]) if one and one.column in columns else None for one in wanted
        ]
        others = [
            *vehicle.signal_names,
            *(one.column for one in vehicle.flow.values()),
            *vehicle.command_names,
        ]
        known = {name: columns[name] for name in dict.fromkeys(others) if name in columns}
        says = physics.attitude_says(rates, angles, known)
    down = vehicle.acceleration and recording.columns.get(vehicle.acceleration.column)
    if not says and vehicle.acceleration and down:
        says = physics.gravity_remark(down, vehicle.acceleration.column)
    if says:
        raise BadInput(f"{recording.name}: {says}, allowed: what the vehicle file says, or its `unit` mended")


def in_si(recording: Recording, vehicle: Vehicle) -> Recording:
    """A recording with the columns that a vehicle names in SI."""
    named = {one.column: one for _, one in vehicle.quantities()}
    named |= {one.column: one for one in vehicle.flow.values()}
    named |= {one.column: one for _, _, one in vehicle.judged()}
    changed = {
        name: replace(column, values=named[name].si(column.values))
        for name, column in recording.columns.items()
        if name in named
    }
    return replace(recording, columns={**recording.columns, **changed})


def mixer(vehicle: Vehicle) -> Floats:
    """What each surface makes of each command, (surfaces, commands)."""
    rows = [[row.get(name, 0.0) for name in vehicle.command_names] for row in vehicle.surfaces.values()]
    return np.array(rows, dtype=float)


def _require(recording: Recording, names: list[str], rates: list[str]) -> None:
    """Raise BadInput where a column is missing, or holds nothing; rates that no vehicle turns at are in
    another unit."""
    missing = [name for name in names if name not in recording.columns]
    if missing:
        known = nearest_ten(missing[0], recording.columns)
        says = f"no column {missing[0]}, allowed: a log that has it; it has {known}"
        raise BadInput(f"{recording.name}: {says}")
    largest = {}
    for name in names:
        values = recording.columns[name].values
        if not np.isfinite(values).any():
            raise BadInput(f"{recording.name}: column {name} holds no number, allowed: a logged quantity")
        largest[name] = float(np.nanmax(np.abs(values)))
        if largest[name] > _LARGEST:
            holds = f"column {name} holds {largest[name]:g}, allowed: up to {_LARGEST:g}"
            raise BadInput(f"{recording.name}: {holds}")
    for name in rates:
        if largest[name] > _FASTEST_RAD_S:
            deg = f" (deg/s would be {np.deg2rad(largest[name]):.3g} rad/s: `unit: deg/s`)"
            raise BadInput(
                f"{recording.name}: column {name} reaches {largest[name]:g}, allowed: rates in rad/s, "
                f"up to {_FASTEST_RAD_S:g}{deg if np.deg2rad(largest[name]) < _FASTEST_RAD_S else ''}"
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
            f"a surface's effect from the vehicle's own motion{_in_another_unit(rate_hz)}"
        )
    if rate_hz > _MAX_RATE_HZ:
        raise BadInput(
            f"{name}: rates are logged at {rate_hz:.2g} Hz, allowed: up to {_MAX_RATE_HZ:g} Hz, "
            "time in seconds"
        )
    if rate_hz <= 1.05 * max_rate_hz:
        return stamps, np.cumsum(np.diff(stamps, prepend=stamps[0]) > _GAP * step), step
    base = _regular(stamps, 1.0 / max_rate_hz)
    if len(base[0]) < _FIRST:
        raise BadInput(
            f"{name}: {len(stamps)} rows within {stamps[-1] - stamps[0]:.3g} s are {len(base[0])} samples at "
            f"{max_rate_hz:g} Hz, allowed: at least {_FIRST}; is time in another unit?"
        )
    return base


def _in_another_unit(rate_hz: float) -> str:
    """The units of time in which a log too slow would be one of 10 to 1000 Hz."""
    fits = [unit for unit, size in SECONDS.items() if unit != "s" and 10.0 <= rate_hz / size <= 1000.0]
    return f" (time in {fits[0]} would be {rate_hz / SECONDS[fits[0]]:.3g} Hz)" if fits else ""


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


def at_samples(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float | None]:
    """A column's values at given times, and how old they are on average, s; None: it has these very times."""
    if len(column.t_s) == len(t_s) and np.array_equal(column.t_s, t_s):
        return column.values, None
    return _averaged(column, t_s, step_s) if _step(column.t_s) < 0.6 * step_s else _held(column, t_s)


def _held(column: Column, t_s: Floats) -> tuple[Floats, float]:
    """The last value up to each time, nan before the first; and its mean age, s."""
    column = _known(column)
    age_s = _age(column, t_s)
    age_s = age_s[np.isfinite(age_s)]
    return _latest(t_s, column.t_s, column.values), float(age_s.mean()) if age_s.size else float("nan")


def _known(column: Column) -> Column:
    """The rows of a column that have a number."""
    known = np.isfinite(column.values)
    return replace(column, t_s=column.t_s[known], values=column.values[known])


def _age(column: Column, t_s: Floats) -> Floats:
    """How old the last row of a column is at each time, s, nan before the first."""
    return t_s - _latest(t_s, column.t_s, column.t_s)


def _latest(t_s: Floats, stamps: Floats, values: Floats) -> Floats:
    """The value of the last stamp up to each time, nan before the first."""
    last = np.searchsorted(stamps, t_s, side="right") - 1
    return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)


def _averaged(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float]:
    """The mean over the interval that ends at each time, and half that interval: the delay it adds, s."""
    column = _known(column)
    stamps, total = column.t_s, np.concatenate([[0.0], np.cumsum(column.values)])
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
        label = vehicle.labels.get(surface)
        column = recording.columns.get(label.column) if label else None
        if label is not None and column is not None:
            labels[:, i] = _latest(t_s, column.t_s, label.si(column.values))
    return labels


def constant_parts(values: Floats) -> list[tuple[int, int]]:
    """Begin and end of each stretch of equal rows; nan is equal to nan."""
    filled = np.nan_to_num(values, nan=-1.0)
    change = np.flatnonzero(np.any(np.diff(filled, axis=0) != 0.0, axis=1)) + 1
    return list(pairwise([0, *change.tolist(), len(values)]))


def read_for(path: Path, vehicle: Vehicle, reader: str | None = None) -> Recording:
    """What a vehicle's file wants of a log. Raises BadInput with the reason where it cannot be used."""
    return read_flight(path, *_wanted(vehicle, reader))


def parts_for(path: Path, vehicle: Vehicle, reader: str | None = None) -> Iterator[Recording]:
    """The same, a long table in parts."""
    return read_parts(path, *_wanted(vehicle, reader))


def _wanted(vehicle: Vehicle, reader: str | None) -> tuple[str | None, tuple[str, str] | None, list[str]]:
    time = (vehicle.time.column, vehicle.time.unit) if vehicle.time else None
    return reader or vehicle.reader, time, vehicle.columns()


def flights_of(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> Iterator[Samples]:
    """The flights, one by one, a long one in parts. Raises BadInput before the first with a line for each
    that cannot be used."""
    whole = [one if one.parts == 1 else None for one in load_flights(paths, vehicle, reader)]
    for path, samples in zip(paths, whole, strict=True):
        if samples is not None:
            yield samples
            continue
        for recording in parts_for(path, vehicle, reader):
            yield sample(recording, vehicle)


def _flight(path: Path, vehicle: Vehicle, reader: str | None) -> Samples:
    """A flight; of a long one stretches that are spread over it evenly."""
    kept: list[Samples] = []
    every, met, known_s = 1, 0, -np.inf
    for number, recording in enumerate(parts_for(path, vehicle, reader), 1):
        found = sample(recording, vehicle)
        for begin in range(int(np.searchsorted(found.t_s, known_s, side="right")), len(found.t_s), _STRETCH):
            if met % every == 0:
                kept.append(_rows_of(found, slice(begin, begin + _STRETCH)))
            met += 1
        while len(kept) * _STRETCH > MOST_SAMPLES and number > 1:
            kept, every = kept[::2], 2 * every
        known_s = found.t_s[-1]
    return found if number == 1 else _in_turn(path.stem, kept, number)


def first(samples: Samples, count: int) -> Samples:
    """The first samples."""
    return samples if count >= len(samples.t_s) else _rows_of(samples, slice(count))


def _rows_of(samples: Samples, rows: slice) -> Samples:
    """Some of the samples, copied."""
    cut = {name: of[rows].copy() for name in _BY_SAMPLE if (of := getattr(samples, name)) is not None}
    still_s = {name: of[rows].copy() for name, of in samples.still_s.items()}
    return replace(samples, stamps=cut["t_s"], still_s=still_s, **cut)


def _in_turn(name: str, flights: list[Samples], parts: int) -> Samples:
    """Samples one after the other, with a gap between."""
    known = [name for name in _BY_SAMPLE if getattr(flights[0], name) is not None]
    whole: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in flights]) for name in known}
    begins = np.diff(whole["run"], prepend=whole["run"][0]) != 0
    begins[np.cumsum([len(one.t_s) for one in flights])[:-1]] = True
    whole["run"] = np.cumsum(begins)
    still_s = {name: np.concatenate([one.still_s[name] for one in flights]) for name in flights[0].still_s}
    many = f"a long log, read in {parts} parts: {len(begins)} samples of it, spread evenly, are looked at"
    notes = (many, *dict.fromkeys(note for one in flights for note in one.notes))
    return replace(
        flights[0], name=name, notes=notes, parts=parts, stamps=whole["t_s"], still_s=still_s, **whole
    )


def load_flights(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> list[Samples]:
    """The flights, each on one time base, of a long one what a fit wants of it. Raises BadInput with a line
    for each that cannot be used."""
    loaded: list[Samples] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            loaded.append(_flight(path, vehicle, reader))
        except BadInput as error:
            mistakes.append(str(error))
    for name, count in Counter(samples.name for samples in loaded).items():
        if count > 1:
            mistakes.append(f"two flights are named {name}: one result would replace the other")
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded
