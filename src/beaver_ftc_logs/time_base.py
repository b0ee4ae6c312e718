"""One time base for the columns of a log: times of the samples, gaps, and the last value up to each time."""

from dataclasses import replace

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import signals
from beaver_ftc_logs.recording import Column, Floats, Ints, Mask
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.runs import runs_between
from beaver_ftc_logs.units import TIME_UNITS

MIN_HZ = 4.0  # least sample rate of the body rates
_MAX_HZ = 1e5  # a faster log has another unit of time
_MIN_ROWS = 50  # least number of rows of the body rates; the first so many give the usual step
_ALIKE_RATIO = 1.05  # a log is averaged only if it is faster than its largest sample rate by this factor
# A longer step, as a multiple of the usual step, is a gap: no rate is predicted across it.
_MIN_GAP_STEPS = 3.5


def sample_times(flight: str, stamps: Floats, max_hz: float) -> tuple[Floats, Ints, float]:
    """Times of the samples, s, number of the gap-free stretch of each, (n,), and the usual step, s. The times
    are the stamps themselves, or evenly spaced ones if the log is faster than max_hz. Raises BadInput if the
    stamps are too few, too slow or too fast.
    """
    if (n := len(stamps)) < _MIN_ROWS:
        raise refusal(flight, f"has {n} samples of the rates", f"at least {_MIN_ROWS}")
    step_s = median_step_s(stamps)
    _refuse_rate(flight, 1.0 / step_s)
    if 1.0 / step_s <= _ALIKE_RATIO * max_hz:
        return stamps, np.cumsum(np.diff(stamps, prepend=stamps[0]) > _MIN_GAP_STEPS * step_s), step_s
    step_s = 1.0 / max_hz
    grids = [
        stamps[begin] + step_s * np.arange((stamps[end - 1] - stamps[begin]) / step_s + 0.5)
        for begin, end in runs_between(np.diff(stamps) > _MIN_GAP_STEPS * step_s)
    ]
    t_s = np.concatenate(grids)
    if len(t_s) < _MIN_ROWS:
        raise refusal(
            flight,
            f"{n} rows within {stamps[-1] - stamps[0]:.3g} s are {len(t_s)} samples at {max_hz:g} Hz",
            f"at least {_MIN_ROWS}; is time in another unit?",
        )
    return t_s, np.repeat(np.arange(len(grids)), [*map(len, grids)]), step_s


def _refuse_rate(flight: str, rate_hz: float) -> None:
    """Raise BadInput if the rates are logged more slowly than MIN_HZ or faster than _MAX_HZ."""
    logged = f"{flight}: rates are logged at {rate_hz:.2g} Hz"
    if rate_hz < MIN_HZ:
        rates = {unit: rate_hz / seconds for unit, seconds in TIME_UNITS.items() if unit != "s"}
        hints = (f" (time in {unit} would be {hz:.3g} Hz)" for unit, hz in rates.items() if 10 <= hz <= 1000)
        raise BadInput(
            f"{logged}, allowed: at least {MIN_HZ:g} Hz to tell a surface's effect from the vehicle's own "
            f"motion{next(hints, '')}"
        )
    if rate_hz > _MAX_HZ:
        raise BadInput(f"{logged}, allowed: up to {_MAX_HZ:g} Hz, time in seconds")


def median_step_s(stamps: Floats) -> float:
    """The usual step of the first _MIN_ROWS stamps, s, so that a log that was cut short has the same; inf for
    a single stamp.
    """
    return float(np.median(np.diff(stamps[:_MIN_ROWS]))) if len(stamps) > 1 else float("inf")


def sample_column(column: Column, t_s: Floats, step_s: float) -> tuple[Floats, float | None]:
    """The values of a column at given times, and their mean age, s, or None if the column has these very
    times.

    The value is the last one up to the time, nan before the first. If the column is logged faster, with a
    step below 0.6 step_s, the value is the mean over the step_s that end at the time, and half of it old.
    """
    if np.array_equal(column.t_s, t_s):
        return column.values, None
    is_faster = median_step_s(column.t_s) < 0.6 * step_s
    column = _finite_rows(column)
    latest = latest_values(t_s, column.t_s, column.values)
    if is_faster:
        return _means(column, t_s, step_s, latest), 0.5 * step_s
    age_s = _held_age_s(column, t_s)
    age_s = age_s[np.isfinite(age_s)]
    return latest, float(age_s.mean()) if age_s.size else float("nan")


def _finite_rows(column: Column) -> Column:
    """The rows of a column that have a number."""
    is_number = np.isfinite(column.values)
    return replace(column, t_s=column.t_s[is_number], values=column.values[is_number])


def _held_age_s(column: Column, t_s: Floats) -> Floats:
    """The age of the last row of a column at each time, s, nan before the first row."""
    return t_s - latest_values(t_s, column.t_s, column.t_s)


def latest_values(t_s: Floats, stamps: Floats, values: Floats) -> Floats:
    """The value of the last stamp up to each time, nan before the first."""
    return np.append(np.nan, values)[np.searchsorted(stamps, t_s, side="right")]


def _means(column: Column, t: Floats, h: float, held: Floats) -> Floats:
    """The mean over the interval of h s that ends at each time t, (n,); `held` (n,) if there is no row in it:

        mean of the values with stamps ts in (t - h + eps, t + eps]

    eps: tolerance for stamps that are meant to fall on the end of an interval.
    """
    ts = column.t_s
    total = np.concatenate([[0.0], np.cumsum(column.values)])
    eps = 1e-6 * h
    end = np.searchsorted(ts, t + eps, side="right")
    begin = np.searchsorted(ts, t - h + eps, side="right")
    count = end - begin
    mean = (total[end] - total[begin]) / np.maximum(count, 1)
    return np.where(count > 0, mean, held)


def unchanged_s(column: Column, t_s: Floats) -> Floats:
    """For how long a column has had the same value at each time, s, including the age of the value. Rows
    without a number do not change it.
    """
    column = _finite_rows(column)
    since_s = latest_values(t_s, column.t_s, signals.time_since_change_s(column))
    return np.nan_to_num(since_s + _held_age_s(column, t_s))


def is_held_value_stale(column: Column, t_s: Floats, step_s: float) -> Mask:
    """Whether the last number of a column is older than the longest step without a gap, at each time,
    (n,)."""
    column = _finite_rows(column)
    usual_step_s = max(median_step_s(column.t_s), step_s) if len(column.t_s) > 1 else step_s
    return _held_age_s(column, t_s) > _MIN_GAP_STEPS * usual_step_s
