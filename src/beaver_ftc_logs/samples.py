"""A recording on one time base: rates, surface commands, further signals and labels, sample by sample.

The time base is the stamps of the roll rate. A column with other stamps is held: its value at time t is the
last one received up to t, never a later one, and its mean age is stated. If a log is faster than the
vehicle's `max_rate_hz`, each sample is the average over the past interval. A gap in the stamps ends a
*stretch*. There are no samples in a gap, so a jump of the clock does not add any. `time_base` has these
rules, `loading` reads the files.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, physics, signals
from beaver_ftc_logs.physics import NamedColumn
from beaver_ftc_logs.recording import (
    Column,
    Columns,
    Floats,
    Ints,
    LoggedFailure,
    Mask,
    RecordedFlight,
    largest_magnitude,
)
from beaver_ftc_logs.runs import runs_between
from beaver_ftc_logs.time_base import (
    is_held_value_stale,
    latest_values,
    sample_column,
    sample_times,
    unchanged_s,
)
from beaver_ftc_logs.vehicle import QuantityColumn, Vehicle

_MAX_NUMBER = 1e6  # a larger number in a log is damaged
# A larger rate is in another unit: usual gyros measure up to 35 rad/s. A spike may be larger than any rate of
# a vehicle (`physics.FAST_RAD_S`), and is no reason to refuse a log.
_MAX_RATE_RAD_S = 60.0
_MAX_RATE_SD_RAD_S = 3.0  # a larger standard deviation of a rate causes a remark
# Limits of the dynamic pressure, over that at the reference airspeed, in `scale_by_airspeed`.
_QDYN_RATIOS = (0.1, 10.0)
# Moving averages of the noise. A gust that is held within a sample adds to the next one (positive
# coefficients), the noise of a gyro subtracts from it (negative ones).
NOISE_MA_CANDIDATES = (
    (1.0,), (1.0, 0.5),
    *((1.0, -2.0 * c, c**2) for c in (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9)),
)  # fmt: skip
# Noise that is tried even if no fitted flight had it: the moving averages of gusts, and the noise of gyros
# from that of a laboratory to that of a toy, in steps of a factor of 3.2, so that none is more than 1.8 times
# off.
UNFITTED_MA = NOISE_MA_CANDIDATES[:2]
UNFITTED_GYROS_RAD_S = tuple(np.geomspace(1e-5, 1e-2, 7).tolist())


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

    used: the columns of rates, commands and signals. held: the values of each at the samples, and their mean
    age, s, or None for a column that has the stamps of the rates.
    """
    rate_names = vehicle.rate_columns
    used = list(dict.fromkeys([*rate_names, *vehicle.command_columns, *vehicle.signal_columns]))
    log = convert_to_si(log, vehicle)
    _refuse_columns(log, used, rate_names)
    confirmed = _check_attitude(log, vehicle)
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

    energy_columns = vehicle.energy
    altitude_m = sampled(energy_columns.altitude if energy_columns else None)
    airspeed_mps = sampled(energy_columns.airspeed if energy_columns else None)
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
        notes=(*log.notes, *dict.fromkeys(_defects(log, used, rate_names))),
        airspeed=sampled(vehicle.airspeed),
        unchanged_s={name: unchanged_s(log.columns[name], t_s) for name in used},
        is_rate_clipped=_is_rate_clipped([log.columns[name] for name in rate_names], t_s),
        energy_height_rate_mps=energy.energy_climb_mps(t_s, altitude_m, airspeed_mps, stretch),
        confirmed_rates=confirmed,
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
    clipped = [signals.find_clipped_rows(rate.values).astype(float) for rate in rates]
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


def whiten_samples(samples: Samples, C: Sequence[float], fit_weight: float = 1.0) -> Samples:
    """The flight with rates, commands and signals x filtered by C(1) / C(z), so that an autoregressive model
    leaves a white residual [Ljung1999, section 4.2]. C: moving average of the noise (1, c1, ...).

    The filter restarts from rest at the first row x0 of each run [begin, end) of known rows without a gap. A
    row with an unknown number becomes unknown as a whole.
    """
    from scipy.signal import lfilter

    x = np.hstack([samples.rates, samples.commands, samples.signals])
    known = np.isfinite(x).all(axis=1)
    x[~known] = np.nan
    for begin, end in runs_between((np.diff(known) != 0) | (np.diff(samples.stretch_number) != 0)):
        x0 = x[begin]
        x[begin:end] = x0 + lfilter([sum(C)], C, x[begin:end] - x0, axis=0)
    rates, commands, white_signals = np.split(x, [3, 3 + samples.commands.shape[1]], axis=1)
    return replace(
        samples,
        rates=rates,
        commands=commands,
        signals=white_signals,
        noise_ma_coefficients=tuple(C),
        fit_weight=fit_weight,
    )


def _defects(log: RecordedFlight, used: list[str], rate_names: list[str]) -> Iterator[str]:
    """Yield a line for each defect of the columns that are used."""
    for name in used:
        yield from signals.column_defect_texts(name, log.columns[name], is_rate=name in rate_names)
        if name in rate_names and (sd := float(np.nanstd(log.columns[name].values))) > _MAX_RATE_SD_RAD_S:
            hint = "is it in deg/s? a factor of 0.01745 fits (`unit: deg/s`)"
            yield f"{name}: spreads {sd:.3g} rad/s, as hardly an aircraft does: {hint}"


def _check_attitude(log: RecordedFlight, vehicle: Vehicle) -> frozenset[str]:
    """The columns of rates that the angles confirm; none if a rate is clipped, as angles are then not
    compared: the integral of a clipped rate is not the change of its angle. Raises BadInput where rates,
    angles and gravity contradict one another, with the column that seems to be in another unit."""
    columns = log.columns
    rates = {name: columns[name] for name in vehicle.rate_columns}
    is_clipped = any(signals.find_clipped_rows(rate.values).any() for rate in rates.values())
    angles = [None] * 3 if is_clipped else named_angles(columns, vehicle)
    mistake = physics.attitude_mistake(rates, angles, _possible_rates(log, vehicle))
    acceleration = vehicle.acceleration
    if not mistake and acceleration and (az := columns.get(acceleration.column)):
        mistake = physics.gravity_remark(az, acceleration.column)
    if mistake:
        raise BadInput(f"{log.name}: {mistake}, allowed: what the vehicle file says, or its `unit` mended")
    return physics.confirmed_rates(rates, angles)


def _possible_rates(log: RecordedFlight, vehicle: Vehicle) -> Columns:
    """The other columns of a log that may have been exchanged with a rate: signals, flow and commands."""
    flow = [quantity.column for quantity in vehicle.flow.values()]
    names = dict.fromkeys([*vehicle.signal_columns, *flow, *vehicle.command_columns])
    return {name: log.columns[name] for name in names if name in log.columns}


def named_angles(columns: Columns, vehicle: Vehicle) -> list[NamedColumn | None]:
    """The columns of roll, pitch and yaw with their names; None for an angle that is not named or not
    logged."""
    keys = [getattr(vehicle.attitude, angle, None) for angle in ("roll", "pitch", "yaw")]
    return [(key.column, columns[key.column]) if key and key.column in columns else None for key in keys]


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
    the weights make one larger than _MAX_NUMBER."""
    with np.errstate(over="ignore", invalid="ignore"):
        commands: Floats = np.einsum("nc,sc->ns", logged_commands, mixer_matrix(vehicle))
    too_large = (np.isinf(commands) | (np.abs(commands) > _MAX_NUMBER)).any(axis=0)
    if too_large.any():
        surface = list(vehicle.surfaces)[int(too_large.argmax())]
        allowed = f"allowed: weights in `surfaces` that give up to {_MAX_NUMBER:g}"
        raise BadInput(f"{flight}: the command of {surface} is too large, {allowed}")
    return commands


def _refuse_columns(log: RecordedFlight, used: list[str], rate_names: list[str]) -> None:
    """Raise BadInput where a column is missing, or has no number or a damaged one, or where a rate is so
    large that it is in another unit."""
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
