"""One time base for the columns of a log: times of the samples, gaps, and the last value up to each time."""

from dataclasses import replace

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import signals
from beaver_ftc_logs.recording import Column, Floats, Ints, Mask
from beaver_ftc_logs.runs import last_row_at
from beaver_ftc_logs.units import TIME_UNITS

MIN_HZ = 4.0  # of the rates
_MAX_HZ = 1e5  # a faster log has another unit of time
_MIN_ROWS = 50  # of the rates; the first of them give the usual step
_ALIKE_RATIO = 1.05  # a log that is faster than its largest sample rate by less is not averaged
# A step of more than this many usual steps is a gap: nothing is predicted across it.
_MIN_GAP_STEPS = 3.5


def sample_times(flight: str, stamps: Floats, max_hz: float) -> tuple[Floats, Ints, float]:
    """Times of the samples, s, and the number of the gap-free stretch of each, (n,), and the usual step, s:
    the stamps themselves, or even times of a log that is faster than max_hz. Raises BadInput where they are
    too few, too slow or too fast."""
    if (n := len(stamps)) < _MIN_ROWS:
        raise BadInput(f"{flight}: has {n} samples of the rates, allowed: at least {_MIN_ROWS}")
    step_s = median_step_s(stamps)
    _refuse_rate(flight, 1.0 / step_s)
    if 1.0 / step_s <= _ALIKE_RATIO * max_hz:
        return stamps, np.cumsum(np.diff(stamps, prepend=stamps[0]) > _MIN_GAP_STEPS * step_s), step_s
    even = _even_times(stamps, 1.0 / max_hz)
    if len(even[0]) < _MIN_ROWS:
        reason = f"{n} rows within {stamps[-1] - stamps[0]:.3g} s are {len(even[0])} samples at {max_hz:g} Hz"
        allowed = f"at least {_MIN_ROWS}; is time in another unit?"
        raise BadInput(f"{flight}: {reason}, allowed: {allowed}")
    return even


def _refuse_rate(flight: str, rate_hz: float) -> None:
    """Raise BadInput for a log whose rates are too slow, or faster than any log's."""
    logged = f"{flight}: rates are logged at {rate_hz:.2g} Hz"
    if rate_hz < MIN_HZ:
        units = {unit: rate_hz / seconds for unit, seconds in TIME_UNITS.items() if unit != "s"}
        hints = [f" (time in {unit} would be {hz:.3g} Hz)" for unit, hz in units.items() if 10 <= hz <= 1000]
        reason = f"to tell a surface's effect from the vehicle's own motion{''.join(hints[:1])}"
        raise BadInput(f"{logged}, allowed: at least {MIN_HZ:g} Hz {reason}")
    if rate_hz > _MAX_HZ:
        raise BadInput(f"{logged}, allowed: up to {_MAX_HZ:g} Hz, time in seconds")


def _even_times(stamps: Floats, step_s: float) -> tuple[Floats, Ints, float]:
    """Samples a step apart over each stretch of the log, from its first stamp on: as `sample_times`.

    begin, last: the rows of the log at the ends of each stretch; counts: its samples; index (n,): the number
    of each sample in its stretch.
    """
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
    """A column's values at given times, and how old they are on average, s; None: it has these very times.

    The value is the last one up to the time, nan before the first; of a column that is logged much faster,
    the mean over the step that ends at the time, which is half a step old.
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
    """How old the last row of a column is at each time, s, nan before the first."""
    return t_s - latest_values(t_s, column.t_s, column.t_s)


def latest_values(t_s: Floats, stamps: Floats, values: Floats) -> Floats:
    """The value of the last stamp up to each time, nan before the first."""
    if not len(stamps):
        return np.full(len(t_s), np.nan)
    return np.where(t_s < stamps[0], np.nan, values[last_row_at(stamps, t_s)])


def _means(column: Column, t: Floats, h: float, held: Floats) -> Floats:
    """The mean over the interval of h s that ends at each time t, (n,); held (n,) where it has no row."""
    ts = column.t_s
    total = np.concatenate([[0.0], np.cumsum(column.values)])
    eps = 1e-6 * h  # of stamps that are meant to fall on the edge
    end = np.searchsorted(ts, t + eps, side="right")
    begin = np.searchsorted(ts, t - h + eps, side="right")
    count = end - begin
    mean = (total[end] - total[begin]) / np.maximum(count, 1)
    return np.where(count > 0, mean, held)


def unchanged_s(column: Column, t_s: Floats) -> Floats:
    """For how long a column has been the same at each sample, s, its age included: rows without a number
    stand still."""
    column = _finite_rows(column)
    since_s = latest_values(t_s, column.t_s, signals.time_since_change_s(column))
    return np.nan_to_num(since_s + _held_age_s(column, t_s))


def is_held_value_stale(column: Column, t_s: Floats, step_s: float) -> Mask:
    """Whether at each sample a gap has opened since the last number of a column."""
    column = _finite_rows(column)
    usual_step_s = max(median_step_s(column.t_s), step_s) if len(column.t_s) > 1 else step_s
    return _held_age_s(column, t_s) > _MIN_GAP_STEPS * usual_step_s
