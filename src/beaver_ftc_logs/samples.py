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
from beaver_ftc_logs.readers import read_flight, read_parts, split_long_recording
from beaver_ftc_logs.recording import Column, Floats, LoggedFailure, RecordedFlight
from beaver_ftc_logs.units import SECONDS_PER_TIME_UNIT
from beaver_ftc_logs.vehicle import Vehicle

MIN_LOG_RATE_HZ, _MAX_LOG_RATE_HZ = 4.0, 1e5
_MIN_LOG_SAMPLES = 50
_MAX_LOGGED_MAGNITUDE, _MAX_BODY_RATE_RAD_S, _MAX_PLAUSIBLE_RATE_SD_RAD_S = 1e6, 60.0, 3.0
_DYNAMIC_PRESSURE_RATIO_LIMITS = (0.1, 10.0)
"""Least and largest dynamic pressure over that at the reference, whatever the airspeed says."""
MAX_FIT_SAMPLES, _FIT_STRETCH_SAMPLES = 200_000, 5000
"""Samples of a log read in parts that a fit takes at most, and how many of them in turn."""
NOISE_MA_CANDIDATES = (
    (1.0,), (1.0, 0.5),
    *((1.0, -2.0 * c, c**2) for c in (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9)),
)  # fmt: skip
"""Moving averages of the noise: gusts held within a sample add to the next, gyros' noise takes from it."""
UNFITTED_NOISE_MA_CANDIDATES = NOISE_MA_CANDIDATES[:2]
UNFITTED_GYRO_NOISE_CANDIDATES_RAD_S = tuple(np.geomspace(1e-5, 1e-2, 7).tolist())
"""Noise that is tried where no fitted flight had it: gusts of both kinds, and gyros from a
laboratory's to a toy's, so close together that none is 1.8 times off."""
_MIN_GAP_STEPS = 3.5
"""A step of more than this many usual steps is a gap: nothing is predicted across it."""


@dataclass(frozen=True)
class Samples:
    """One flight, ready for identification and filtering.

    t_s (n,) s: the log's own stamps, or an even grid within each stretch if the log is faster than the
    vehicle's largest sample rate. rates (n, 3) rad/s. commands (n, S): command of each surface as the mixer
    makes it, in shares of travel. signals (n, X). labels (n, S): effectiveness, nan where unknown.
    stretch_number (n,): number of the gap-free stretch. mean_age_s_by_held_column: mean age of the values of
    each column that is held. log_stamps_s (m,): the log's own time stamps, s. notes: remarks on the reading.
    airspeed (n,) m/s, nan where unknown. time_since_change_s_by_column: for how long each column of rates,
    commands and signals has been constant, (n,) s. is_rate_clipped (n,). energy_height_rate_mps (n,): rate of
    the energy height over the last seconds, None if it is not logged. noise_ma_coefficients: the moving
    average of the noise by which rates, commands and signals are whitened, empty if they are not. fit_weight
    of each sample in a fit. n_log_parts: number of parts in which the log was read; if several, the samples
    are chosen stretches. rates_confirmed_by_attitude: the columns of rates that the logged angles confirm.
    """

    name: str
    t_s: Floats
    rates: Floats
    commands: Floats
    signals: Floats
    labels: Floats
    stretch_number: NDArray[np.int64]
    dt_s: float
    mean_age_s_by_held_column: dict[str, float]
    logged_failures: tuple[LoggedFailure, ...]
    log_stamps_s: Floats
    notes: tuple[str, ...] = ()
    airspeed: Floats | None = None
    time_since_change_s_by_column: Mapping[str, Floats] = field(default_factory=dict)
    is_rate_clipped: NDArray[np.bool_] | None = None
    energy_height_rate_mps: Floats | None = None
    noise_ma_coefficients: tuple[float, ...] = ()
    fit_weight: float = 1.0
    n_log_parts: int = 1
    rates_confirmed_by_attitude: frozenset[str] = frozenset()


_PER_SAMPLE_FIELDS = (
    "t_s", "rates", "commands", "signals", "labels", "stretch_number", "airspeed", "is_rate_clipped",
    "energy_height_rate_mps",
)  # fmt: skip


def resample(recording: RecordedFlight, vehicle: Vehicle) -> Samples:
    """Put a recording on one time base. Raises BadInput with the reason where the log cannot be used."""
    rate_column_names = [getattr(vehicle.rates, axis).column for axis in "pqr"]
    used_column_names = list(
        dict.fromkeys([*rate_column_names, *vehicle.command_column_names, *vehicle.signal_column_names])
    )
    recording = convert_to_si(recording, vehicle)
    _refuse_missing_or_implausible_columns(recording, used_column_names, rate_column_names=rate_column_names)
    confirmed_rates = _check_gravity_and_confirm_rates_by_attitude(recording, vehicle)
    log_stamps_s = recording.columns[rate_column_names[0]].t_s
    t_s, stretch_number, step_s = _check_stamps_and_make_time_base(
        recording.name, log_stamps_s, vehicle.max_sample_rate_hz
    )
    values_and_mean_age_by_column = {
        name: values_and_mean_age_at(recording.columns[name], t_s, step_s) for name in used_column_names
    }
    for name in rate_column_names:
        values, mean_age_s = values_and_mean_age_by_column[name]
        values_and_mean_age_by_column[name] = (
            np.where(_is_held_value_stale(recording.columns[name], t_s, step_s), np.nan, values),
            mean_age_s,
        )

    def stacked_columns(names: list[str]) -> Floats:
        return (
            np.column_stack([values_and_mean_age_by_column[name][0] for name in names])
            if names
            else np.empty((len(t_s), 0))
        )

    samples = Samples(
        name=recording.name,
        t_s=t_s,
        rates=stacked_columns(rate_column_names),
        commands=_mixed_commands(recording.name, stacked_columns(vehicle.command_column_names), vehicle),
        signals=stacked_columns(vehicle.signal_column_names),
        labels=_labelled_surface_effectiveness(recording, vehicle, t_s),
        stretch_number=stretch_number,
        dt_s=step_s,
        mean_age_s_by_held_column={
            name: mean_age_s
            for name, (_, mean_age_s) in values_and_mean_age_by_column.items()
            if mean_age_s is not None
        },
        logged_failures=recording.logged_failures,
        log_stamps_s=log_stamps_s,
        notes=(
            *recording.notes,
            *dict.fromkeys(_used_column_defect_texts(recording, used_column_names, rate_column_names)),
        ),
        airspeed=_sampled_airspeed(recording, vehicle, t_s, step_s),
        time_since_change_s_by_column={
            name: _time_since_column_change_s(recording.columns[name], t_s) for name in used_column_names
        },
        is_rate_clipped=_is_rate_clipped([recording.columns[name] for name in rate_column_names], t_s),
        energy_height_rate_mps=_sampled_energy_height_rate_mps(
            recording, vehicle, (t_s, stretch_number, step_s)
        ),
        rates_confirmed_by_attitude=confirmed_rates,
    )
    reference_airspeed_mps = vehicle.reference_airspeed_mps
    return (
        samples
        if reference_airspeed_mps is None
        else with_airspeed_scaling_and_products(
            samples, reference_airspeed_mps, vehicle.surface_airspeed_powers
        )
    )


def with_airspeed_scaling_and_products(
    samples: Samples, reference_airspeed_mps: float, airspeed_powers: Sequence[float] = (2.0,)
) -> Samples:
    """The flight with what the airspeed V does of its own: commands times V / reference to the power of each
    surface, (S,) or one, and, as further signals, rates and signals times V / reference - 1, since damping
    and stability grow with it; as at the reference where the airspeed is unknown."""
    airspeed = np.full(len(samples.t_s), np.nan) if samples.airspeed is None else samples.airspeed
    dynamic_pressure_ratio = np.clip(
        np.nan_to_num(airspeed / reference_airspeed_mps, nan=1.0) ** 2, *_DYNAMIC_PRESSURE_RATIO_LIMITS
    )[:, None]
    products_with_relative_airspeed_deviation = np.column_stack([samples.rates, samples.signals]) * (
        np.sqrt(dynamic_pressure_ratio) - 1.0
    )
    signals_and_products = np.column_stack([samples.signals, products_with_relative_airspeed_deviation])
    return replace(
        samples,
        commands=samples.commands * dynamic_pressure_ratio ** (0.5 * np.array(airspeed_powers)),
        signals=signals_and_products,
    )


def whiten_samples(
    samples: Samples, noise_ma_coefficients: Sequence[float], fit_weight: float = 1.0
) -> Samples:
    """The flight with rates, commands and signals filtered by C(1) / C(z), C the moving average of the noise
    (1, c1, ...): what is left of an autoregressive model is then white [Ljung1999, section 4.2]. Begins again
    after a gap, and where a number is missing."""
    from scipy.signal import lfilter

    arrays = (samples.rates, samples.commands, samples.signals)
    joined_values = np.hstack(arrays)
    is_known = np.isfinite(joined_values).all(axis=1)
    run_edges = np.flatnonzero((np.diff(is_known) != 0) | (np.diff(samples.stretch_number) != 0)) + 1
    joined_values[~is_known] = np.nan
    for run_begin, run_end in pairwise([0, *run_edges.tolist(), len(joined_values)]):
        first_values = joined_values[run_begin]
        joined_values[run_begin:run_end] = first_values + lfilter(
            [sum(noise_ma_coefficients)],
            noise_ma_coefficients,
            joined_values[run_begin:run_end] - first_values,
            axis=0,
        )
    whitened_rates, whitened_surface_commands, whitened_signals = np.split(
        joined_values, np.cumsum([array.shape[1] for array in arrays])[:2], axis=1
    )
    return replace(
        samples,
        rates=whitened_rates,
        commands=whitened_surface_commands,
        signals=whitened_signals,
        noise_ma_coefficients=tuple(noise_ma_coefficients),
        fit_weight=fit_weight,
    )


def _used_column_defect_texts(
    recording: RecordedFlight, used_column_names: list[str], rate_column_names: list[str]
) -> Iterator[str]:
    """Yield a line for each mistake in the columns that are used."""
    for name in used_column_names:
        yield from signals.column_defect_texts(
            name, recording.columns[name], is_measured_rate=name in rate_column_names
        )
        if (
            name in rate_column_names
            and (rate_sd := float(np.nanstd(recording.columns[name].values))) > _MAX_PLAUSIBLE_RATE_SD_RAD_S
        ):
            yield (
                f"{name}: spreads {rate_sd:.3g} rad/s, as hardly an aircraft does: is it "
                "in deg/s? a factor "
                "of 0.01745 fits (`unit: deg/s`)"
            )


def _time_since_column_change_s(column: Column, t_s: Floats) -> Floats:
    """For how long a column has been the same at each sample, s, its age included: rows without a number
    stand still."""
    column = _column_of_finite_rows(column)
    return np.nan_to_num(
        _latest_values(t_s, column.t_s, signals.time_since_change_s(column)) + _held_age_s(column, t_s)
    )


def _is_held_value_stale(column: Column, t_s: Floats, step_s: float) -> NDArray[np.bool_]:
    """Whether at each sample a gap has opened since the last number of a column."""
    column = _column_of_finite_rows(column)
    usual_step_s = max(_median_step_of_first_stamps_s(column.t_s), step_s) if len(column.t_s) > 1 else step_s
    return np.asarray(_held_age_s(column, t_s) > _MIN_GAP_STEPS * usual_step_s)


def _is_rate_clipped(rate_columns: list[Column], t_s: Floats) -> NDArray[np.bool_]:
    """Whether a rate is clipped at each sample."""
    is_clipped_by_axis = [
        _latest_values(t_s, rate_column.t_s, signals.find_clipped_rows(rate_column.values).astype(float))
        for rate_column in rate_columns
    ]
    return np.asarray(np.nan_to_num(is_clipped_by_axis).any(axis=0))


def _sampled_airspeed(
    recording: RecordedFlight, vehicle: Vehicle, t_s: Floats, step_s: float
) -> Floats | None:
    """The airspeed at each sample, nan where it is unknown; None where the vehicle has none."""
    column = recording.columns.get(vehicle.airspeed.column) if vehicle.airspeed else None
    return None if column is None else values_and_mean_age_at(column, t_s, step_s)[0]


def _sampled_energy_height_rate_mps(
    recording: RecordedFlight,
    vehicle: Vehicle,
    times_stretches_and_step: tuple[Floats, NDArray[np.int64], float],
) -> Floats | None:
    """As in Samples; times_stretches_and_step: of the samples."""
    energy_quantities = [vehicle.energy.altitude, vehicle.energy.airspeed] if vehicle.energy else []
    logged_energy_columns = [
        recording.columns[quantity.column]
        for quantity in energy_quantities
        if quantity.column in recording.columns
    ]
    if len(logged_energy_columns) < 2 or not all(len(column.t_s) > 1 for column in logged_energy_columns):
        return None
    t_s, stretch_number, step_s = times_stretches_and_step
    altitude, airspeed = (values_and_mean_age_at(column, t_s, step_s)[0] for column in logged_energy_columns)
    return energy.compute_energy_height_rate_mps(t_s, altitude, airspeed, stretch_number)


def _check_gravity_and_confirm_rates_by_attitude(
    recording: RecordedFlight, vehicle: Vehicle
) -> frozenset[str]:
    """The columns of rates that the angles confirm. Raises BadInput where rates, angles and gravity
    contradict one another: what is in another unit."""
    columns, attitude_settings, mistake = recording.columns, vehicle.attitude, None
    confirmed_rates = frozenset[str]()
    rate_column_by_name = {(name := getattr(vehicle.rates, axis).column): columns[name] for axis in "pqr"}
    if (
        attitude_settings
        and not signals.find_clipped_rows(next(iter(rate_column_by_name.values())).values).any()
    ):
        angle_quantities = [attitude_settings.roll, attitude_settings.pitch, attitude_settings.yaw]
        named_angle_columns_or_none = [
            (quantity.column, columns[quantity.column]) if quantity and quantity.column in columns else None
            for quantity in angle_quantities
        ]
        possible_rate_column_names = [
            *vehicle.signal_column_names,
            *(quantity.column for quantity in vehicle.flow.values()),
            *vehicle.command_column_names,
        ]
        possible_rate_columns = {
            name: columns[name] for name in dict.fromkeys(possible_rate_column_names) if name in columns
        }
        mistake = physics.find_attitude_mistake(
            rate_column_by_name, named_angle_columns_or_none, possible_rate_columns
        )
        confirmed_rates = physics.rates_confirmed_by_attitude(
            rate_column_by_name, named_angle_columns_or_none
        )
    z_acceleration_column = vehicle.acceleration and recording.columns.get(vehicle.acceleration.column)
    if not mistake and vehicle.acceleration and z_acceleration_column:
        mistake = physics.gravity_remark(z_acceleration_column, vehicle.acceleration.column)
    if mistake:
        raise BadInput(
            f"{recording.name}: {mistake}, allowed: what the vehicle file says, or its `unit` mended"
        )
    return confirmed_rates


def convert_to_si(recording: RecordedFlight, vehicle: Vehicle) -> RecordedFlight:
    """A recording with the columns that a vehicle names in SI."""
    quantity_of_column = {quantity.column: quantity for _, quantity in vehicle.located_model_quantities()}
    quantity_of_column |= {quantity.column: quantity for quantity in vehicle.flow.values()}
    quantity_of_column |= {quantity.column: quantity for _, _, quantity in vehicle.quantities_of_known_kind()}
    converted_columns = {
        name: replace(column, values=quantity_of_column[name].to_si(column.values))
        for name, column in recording.columns.items()
        if name in quantity_of_column
    }
    return replace(recording, columns={**recording.columns, **converted_columns})


def mixer_matrix(vehicle: Vehicle) -> Floats:
    """Return the share of each command in each surface, (surfaces, commands)."""
    mixer_rows = [
        [shares_by_command.get(name, 0.0) for name in vehicle.command_column_names]
        for shares_by_command in vehicle.surfaces.values()
    ]
    return np.array(mixer_rows, dtype=float)


def _mixed_commands(flight_name: str, logged_commands: Floats, vehicle: Vehicle) -> Floats:
    """Return the deflection that the commands (n, C) ask of each surface, (n, S). Raises BadInput where a
    weight makes one larger than a logged number may be."""
    with np.errstate(over="ignore", invalid="ignore"):
        commands: Floats = np.einsum("nc,sc->ns", logged_commands, mixer_matrix(vehicle))
    is_too_large = (np.isinf(commands) | (np.abs(commands) > _MAX_LOGGED_MAGNITUDE)).any(axis=0)
    if is_too_large.any():
        surface = list(vehicle.surfaces)[int(is_too_large.argmax())]
        allowed_text = f"allowed: weights in `surfaces` that give up to {_MAX_LOGGED_MAGNITUDE:g}"
        raise BadInput(f"{flight_name}: the command of {surface} is too large, {allowed_text}")
    return commands


def _refuse_missing_or_implausible_columns(
    recording: RecordedFlight, used_column_names: list[str], rate_column_names: list[str]
) -> None:
    """Raise BadInput where a column is missing, or holds nothing; rates that no vehicle turns at are in
    another unit."""
    missing_names = [name for name in used_column_names if name not in recording.columns]
    if missing_names:
        nearest_text = recording.nearest_column_names_text(missing_names[0])
        reason = f"no column {missing_names[0]}, allowed: a log that has it; it has {nearest_text}"
        raise BadInput(f"{recording.name}: {reason}")
    max_abs_of_column = {}
    for name in used_column_names:
        values = recording.columns[name].values
        if not np.isfinite(values).any():
            raise BadInput(f"{recording.name}: column {name} holds no number, allowed: a logged quantity")
        max_abs_of_column[name] = float(np.nanmax(np.abs(values)))
        if max_abs_of_column[name] > _MAX_LOGGED_MAGNITUDE:
            mistake = (
                f"column {name} holds {max_abs_of_column[name]:g}, allowed: up to {_MAX_LOGGED_MAGNITUDE:g}"
            )
            raise BadInput(f"{recording.name}: {mistake}")
    for name in rate_column_names:
        if max_abs_of_column[name] > _MAX_BODY_RATE_RAD_S:
            max_rate_rad_s_if_deg_s = np.deg2rad(max_abs_of_column[name])
            deg_hint = (
                f" (deg/s would be {max_rate_rad_s_if_deg_s:.3g} rad/s: `unit: deg/s`)"
                if max_rate_rad_s_if_deg_s < _MAX_BODY_RATE_RAD_S
                else ""
            )
            raise BadInput(
                f"{recording.name}: column {name} reaches {max_abs_of_column[name]:g}, allowed: rates in "
                f"rad/s, up to {_MAX_BODY_RATE_RAD_S:g}{deg_hint}"
            )


def _check_stamps_and_make_time_base(
    flight_name: str, stamps: Floats, max_rate_hz: float
) -> tuple[Floats, NDArray[np.int64], float]:
    """Times of the samples and the number of the gap-free stretch of each, (n,), and the usual step, s."""
    if len(stamps) < _MIN_LOG_SAMPLES:
        raise BadInput(
            f"{flight_name}: has {len(stamps)} samples of the rates, allowed: at least {_MIN_LOG_SAMPLES}"
        )
    step_s = _median_step_of_first_stamps_s(stamps)
    rate_hz = 1.0 / step_s
    if rate_hz < MIN_LOG_RATE_HZ:
        raise BadInput(
            f"{flight_name}: rates are logged at {rate_hz:.2g} Hz, allowed: at least "
            f"{MIN_LOG_RATE_HZ:g} Hz to tell "
            f"a surface's effect from the vehicle's own motion{_other_time_unit_hint(rate_hz)}"
        )
    if rate_hz > _MAX_LOG_RATE_HZ:
        raise BadInput(
            f"{flight_name}: rates are logged at {rate_hz:.2g} Hz, allowed: up to {_MAX_LOG_RATE_HZ:g} Hz, "
            "time in seconds"
        )
    if rate_hz <= 1.05 * max_rate_hz:
        return stamps, np.cumsum(np.diff(stamps, prepend=stamps[0]) > _MIN_GAP_STEPS * step_s), step_s
    regular_times_stretches_and_step = _regular_time_base(stamps, 1.0 / max_rate_hz)
    if len(regular_times_stretches_and_step[0]) < _MIN_LOG_SAMPLES:
        raise BadInput(
            f"{flight_name}: {len(stamps)} rows within {stamps[-1] - stamps[0]:.3g} s are "
            f"{len(regular_times_stretches_and_step[0])} samples at "
            f"{max_rate_hz:g} Hz, allowed: at least {_MIN_LOG_SAMPLES}; is time in another unit?"
        )
    return regular_times_stretches_and_step


def _other_time_unit_hint(rate_hz: float) -> str:
    """The units of time in which a log too slow would be one of 10 to 1000 Hz."""
    plausible_units = [
        unit
        for unit, seconds_per_unit in SECONDS_PER_TIME_UNIT.items()
        if unit != "s" and 10.0 <= rate_hz / seconds_per_unit <= 1000.0
    ]
    return (
        f" (time in {plausible_units[0]} would be "
        f"{rate_hz / SECONDS_PER_TIME_UNIT[plausible_units[0]]:.3g} Hz)"
        if plausible_units
        else ""
    )


def _regular_time_base(stamps: Floats, step_s: float) -> tuple[Floats, NDArray[np.int64], float]:
    """Samples a step apart over each stretch of the log, from its first stamp on: as
    `_check_stamps_and_make_time_base`."""
    stretch_begin_rows = np.flatnonzero(np.diff(stamps, prepend=-np.inf) > _MIN_GAP_STEPS * step_s)
    stretch_last_rows = np.append(stretch_begin_rows[1:], len(stamps)) - 1
    n_samples_of_stretch = np.ceil(
        (stamps[stretch_last_rows] - stamps[stretch_begin_rows]) / step_s + 0.5
    ).astype(np.int64)
    stretch_number = np.repeat(np.arange(len(stretch_begin_rows)), n_samples_of_stretch)
    index_in_stretch = np.arange(len(stretch_number)) - np.repeat(
        np.cumsum(n_samples_of_stretch) - n_samples_of_stretch, n_samples_of_stretch
    )
    return stamps[stretch_begin_rows][stretch_number] + index_in_stretch * step_s, stretch_number, step_s


def _median_step_of_first_stamps_s(stamps: Floats) -> float:
    """The usual step of the first stamps, s: a log cut short later has the same."""
    return float(np.median(np.diff(stamps[:_MIN_LOG_SAMPLES]))) if len(stamps) > 1 else float("inf")


def values_and_mean_age_at(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float | None]:
    """A column's values at given times, and how old they are on average, s; None: it has these very times."""
    if len(column.t_s) == len(t_s) and np.array_equal(column.t_s, t_s):
        return column.values, None
    return (
        _interval_means_and_mean_age(column, t_s, step_s)
        if _median_step_of_first_stamps_s(column.t_s) < 0.6 * step_s
        else _latest_values_and_mean_age(column, t_s)
    )


def _latest_values_and_mean_age(column: Column, t_s: Floats) -> tuple[Floats, float]:
    """The last value up to each time, nan before the first; and its mean age, s."""
    column = _column_of_finite_rows(column)
    age_s = _held_age_s(column, t_s)
    age_s = age_s[np.isfinite(age_s)]
    return _latest_values(t_s, column.t_s, column.values), float(age_s.mean()) if age_s.size else float("nan")


def _column_of_finite_rows(column: Column) -> Column:
    """The rows of a column that have a number."""
    is_number = np.isfinite(column.values)
    return replace(column, t_s=column.t_s[is_number], values=column.values[is_number])


def _held_age_s(column: Column, t_s: Floats) -> Floats:
    """How old the last row of a column is at each time, s, nan before the first."""
    return t_s - _latest_values(t_s, column.t_s, column.t_s)


def _latest_values(t_s: Floats, stamps: Floats, values: Floats) -> Floats:
    """The value of the last stamp up to each time, nan before the first."""
    last_rows = np.searchsorted(stamps, t_s, side="right") - 1
    return np.where(last_rows >= 0, values[np.maximum(last_rows, 0)], np.nan)


def _interval_means_and_mean_age(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float]:
    """The mean over the interval that ends at each time, and half that interval: the delay it adds, s."""
    column = _column_of_finite_rows(column)
    stamps, cumulated_values = column.t_s, np.concatenate([[0.0], np.cumsum(column.values)])
    stamp_tolerance_s = 1e-6 * step_s  # of stamps that are meant to fall on the edge
    interval_end_rows = np.searchsorted(stamps, t_s + stamp_tolerance_s, side="right")
    interval_begin_rows = np.searchsorted(stamps, t_s - step_s + stamp_tolerance_s, side="right")
    n_rows_in_interval = interval_end_rows - interval_begin_rows
    held_values, _ = _latest_values_and_mean_age(column, t_s)
    interval_mean_or_zero = (
        cumulated_values[interval_end_rows] - cumulated_values[interval_begin_rows]
    ) / np.maximum(n_rows_in_interval, 1)
    return np.where(n_rows_in_interval > 0, interval_mean_or_zero, held_values), 0.5 * step_s


def _labelled_surface_effectiveness(recording: RecordedFlight, vehicle: Vehicle, t_s: Floats) -> Floats:
    """Labels (n, S) as the log gives them, nan for a surface without one and where the log says nothing."""
    labels = np.full((len(t_s), len(vehicle.surfaces)), np.nan)
    for i, surface in enumerate(vehicle.surfaces):
        label_quantity = vehicle.labels.get(surface)
        column = recording.columns.get(label_quantity.column) if label_quantity else None
        if label_quantity is not None and column is not None:
            labels[:, i] = _latest_values(t_s, column.t_s, label_quantity.to_si(column.values))
    return labels


def constant_stretches(values: Floats) -> list[tuple[int, int]]:
    """Begin and end of each stretch of equal rows; nan is equal to nan."""
    values_without_nan = np.nan_to_num(values, nan=-1.0)
    change_rows = np.flatnonzero(np.any(np.diff(values_without_nan, axis=0) != 0.0, axis=1)) + 1
    return list(pairwise([0, *change_rows.tolist(), len(values)]))


def read_columns_of_vehicle(path: Path, vehicle: Vehicle, reader_name: str | None = None) -> RecordedFlight:
    """Read the columns of a log that a vehicle file names. Raises BadInput with the reason where it cannot be
    used."""
    return read_flight(path, *_positional_reader_arguments(vehicle, reader_name))


def read_parts_for_vehicle(
    path: Path, vehicle: Vehicle, reader_name: str | None = None
) -> Iterator[RecordedFlight]:
    """The same, a long log in parts."""
    for recording in read_parts(path, *_positional_reader_arguments(vehicle, reader_name)):
        column = recording.columns.get(vehicle.rates.p.column)
        if column is None:  # said where the columns are used
            yield recording
            continue
        rows_per_sample = 1.0 / (_median_step_of_first_stamps_s(column.t_s) * vehicle.max_sample_rate_hz)
        yield from split_long_recording(recording, column.t_s, max(rows_per_sample, 1.0))


def _positional_reader_arguments(
    vehicle: Vehicle, reader_name: str | None
) -> tuple[str | None, tuple[str, str] | None, list[str]]:
    time_column_and_unit = (vehicle.time.column, vehicle.time.unit) if vehicle.time else None
    return reader_name or vehicle.reader, time_column_and_unit, vehicle.column_names()


def stream_flights(
    paths: Sequence[Path], vehicle: Vehicle, reader_name: str | None = None
) -> Iterator[Samples]:
    """The flights, one by one, a long one in parts. Raises BadInput before the first with a line for each
    that cannot be used."""
    flights_none_where_long = [
        flight if flight.n_log_parts == 1 else None
        for flight in load_flights_for_fit(paths, vehicle, reader_name)
    ]
    for path, samples in zip(paths, flights_none_where_long, strict=True):
        if samples is not None:
            yield samples
            continue
        for recording in read_parts_for_vehicle(path, vehicle, reader_name):
            yield resample(recording, vehicle)


def _read_flight_for_fit(path: Path, vehicle: Vehicle, reader_name: str | None) -> Samples:
    """A flight; of a long one stretches that are spread over it evenly."""
    kept_stretches: list[Samples] = []
    keep_every_nth_stretch, n_stretches_seen, read_until_s = 1, 0, -np.inf
    for part_number, recording in enumerate(read_parts_for_vehicle(path, vehicle, reader_name), 1):
        samples = resample(recording, vehicle)
        for begin in range(
            int(np.searchsorted(samples.t_s, read_until_s, side="right")),
            len(samples.t_s),
            _FIT_STRETCH_SAMPLES,
        ):
            if n_stretches_seen % keep_every_nth_stretch == 0:
                kept_stretches.append(_select_rows(samples, slice(begin, begin + _FIT_STRETCH_SAMPLES)))
            n_stretches_seen += 1
        while len(kept_stretches) * _FIT_STRETCH_SAMPLES > MAX_FIT_SAMPLES and part_number > 1:
            kept_stretches, keep_every_nth_stretch = kept_stretches[::2], 2 * keep_every_nth_stretch
        read_until_s = samples.t_s[-1]
    return samples if part_number == 1 else _concatenate_samples(path.stem, kept_stretches, part_number)


def first_samples(samples: Samples, n_samples: int) -> Samples:
    """The first samples."""
    return samples if n_samples >= len(samples.t_s) else _select_rows(samples, slice(n_samples))


def _select_rows(samples: Samples, row_slice: slice) -> Samples:
    """Some of the samples, copied."""
    selected_fields = {
        name: values[row_slice].copy()
        for name in _PER_SAMPLE_FIELDS
        if (values := getattr(samples, name)) is not None
    }
    time_since_change_s_by_column = {
        name: values[row_slice].copy() for name, values in samples.time_since_change_s_by_column.items()
    }
    return replace(
        samples,
        log_stamps_s=selected_fields["t_s"],
        time_since_change_s_by_column=time_since_change_s_by_column,
        **selected_fields,
    )


def _concatenate_samples(name: str, stretches: list[Samples], n_log_parts: int) -> Samples:
    """Samples of stretches one after the other, with a gap between."""
    field_names = [name for name in _PER_SAMPLE_FIELDS if getattr(stretches[0], name) is not None]
    joined_fields: dict[str, Any] = {
        name: np.concatenate([getattr(stretch, name) for stretch in stretches]) for name in field_names
    }
    is_stretch_begin = (
        np.diff(joined_fields["stretch_number"], prepend=joined_fields["stretch_number"][0]) != 0
    )
    is_stretch_begin[np.cumsum([len(stretch.t_s) for stretch in stretches])[:-1]] = True
    joined_fields["stretch_number"] = np.cumsum(is_stretch_begin)
    time_since_change_s_by_column = {
        name: np.concatenate([stretch.time_since_change_s_by_column[name] for stretch in stretches])
        for name in stretches[0].time_since_change_s_by_column
    }
    long_log_note = (
        f"a long log, read in {n_log_parts} parts: {len(is_stretch_begin)} samples of it, spread evenly, are "
        "looked at"
    )
    notes = (long_log_note, *dict.fromkeys(note for stretch in stretches for note in stretch.notes))
    return replace(
        stretches[0],
        name=name,
        notes=notes,
        n_log_parts=n_log_parts,
        log_stamps_s=joined_fields["t_s"],
        time_since_change_s_by_column=time_since_change_s_by_column,
        rates_confirmed_by_attitude=frozenset.intersection(
            *(stretch.rates_confirmed_by_attitude for stretch in stretches)
        ),
        **joined_fields,
    )


def load_flights_for_fit(
    paths: Sequence[Path], vehicle: Vehicle, reader_name: str | None = None
) -> list[Samples]:
    """The flights, each on one time base, of a long one what a fit wants of it. Raises BadInput with a line
    for each that cannot be used."""
    flights: list[Samples] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            flights.append(_read_flight_for_fit(path, vehicle, reader_name))
        except BadInput as error:
            mistakes.append(str(error))
    for name, n_flights_with_name in Counter(samples.name for samples in flights).items():
        if n_flights_with_name > 1:
            mistakes.append(f"two flights are named {name}: one result would replace the other")
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return flights
