"""A recording on one time base: rates, surface commands, further signals and labels, sample by sample.

The time base is the stamps of the roll rate. A column with other stamps is held: its value at t is the last
one received up to t, never a later one; the age that this adds is stated. A log faster than the vehicle's
`max_rate_hz` is averaged over the past interval first. A gap ends a stretch: there are no samples in it, so
that a log has as many as its rows ask for, whatever its clock does.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, physics, signals
from beaver_ftc_logs.physics import NamedColumn
from beaver_ftc_logs.readers import read_parts, split_long_recording
from beaver_ftc_logs.recording import (
    Column,
    Columns,
    Floats,
    Ints,
    LoggedFailure,
    Mask,
    RecordedFlight,
    Runs,
    largest_magnitude,
    runs_between,
)
from beaver_ftc_logs.units import TIME_UNITS
from beaver_ftc_logs.vehicle import QuantityColumn, Vehicle

MIN_HZ, _MAX_HZ = 4.0, 1e5
_MIN_ROWS = 50
_MAX_NUMBER, _MAX_RATE_RAD_S, _MAX_RATE_SD_RAD_S = 1e6, 60.0, 3.0
_QDYN_RATIOS = (0.1, 10.0)
"""Least and largest dynamic pressure over that at the reference, whatever the airspeed says."""
MAX_FIT_SAMPLES, _FIT_SAMPLES = 200_000, 5000
"""Samples of a log read in parts that a fit takes at most, and how many of them in turn."""
NOISE_MA_CANDIDATES = (
    (1.0,), (1.0, 0.5),
    *((1.0, -2.0 * c, c**2) for c in (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9)),
)  # fmt: skip
"""Moving averages of the noise: gusts held within a sample add to the next, gyros' noise takes from it."""
UNFITTED_MA = NOISE_MA_CANDIDATES[:2]
UNFITTED_GYROS_RAD_S = tuple(np.geomspace(1e-5, 1e-2, 7).tolist())
"""Noise that is tried where no fitted flight had it: gusts of both kinds, and gyros from a laboratory's to a
toy's, so close together that none is 1.8 times off."""
_MIN_GAP_STEPS = 3.5
"""A step of more than this many usual steps is a gap: nothing is predicted across it."""


@dataclass(frozen=True)
class Samples:
    """One flight, ready for identification and filtering.

    t_s (n,) s: the log's own stamps, or an even grid within each stretch if the log is faster than the
    vehicle's largest sample rate. rates (n, 3) rad/s. commands (n, S): command of each surface as the mixer
    makes it, in shares of travel. signals (n, X). labels (n, S): effectiveness, nan where unknown.
    stretch_number (n,): number of the gap-free stretch. held_age_s: mean age of the values of each column
    that is held. log_stamps_s (m,): the log's own time stamps, s. notes: remarks on the reading. airspeed
    (n,) m/s, nan where unknown. unchanged_s: for how long each column of rates, commands and signals has been
    constant, (n,) s. is_rate_clipped (n,). energy_height_rate_mps (n,): rate of the energy height over the
    last seconds, nan where unknown. noise_ma_coefficients: the moving average of the noise by which
    rates, commands and signals are whitened, empty if they are not. fit_weight of each sample in a fit.
    n_log_parts: number of parts in which the log was read; if several, the samples are chosen stretches.
    confirmed_rates: the columns of rates that the logged angles confirm.
    """

    name: str
    t_s: Floats
    rates: Floats
    commands: Floats
    signals: Floats
    labels: Floats
    stretch_number: Ints
    dt_s: float
    held_age_s: dict[str, float]
    logged_failures: tuple[LoggedFailure, ...]
    log_stamps_s: Floats
    airspeed: Floats
    is_rate_clipped: Mask
    energy_height_rate_mps: Floats
    notes: tuple[str, ...] = ()
    unchanged_s: Mapping[str, Floats] = field(default_factory=dict)
    noise_ma_coefficients: tuple[float, ...] = ()
    fit_weight: float = 1.0
    n_log_parts: int = 1
    confirmed_rates: frozenset[str] = frozenset()


def resample(log: RecordedFlight, vehicle: Vehicle) -> Samples:
    """Put a log on one time base. Raises BadInput with the reason where the log cannot be used."""
    rate_names = vehicle.rate_columns
    used = list(dict.fromkeys([*rate_names, *vehicle.command_columns, *vehicle.signal_columns]))
    log = convert_to_si(log, vehicle)
    _refuse_columns(log, used, rate_names)
    confirmed = _check_attitude(log, vehicle)
    stamps = log.columns[rate_names[0]].t_s
    t_s, stretch, step_s = _time_base(log.name, stamps, vehicle.max_sample_rate_hz)
    held = {name: sample_column(log.columns[name], t_s, step_s) for name in used}
    for name in rate_names:
        values, age_s = held[name]
        held[name] = np.where(_is_held_value_stale(log.columns[name], t_s, step_s), np.nan, values), age_s

    def stacked_columns(names: list[str]) -> Floats:
        return np.column_stack([held[name][0] for name in names]) if names else np.empty((len(t_s), 0))

    def sampled(quantity: QuantityColumn | None) -> Floats:
        column = log.columns.get(quantity.column) if quantity else None
        return sample_column(column, t_s, step_s)[0] if column else np.full(len(t_s), np.nan)

    heights = (vehicle.energy.altitude, vehicle.energy.airspeed) if vehicle.energy else (None, None)
    altitude_m, airspeed_mps = map(sampled, heights)
    rates = [log.columns[name] for name in rate_names]
    clipped = [signals.find_clipped_rows(rate.values).astype(float) for rate in rates]
    was_clipped = [_latest_values(t_s, rate.t_s, rows) for rate, rows in zip(rates, clipped, strict=True)]
    labels = np.full((len(t_s), len(vehicle.surfaces)), np.nan)
    for i, surface in enumerate(vehicle.surfaces):
        quantity = vehicle.labels.get(surface)
        if quantity and (column := log.columns.get(quantity.column)):
            labels[:, i] = _latest_values(t_s, column.t_s, quantity.to_si(column.values))
    samples = Samples(
        name=log.name,
        t_s=t_s,
        rates=stacked_columns(rate_names),
        commands=_mixed_commands(log.name, stacked_columns(vehicle.command_columns), vehicle),
        signals=stacked_columns(vehicle.signal_columns),
        labels=labels,
        stretch_number=stretch,
        dt_s=step_s,
        held_age_s={name: age_s for name, (_, age_s) in held.items() if age_s is not None},
        logged_failures=log.logged_failures,
        log_stamps_s=stamps,
        notes=(*log.notes, *dict.fromkeys(_defects(log, used, rate_names))),
        airspeed=sampled(vehicle.airspeed),
        unchanged_s={name: unchanged_s(log.columns[name], t_s) for name in used},
        is_rate_clipped=np.logical_or.reduce(np.nan_to_num(was_clipped)),
        energy_height_rate_mps=energy.energy_climb_mps(t_s, altitude_m, airspeed_mps, stretch),
        confirmed_rates=confirmed,
    )
    V0 = vehicle.reference_airspeed_mps
    return samples if V0 is None else scale_by_airspeed(samples, V0, vehicle.surface_airspeed_powers)


def scale_by_airspeed(samples: Samples, V0: float, powers: Sequence[float] = (2.0,)) -> Samples:
    """The flight with what the airspeed V does of its own: commands times (V / V0)^n, n the power of each
    surface, (S,) or one, and, as further signals, rates and signals times V / V0 - 1, since damping and
    stability grow with it; V = V0 m/s where the airspeed is unknown."""
    ratio = np.clip(np.nan_to_num(samples.airspeed / V0, nan=1.0) ** 2, *_QDYN_RATIOS)[:, None]
    products = np.column_stack([samples.rates, samples.signals]) * (np.sqrt(ratio) - 1.0)
    joined = np.column_stack([samples.signals, products])
    return replace(samples, commands=samples.commands * ratio ** (0.5 * np.array(powers)), signals=joined)


def whiten_samples(samples: Samples, C: Sequence[float], fit_weight: float = 1.0) -> Samples:
    """The flight with rates, commands and signals filtered by C(1) / C(z), C the moving average of the noise
    (1, c1, ...): what is left of an autoregressive model is then white [Ljung1999, section 4.2]. Begins again
    after a gap, and where a number is missing."""
    from scipy.signal import lfilter

    arrays = (samples.rates, samples.commands, samples.signals)
    x = np.hstack(arrays)
    known = np.isfinite(x).all(axis=1)
    x[~known] = np.nan
    for a, b in runs_between((np.diff(known) != 0) | (np.diff(samples.stretch_number) != 0)):
        x0 = x[a]
        x[a:b] = x0 + lfilter([sum(C)], C, x[a:b] - x0, axis=0)
    names, ends = ("rates", "commands", "signals"), np.cumsum([array.shape[1] for array in arrays])[:2]
    white: dict[str, Any] = dict(zip(names, np.split(x, ends, axis=1), strict=True))
    return replace(samples, noise_ma_coefficients=tuple(C), fit_weight=fit_weight, **white)


def _defects(log: RecordedFlight, used: list[str], rate_names: list[str]) -> Iterator[str]:
    """Yield a line for each mistake in the columns that are used."""
    for name in used:
        yield from signals.column_defect_texts(name, log.columns[name], is_rate=name in rate_names)
        if name in rate_names and (sd := float(np.nanstd(log.columns[name].values))) > _MAX_RATE_SD_RAD_S:
            hint = "is it in deg/s? a factor of 0.01745 fits (`unit: deg/s`)"
            yield f"{name}: spreads {sd:.3g} rad/s, as hardly an aircraft does: {hint}"


def unchanged_s(column: Column, t_s: Floats) -> Floats:
    """For how long a column has been the same at each sample, s, its age included: rows without a number
    stand still."""
    column = _finite_rows(column)
    since_s = _latest_values(t_s, column.t_s, signals.time_since_change_s(column))
    return np.nan_to_num(since_s + _held_age_s(column, t_s))


def _is_held_value_stale(column: Column, t_s: Floats, step_s: float) -> Mask:
    """Whether at each sample a gap has opened since the last number of a column."""
    column = _finite_rows(column)
    usual_step_s = max(median_step_s(column.t_s), step_s) if len(column.t_s) > 1 else step_s
    return _held_age_s(column, t_s) > _MIN_GAP_STEPS * usual_step_s


def _check_attitude(log: RecordedFlight, vehicle: Vehicle) -> frozenset[str]:
    """The columns of rates that the angles confirm. Raises BadInput where rates, angles and gravity
    contradict one another: what is in another unit."""
    columns, mistake = log.columns, None
    confirmed = frozenset[str]()
    rates = {name: columns[name] for name in vehicle.rate_columns}
    if not signals.find_clipped_rows(next(iter(rates.values())).values).any():
        angles = named_angles(columns, vehicle)
        flow = [quantity.column for quantity in vehicle.flow.values()]
        possible = dict.fromkeys([*vehicle.signal_columns, *flow, *vehicle.command_columns])
        candidates = {name: columns[name] for name in possible if name in columns}
        mistake = physics.attitude_mistake(rates, angles, candidates)
        confirmed = physics.confirmed_rates(rates, angles)
    az = vehicle.acceleration and columns.get(vehicle.acceleration.column)
    if not mistake and vehicle.acceleration and az:
        mistake = physics.gravity_remark(az, vehicle.acceleration.column)
    if mistake:
        raise BadInput(f"{log.name}: {mistake}, allowed: what the vehicle file says, or its `unit` mended")
    return confirmed


def named_angles(columns: Columns, vehicle: Vehicle) -> list[NamedColumn | None]:
    """The columns of roll, pitch and yaw; None of an angle that is not named or not logged."""
    angles = [getattr(vehicle.attitude, angle, None) for angle in ("roll", "pitch", "yaw")]
    return [(of.column, columns[of.column]) if of and of.column in columns else None for of in angles]


def convert_to_si(log: RecordedFlight, vehicle: Vehicle) -> RecordedFlight:
    """A log with the columns that a vehicle names in SI."""
    columns = dict(log.columns)
    quantities = {quantity.column: quantity for *_, quantity in reversed(vehicle.located_quantities())}
    for name, quantity in quantities.items():
        if name in columns:
            columns[name] = replace(columns[name], values=quantity.to_si(columns[name].values))
    return replace(log, columns=columns)


def mixer_matrix(vehicle: Vehicle) -> Floats:
    """Return the share of each command in each surface, (surfaces, commands)."""
    mixer_rows = [
        [shares.get(name, 0.0) for name in vehicle.command_columns] for shares in vehicle.surfaces.values()
    ]
    return np.array(mixer_rows, dtype=float)


def _mixed_commands(flight: str, logged_commands: Floats, vehicle: Vehicle) -> Floats:
    """Return the deflection that the commands (n, C) ask of each surface, (n, S). Raises BadInput where a
    weight makes one larger than a logged number may be."""
    with np.errstate(over="ignore", invalid="ignore"):
        commands: Floats = np.einsum("nc,sc->ns", logged_commands, mixer_matrix(vehicle))
    too_large = (np.isinf(commands) | (np.abs(commands) > _MAX_NUMBER)).any(axis=0)
    if too_large.any():
        surface = list(vehicle.surfaces)[int(too_large.argmax())]
        allowed = f"allowed: weights in `surfaces` that give up to {_MAX_NUMBER:g}"
        raise BadInput(f"{flight}: the command of {surface} is too large, {allowed}")
    return commands


def _refuse_columns(log: RecordedFlight, used: list[str], rate_names: list[str]) -> None:
    """Raise BadInput where a column is missing, or holds nothing; rates that no vehicle turns at are in
    another unit."""
    log.check_has(used)
    for name in used:
        values = log.columns[name].values
        if not np.isfinite(values).any():
            raise BadInput(f"{log.name}: column {name} holds no number, allowed: a logged quantity")
        largest = largest_magnitude(values)
        if largest > _MAX_NUMBER:
            raise BadInput(f"{log.name}: column {name} holds {largest:g}, allowed: up to {_MAX_NUMBER:g}")
        if name in rate_names and largest > _MAX_RATE_RAD_S:
            as_deg = np.deg2rad(largest)
            hint = f" (deg/s would be {as_deg:.3g} rad/s: `unit: deg/s`)" if as_deg < _MAX_RATE_RAD_S else ""
            allowed = f"rates in rad/s, up to {_MAX_RATE_RAD_S:g}{hint}"
            raise BadInput(f"{log.name}: column {name} reaches {largest:g}, allowed: {allowed}")


def _time_base(flight: str, stamps: Floats, max_hz: float) -> tuple[Floats, Ints, float]:
    """Times of the samples and the number of the gap-free stretch of each, (n,), and the usual step, s."""
    if (n := len(stamps)) < _MIN_ROWS:
        raise BadInput(f"{flight}: has {n} samples of the rates, allowed: at least {_MIN_ROWS}")
    step_s = median_step_s(stamps)
    rate_hz = 1.0 / step_s
    logged = f"{flight}: rates are logged at {rate_hz:.2g} Hz"
    if rate_hz < MIN_HZ:
        units = {unit: rate_hz / seconds for unit, seconds in TIME_UNITS.items() if unit != "s"}
        hints = [f" (time in {unit} would be {hz:.3g} Hz)" for unit, hz in units.items() if 10 <= hz <= 1000]
        reason = f"to tell a surface's effect from the vehicle's own motion{''.join(hints[:1])}"
        raise BadInput(f"{logged}, allowed: at least {MIN_HZ:g} Hz {reason}")
    if rate_hz > _MAX_HZ:
        raise BadInput(f"{logged}, allowed: up to {_MAX_HZ:g} Hz, time in seconds")
    if rate_hz <= 1.05 * max_hz:
        return stamps, np.cumsum(np.diff(stamps, prepend=stamps[0]) > _MIN_GAP_STEPS * step_s), step_s
    even = _even_time_base(stamps, 1.0 / max_hz)
    if len(even[0]) < _MIN_ROWS:
        reason = f"{n} rows within {stamps[-1] - stamps[0]:.3g} s are {len(even[0])} samples at {max_hz:g} Hz"
        allowed = f"at least {_MIN_ROWS}; is time in another unit?"
        raise BadInput(f"{flight}: {reason}, allowed: {allowed}")
    return even


def _even_time_base(stamps: Floats, step_s: float) -> tuple[Floats, Ints, float]:
    """Samples a step apart over each stretch of the log, from its first stamp on: as `_time_base`."""
    begin = np.flatnonzero(np.diff(stamps, prepend=-np.inf) > _MIN_GAP_STEPS * step_s)
    last = np.append(begin[1:], len(stamps)) - 1
    counts = np.ceil((stamps[last] - stamps[begin]) / step_s + 0.5).astype(np.int64)
    stretch = np.repeat(np.arange(len(begin)), counts)
    index = np.arange(len(stretch)) - np.repeat(np.cumsum(counts) - counts, counts)
    return stamps[begin][stretch] + index * step_s, stretch, step_s


def median_step_s(stamps: Floats) -> float:
    """The usual step of the first stamps, s: a log cut short later has the same."""
    return float(np.median(np.diff(stamps[:_MIN_ROWS]))) if len(stamps) > 1 else float("inf")


def sample_column(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float | None]:
    """A column's values at given times, and how old they are on average, s; None: it has these very times."""
    if np.array_equal(column.t_s, t_s):
        return column.values, None
    if median_step_s(column.t_s) < 0.6 * step_s:
        return _means_and_age(column, t_s, step_s)
    return _latest_and_age(column, t_s)


def _latest_and_age(column: Column, t_s: Floats) -> tuple[Floats, float]:
    """The last value up to each time, nan before the first; and its mean age, s."""
    column = _finite_rows(column)
    age_s = _held_age_s(column, t_s)
    age_s = age_s[np.isfinite(age_s)]
    return _latest_values(t_s, column.t_s, column.values), float(age_s.mean()) if age_s.size else float("nan")


def _finite_rows(column: Column) -> Column:
    """The rows of a column that have a number."""
    is_number = np.isfinite(column.values)
    return replace(column, t_s=column.t_s[is_number], values=column.values[is_number])


def _held_age_s(column: Column, t_s: Floats) -> Floats:
    """How old the last row of a column is at each time, s, nan before the first."""
    return t_s - _latest_values(t_s, column.t_s, column.t_s)


def _latest_values(t_s: Floats, stamps: Floats, values: Floats) -> Floats:
    """The value of the last stamp up to each time, nan before the first."""
    last = np.searchsorted(stamps, t_s, side="right") - 1
    return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)


def _means_and_age(column: Column, t: Floats, h: float) -> tuple[Floats, float]:
    """The mean over the interval of h s that ends at each time t, and h / 2: the delay it adds, s."""
    column = _finite_rows(column)
    ts, total = column.t_s, np.concatenate([[0.0], np.cumsum(column.values)])
    eps = 1e-6 * h  # of stamps that are meant to fall on the edge
    end = np.searchsorted(ts, t + eps, side="right")
    begin = np.searchsorted(ts, t - h + eps, side="right")
    count = end - begin
    held, _ = _latest_and_age(column, t)
    mean = (total[end] - total[begin]) / np.maximum(count, 1)
    return np.where(count > 0, mean, held), 0.5 * h


def constant_stretches(values: Floats) -> Runs:
    """Begin and end of each stretch of equal rows; nan is equal to nan."""
    known = np.nan_to_num(values, nan=-1.0)
    return runs_between(np.any(np.diff(known, axis=0) != 0.0, axis=1))


def read_vehicle_columns(path: Path, vehicle: Vehicle, reader: str | None = None) -> RecordedFlight:
    """Read the columns of a log that a vehicle file names. Raises BadInput with the reason where it cannot be
    used."""
    return next(_read_vehicle_log(path, vehicle, reader, in_parts=False))


def read_vehicle_parts(path: Path, vehicle: Vehicle, reader: str | None = None) -> Iterator[RecordedFlight]:
    """The same, a long log in parts."""
    for log in _read_vehicle_log(path, vehicle, reader, in_parts=True):
        column = log.columns.get(vehicle.rates.p.column)
        if column is None:  # said where the columns are used
            yield log
            continue
        ratio = 1.0 / (median_step_s(column.t_s) * vehicle.max_sample_rate_hz)
        yield from split_long_recording(log, column.t_s, max(ratio, 1.0))


def _read_vehicle_log(
    path: Path, vehicle: Vehicle, reader: str | None, in_parts: bool
) -> Iterator[RecordedFlight]:
    time = (vehicle.time.column, vehicle.time.unit) if vehicle.time else None
    return read_parts(path, reader or vehicle.reader, time, vehicle.column_names(), in_parts)


def stream_flights(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> Iterator[Samples]:
    """The flights, one by one, a long one in parts. Raises BadInput before the first with a line for each
    that cannot be used."""
    loaded = load_flights_for_fit(paths, vehicle, reader)
    flights = [flight if flight.n_log_parts == 1 else None for flight in loaded]
    del loaded
    for path, samples in zip(paths, flights, strict=True):
        if samples is not None:
            yield samples
        else:
            yield from (resample(log, vehicle) for log in read_vehicle_parts(path, vehicle, reader))


def _read_flight_for_fit(path: Path, vehicle: Vehicle, reader: str | None) -> Samples:
    """A flight; of a long one stretches that are spread over it evenly."""
    kept: list[Samples] = []
    every, n_seen, until_s = 1, 0, -np.inf
    for part, log in enumerate(read_vehicle_parts(path, vehicle, reader), 1):
        samples = resample(log, vehicle)
        first = int(np.searchsorted(samples.t_s, until_s, side="right"))
        for begin in range(first, len(samples.t_s), _FIT_SAMPLES):
            if n_seen % every == 0:
                kept.append(select_rows(samples, slice(begin, begin + _FIT_SAMPLES)))
            n_seen += 1
        while len(kept) * _FIT_SAMPLES > MAX_FIT_SAMPLES and part > 1:
            kept, every = kept[::2], 2 * every
        until_s = samples.t_s[-1]
    return samples if part == 1 else _concatenate_samples(path.stem, kept, part)


def select_rows(samples: Samples, rows: slice) -> Samples:
    """Some of the samples, copied."""
    return _rebuilt([samples], lambda arrays: arrays[0][rows].copy())


def _rebuilt(parts: list[Samples], join: Callable[[list[Any]], Any]) -> Samples:
    """Samples whose arrays are made of those of others."""
    first = parts[0]
    names = [name for name, value in vars(first).items() if isinstance(value, np.ndarray)]
    fields = {name: join([getattr(part, name) for part in parts]) for name in names}
    fields["log_stamps_s"] = fields["t_s"]
    unchanged = {name: join([part.unchanged_s[name] for part in parts]) for name in first.unchanged_s}
    return replace(first, unchanged_s=unchanged, **fields)


def _concatenate_samples(name: str, stretches: list[Samples], n_parts: int) -> Samples:
    """Samples of stretches one after the other, with a gap between."""
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
    """The flights, each on one time base, of a long one what a fit wants of it. Raises BadInput with a line
    for each that cannot be used."""
    flights: list[Samples] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            flights.append(_read_flight_for_fit(path, vehicle, reader))
        except BadInput as error:
            mistakes.append(str(error))
    for name, n in Counter(samples.name for samples in flights).items():
        if n > 1:
            mistakes.append(f"two flights are named {name}: one result would replace the other")
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return flights
