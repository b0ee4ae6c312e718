"""Checks of a logged signal: how long it has been constant, whether it is clipped, where it has spikes.

A measured quantity does not repeat for long to the last bit. A command may: the flights that a model was
fitted to show for how long.
"""

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.recording import Column, Floats

MIN_STILL_S, MIN_STILL_ROWS = 1.5, 12
"""A measured rate that repeats for longer than both is frozen."""
_MIN_CLIPPED_CONSECUTIVE_ROWS, _MIN_CLIPPED_TOTAL_ROWS = 3, 10
_MIN_SPIKE_STEP_OVER_MEDIAN, _MAX_SPIKE_SHARE = 40.0, 0.01

Mask = NDArray[np.bool_]


def time_since_change_s(column: Column) -> Floats:
    """How long a column's value has been the same at each row, (n,) s; 0 for fewer than MIN_STILL_ROWS."""
    row_index = np.arange(len(column.values))
    unchanged_since_row = np.maximum.accumulate(np.where(_differs_from_previous(column.values), row_index, 0))
    return np.where(
        row_index - unchanged_since_row >= MIN_STILL_ROWS, column.t_s - column.t_s[unchanged_since_row], 0.0
    )


def _differs_from_previous(values: Floats) -> Mask:
    """Rows (n,) whose value differs from that of the row before. The first row and each row without a number
    count as different."""
    return np.concatenate([[True], values[1:] != values[:-1]])[: len(values)]


def find_clipped_rows(values: Floats) -> Mask:
    """Rows (n,) at the largest value so far, of either sign, if it has lasted for three rows and has been
    reached in ten rows.

    Uses nothing later than the row.
    """
    is_clipped_row = np.zeros(len(values), dtype=bool)
    for signed_values in (values, -values):
        values_nan_as_minus_infinity = np.where(np.isfinite(signed_values), signed_values, -np.inf)
        is_at_running_maximum = (signed_values == np.maximum.accumulate(values_nan_as_minus_infinity)) & (
            signed_values > 0.0
        )
        row_index = np.arange(len(signed_values))
        at_maximum_since_row = np.maximum.accumulate(
            np.where(_differs_from_previous(signed_values) | ~is_at_running_maximum, row_index, 0)
        )
        running_maximum_ordinal = np.cumsum(
            _differs_from_previous(np.maximum.accumulate(values_nan_as_minus_infinity)).astype(np.int64)
        )  # a larger value begins the count again
        n_rows_at_maximum = np.cumsum(is_at_running_maximum) - _count_rows_at_previous_maxima(
            is_at_running_maximum, running_maximum_ordinal
        )
        is_clipped_row |= (
            is_at_running_maximum
            & (row_index - at_maximum_since_row >= _MIN_CLIPPED_CONSECUTIVE_ROWS - 1)
            & (n_rows_at_maximum >= _MIN_CLIPPED_TOTAL_ROWS)
        )
    return is_clipped_row


def _count_rows_at_previous_maxima(
    is_at_running_maximum: Mask, running_maximum_ordinal: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Count, for each row, the rows at smaller largest values: those before the present largest value was
    reached. running_maximum_ordinal (n,): number of the present largest value, counted from 1."""
    cumulated_rows_at_maximum = np.cumsum(is_at_running_maximum)
    first_row_of_each_maximum = np.flatnonzero(np.diff(running_maximum_ordinal, prepend=0))
    return (
        (cumulated_rows_at_maximum - is_at_running_maximum)[first_row_of_each_maximum][
            running_maximum_ordinal - 1
        ]
        if len(first_row_of_each_maximum)
        else np.zeros(len(running_maximum_ordinal), dtype=np.int64)
    )


def find_spike_rows(values: Floats) -> NDArray[np.int64]:
    """Indices of single rows that differ from both neighbours by more than 40 times the usual step; none if
    they are more than 1 % of the rows."""
    finite_rows = np.flatnonzero(np.isfinite(values))
    if len(finite_rows) < MIN_STILL_ROWS:
        return finite_rows[:0]
    signed_steps = np.diff(values[finite_rows])
    median_nonzero_step_size = (
        float(np.median(np.abs(signed_steps[signed_steps != 0.0]))) if (signed_steps != 0.0).any() else 0.0
    )
    is_spike = (np.abs(signed_steps[:-1]) > _MIN_SPIKE_STEP_OVER_MEDIAN * median_nonzero_step_size) & (
        np.abs(signed_steps[1:]) > _MIN_SPIKE_STEP_OVER_MEDIAN * median_nonzero_step_size
    )
    is_spike &= signed_steps[:-1] * signed_steps[1:] < 0.0
    spike_rows = finite_rows[1:-1][is_spike]
    return (
        spike_rows
        if median_nonzero_step_size > 0.0 and len(spike_rows) <= _MAX_SPIKE_SHARE * len(finite_rows)
        else finite_rows[:0]
    )


def column_defect_texts(name: str, column: Column, is_measured_rate: bool) -> list[str]:
    """Return a line for each mistake in a column over the whole flight. is_measured_rate: a rate, not a
    command."""
    values, defect_texts = column.values, [column.note] if column.note else []
    n_missing = int((~np.isfinite(values)).sum())
    if n_missing:
        defect_texts.append(f"{name}: rows without a number: {n_missing} of {len(values)}")
    longest_still_s = float(time_since_change_s(column).max(initial=0.0))
    if is_measured_rate and longest_still_s > MIN_STILL_S:
        defect_texts.append(f"{name}: frozen, the same to the last bit for {longest_still_s:.1f} s")
    if not is_measured_rate and values.size and np.nanmin(values) == np.nanmax(values):
        defect_texts.append(f"{name}: does not move, nothing can be said of what it moves alone")
    if is_measured_rate and (is_clipped_row := find_clipped_rows(values)).any():
        defect_texts.append(
            f"{name}: clipped at {np.abs(values[is_clipped_row]).max():.4g} in {is_clipped_row.sum()} rows"
        )
    if is_measured_rate and len(spike_rows := find_spike_rows(values)):
        spike_count_text = "1 jump" if len(spike_rows) == 1 else f"{len(spike_rows)} jumps"
        defect_texts.append(f"{name}: {spike_count_text}, the first at {column.t_s[spike_rows[0]]:.2f} s")
    return defect_texts
