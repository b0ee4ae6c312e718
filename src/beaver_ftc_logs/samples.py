"""A recording on one time base: rates, surface commands, further signals and labels, sample by sample.

The time base is the stamps of the roll rate. A column with other stamps is held: its value at time t is the
last one received up to t, never a later one, and its mean age is stated. If a log is faster than the
vehicle's `max_rate_hz`, each sample is the average over the past interval. A gap in the stamps ends a
*stretch*. There are no samples in a gap, so a jump of the clock does not add any. `time_base` has these
rules, `usable_columns` refuses columns, `loading` reads the files.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, usable_columns
from beaver_ftc_logs.recording import Column, Floats, Ints, LoggedFailure, Mask, RecordedFlight
from beaver_ftc_logs.signals import column_defect_texts, find_clipped_rows
from beaver_ftc_logs.time_base import (
    is_held_value_stale,
    latest_values,
    sample_column,
    sample_times,
    unchanged_s,
)
from beaver_ftc_logs.usable_columns import MAX_NUMBER
from beaver_ftc_logs.vehicle import Vehicle
from beaver_ftc_logs.vehicle_columns import QuantityColumn

# Limits of the dynamic pressure, over that at the reference airspeed, in `scale_by_airspeed`.
_QDYN_RATIOS = (0.1, 10.0)


@dataclass(frozen=True)
class Samples:
    """One flight on one time base: n samples, S surfaces, X further signals.

    t_s: (n,) s, the log's own stamps, or an even grid within each stretch of a log that is faster than the
        vehicle's largest sample rate
    rates: (n, 3), rad/s
    commands: (n, S), command of each surface as the mixer makes it, in shares of travel, scaled by the
        airspeed if the vehicle has a reference airspeed
    signals: (n, X)
    labels: (n, S), effectiveness, nan where it is unknown
    stretch_number: (n,), number of the gap-free stretch
    dt_s: usual step
    held_age_s: mean age of the values of each column that is held
    log_stamps_s: (m,), stamps of the rates in the log, s
    airspeed: (n,) m/s, nan where it is unknown
    is_rate_clipped: (n,), whether the last value of any rate is clipped
    energy_height_rate_mps: (n,), rate of the energy height over the last seconds, nan where it is unknown
    notes: remarks on the reading
    unchanged_s: for how long each column of rates, commands and signals has been constant, (n,) s
    logged_failures: failures that the log states
    noise_ma_coefficients: moving average of the noise by which rates, commands and signals are whitened,
        empty if they are not
    fit_weight: weight of each sample in a fit
    n_log_parts: parts in which the log was read; if several, the samples are chosen stretches of it
    confirmed_rates: columns of rates that the logged angles confirm
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
    """Put a log on one time base. Raises BadInput with the reason where the log cannot be used.

    held: the values of each column of rates, commands and signals at the samples, and their mean age, s, or
    None for a column that has the stamps of the rates.
    """
    rate_names = vehicle.rate_columns
    used = vehicle.sampled_columns
    log = convert_to_si(log, vehicle)
    usable_columns.refuse_unusable(log, vehicle)
    confirmed_rates = usable_columns.confirm_rates(log, vehicle)
    stamps = log.columns[rate_names[0]].t_s
    t_s, stretch, step_s = sample_times(log.name, stamps, vehicle.max_sample_rate_hz)
    held = {name: sample_column(log.columns[name], t_s, step_s) for name in used}
    values = {name: column for name, (column, _) in held.items()}
    for name in rate_names:  # a rate from before a gap is unknown; a command holds until the next one
        is_stale = is_held_value_stale(log.columns[name], t_s, step_s)
        values[name] = np.where(is_stale, np.nan, values[name])

    def stacked_columns(names: list[str]) -> Floats:
        """Columns side by side, (n, columns)."""
        return np.column_stack([values[name] for name in names]) if names else np.empty((len(t_s), 0))

    def sampled(quantity: QuantityColumn | None) -> Floats:
        """A quantity at the samples, (n,); nan where it is not named or not logged."""
        column = log.columns.get(quantity.column) if quantity else None
        return sample_column(column, t_s, step_s)[0] if column else np.full(len(t_s), np.nan)

    defects = (column_defect_texts(name, log.columns[name], name in rate_names) for name in used)
    altitude_m = sampled(getattr(vehicle.energy, "altitude", None))
    airspeed_mps = sampled(getattr(vehicle.energy, "airspeed", None))
    samples = Samples(
        name=log.name,
        t_s=t_s,
        rates=stacked_columns(rate_names),
        commands=_mixed_commands(log.name, stacked_columns(vehicle.command_columns), vehicle),
        signals=stacked_columns(vehicle.signal_columns),
        labels=_sampled_labels(log, vehicle, t_s),
        stretch_number=stretch,
        dt_s=step_s,
        held_age_s={name: age_s for name, (_, age_s) in held.items() if age_s is not None},
        logged_failures=log.logged_failures,
        log_stamps_s=stamps,
        notes=(*log.notes, *dict.fromkeys(chain.from_iterable(defects))),
        airspeed=sampled(vehicle.airspeed),
        unchanged_s={name: unchanged_s(log.columns[name], t_s) for name in used},
        is_rate_clipped=_is_rate_clipped([log.columns[name] for name in rate_names], t_s),
        energy_height_rate_mps=energy.energy_climb_mps(t_s, altitude_m, airspeed_mps, stretch),
        confirmed_rates=confirmed_rates,
    )
    V0 = vehicle.reference_airspeed_mps
    return samples if V0 is None else scale_by_airspeed(samples, V0, vehicle.surface_airspeed_powers)


def _sampled_labels(log: RecordedFlight, vehicle: Vehicle, t_s: Floats) -> Floats:
    """The last label of each surface up to each time, (n, S), nan where there is none."""
    labels = np.full((len(t_s), len(vehicle.surfaces)), np.nan)
    for i, surface in enumerate(vehicle.surfaces):
        quantity = vehicle.labels.get(surface)
        if quantity and (column := log.columns.get(quantity.column)):
            labels[:, i] = latest_values(t_s, column.t_s, quantity.to_si(column.values))
    return labels


def _is_rate_clipped(rates: Sequence[Column], t_s: Floats) -> Mask:
    """Whether the last value up to each time is clipped in any of the rates, (n,)."""
    clipped = [find_clipped_rows(rate.values).astype(float) for rate in rates]
    held = [latest_values(t_s, rate.t_s, rows) for rate, rows in zip(rates, clipped, strict=True)]
    return np.logical_or.reduce(np.nan_to_num(held))


def scale_by_airspeed(samples: Samples, V0: float, powers: Sequence[float]) -> Samples:
    """The flight scaled with the airspeed V, m/s:

        u <- u (V / V0)^n,    signals <- [signals, (rates, signals) (V / V0 - 1)]

    u: commands; n (S,): power of each surface (powers). The products are further signals, since damping and
    stability grow with the airspeed. V = V0 where the airspeed is unknown. (V / V0)^2 is limited to
    _QDYN_RATIOS.
    """
    ratio = np.clip(np.nan_to_num(samples.airspeed / V0, nan=1.0) ** 2, *_QDYN_RATIOS)[:, None]
    products = np.column_stack([samples.rates, samples.signals]) * (np.sqrt(ratio) - 1.0)
    joined = np.column_stack([samples.signals, products])
    return replace(samples, commands=samples.commands * ratio ** (0.5 * np.array(powers)), signals=joined)


def convert_to_si(log: RecordedFlight, vehicle: Vehicle) -> RecordedFlight:
    """A log in which the columns that the vehicle file names are in SI. If two keys name a column, the first
    in the file decides: reversed, so that it is the last to enter the table."""
    columns = dict(log.columns)
    quantities = {quantity.column: quantity for *_, quantity in reversed(vehicle.located_quantities())}
    for name, quantity in quantities.items():
        if name in columns:
            columns[name] = replace(columns[name], values=quantity.to_si(columns[name].values))
    return replace(log, columns=columns)


def mixer_matrix(vehicle: Vehicle) -> Floats:
    """The share of each command in each surface, (S, C)."""
    mixer_rows = [
        [shares.get(name, 0.0) for name in vehicle.command_columns] for shares in vehicle.surfaces.values()
    ]
    return np.array(mixer_rows, dtype=float)


def _mixed_commands(flight: str, logged_commands: Floats, vehicle: Vehicle) -> Floats:
    """The command of each surface (n, S): the weighted sum of the logged commands (n, C). Raises BadInput if
    the weights make one larger than MAX_NUMBER."""
    with np.errstate(over="ignore", invalid="ignore"):
        commands: Floats = np.einsum("nc,sc->ns", logged_commands, mixer_matrix(vehicle))
    too_large = (np.isinf(commands) | (np.abs(commands) > MAX_NUMBER)).any(axis=0)
    if too_large.any():
        surface = list(vehicle.surfaces)[int(too_large.argmax())]
        allowed = f"allowed: weights in `surfaces` that give up to {MAX_NUMBER:g}"
        raise BadInput(f"{flight}: the command of {surface} is too large, {allowed}")
    return commands
