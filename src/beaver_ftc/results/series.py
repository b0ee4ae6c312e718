"""The curves of a log: its columns and columns derived from them, thinned to the points that a page needs.

A long log is cut into stretches of equal length, and each stretch is reduced to its lowest and its highest
value. The log is read a row group at a time, so that a flight of ten hours fits into memory.

    derived column              value
    ..._ratio                   |residual| / threshold on the side of the residual
    ..._unlike_rad              position of a surface where it differs from the effective deflection, else NaN
    airspeed_mean_mps           commanded airspeed + mean deviation over 10 s (`_add_mean_airspeed`)
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate

import numpy as np

from beaver_ftc.results import log
from beaver_ftc.scenario.autopilot import MEAN_S

MAX_CURVE_POINTS = 4000
WHOLE_FLIGHT_S = (-math.inf, math.inf)
RATIO_ENDING = "_ratio"
UNLIKE_ENDING = "_unlike_rad"
MIN_UNLIKE_RAD = math.radians(0.05)  # a smaller difference of position and effective deflection is not shown
COMMANDED_AIRSPEED_COLUMN, FLOWN_AIRSPEED_COLUMN = "airspeed_command_mps", "airspeed_mps"
MEAN_AIRSPEED_COLUMN = "airspeed_mean_mps"


def source_columns(columns: Iterable[str]) -> tuple[str, ...]:
    """The log columns from which the shown columns, some of them derived, are computed."""
    return tuple(dict.fromkeys(source for column in columns for source in _source_columns_of(column)))


def _source_columns_of(column: str) -> tuple[str, ...]:
    """The log columns of one column. Those of a ratio are the residual, then its threshold, or its lower and
    upper threshold."""
    if column == MEAN_AIRSPEED_COLUMN:
        return (COMMANDED_AIRSPEED_COLUMN, FLOWN_AIRSPEED_COLUMN)
    if column.endswith(UNLIKE_ENDING):
        return tuple(f"{column.removesuffix(UNLIKE_ENDING)}_{what}_rad" for what in ("pos", "effective"))
    stem = column.removesuffix(RATIO_ENDING)
    if stem == column:
        return (column,)
    bounds = ("lower", "upper") if stem.startswith("fie_") else ("threshold",)
    return tuple(f"{stem}_{what}_rad_s" for what in ("residual", *bounds))


def series_of(
    source: log.Log,
    columns: Sequence[str],
    window_s: tuple[float, float] = WHOLE_FLIGHT_S,
    max_points: int = MAX_CURVE_POINTS,
) -> log.Values:
    """`t_s` and the named columns within a window begin <= t < end, each of shape (points,), about max_points
    at most.

    More rows are cut into stretches of equal length. Each gives two points, its lowest and its highest
    value, so that no peak is lost.
    """
    names = tuple(dict.fromkeys(("t_s", *columns)))
    rows = min(source.row_count(), (window_s[1] - window_s[0]) / source.frame_s)
    stretch = 1 if rows <= max_points else math.ceil(2 * rows / max_points)
    chunks = _unwrap_heading(source.read_chunks(source_columns(names)))
    chunks = _add_mean_airspeed(chunks, source.frame_s) if MEAN_AIRSPEED_COLUMN in names else chunks
    parts = []
    for chunk in chunks:
        first, last = np.searchsorted(chunk["t_s"], window_s, side="left")
        if first < last:
            cut = {name: values[first:last] for name, values in chunk.items()}
            curves = {name: cut[name] if name in cut else _derived_column(cut, name) for name in names}
            parts.append(curves if stretch == 1 else _extremes_by_stretch(curves, stretch))
    return {name: np.concatenate([part[name] for part in parts] or [np.empty(0)]) for name in names}


def _unwrap_heading(chunks: Iterable[log.Values]) -> Iterator[log.Values]:
    """The chunks with the heading psi unwrapped: without its jumps of 2 pi, also between chunks."""
    last = np.empty(0)
    for chunk in chunks:
        if "psi_rad" in chunk:
            chunk["psi_rad"] = np.unwrap(np.append(last, chunk["psi_rad"]))[last.size :]
            last = chunk["psi_rad"][-1:]
        yield chunk


def _add_mean_airspeed(chunks: Iterable[log.Values], frame_s: float) -> Iterator[log.Values]:
    """The chunks with the mean airspeed, as the autopilot judges it: the deviation of the airspeed V (m/s)
    from its command c (m/s) through a lag of MEAN_S, m = 0 at the start,

    d = V - c (0 where it is NaN),    m <- m + (frame_s / MEAN_S) (d - m),    mean airspeed c + m
    """
    share = frame_s / MEAN_S if math.isfinite(frame_s) else 1.0
    last = 0.0
    for chunk in chunks:
        off = np.nan_to_num(chunk[FLOWN_AIRSPEED_COLUMN] - chunk[COMMANDED_AIRSPEED_COLUMN]).tolist()
        means = [*accumulate(off, lambda mean, d: mean + share * (d - mean), initial=last)][1:]
        last = means[-1] if means else last
        yield chunk | {MEAN_AIRSPEED_COLUMN: chunk[COMMANDED_AIRSPEED_COLUMN] + means}


def _derived_column(chunk: log.Values, name: str) -> np.ndarray:
    """A column ..._unlike_rad or ..._ratio, as the table of the module says; NaN where there is no
    threshold."""
    values, *others = (chunk[source] for source in _source_columns_of(name))
    if name.endswith(UNLIKE_ENDING):
        return np.where(np.abs(values - others[0]) > MIN_UNLIKE_RAD, values, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(values / np.where(values < 0, others[0], others[-1]))
    return np.where(np.isfinite(ratio), ratio, np.nan)


def _extremes_by_stretch(chunk: log.Values, stretch: int) -> log.Values:
    """Two points for each stretch of so many rows: at its begin and at its middle."""
    starts = np.arange(0, chunk["t_s"].size, stretch)
    middles = np.minimum(starts + stretch // 2, chunk["t_s"].size - 1)
    out = {name: _lowest_and_highest(values, starts) for name, values in chunk.items() if name != "t_s"}
    return {"t_s": np.column_stack([chunk["t_s"][starts], chunk["t_s"][middles]]).ravel()} | out


def _lowest_and_highest(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """The extremes of each stretch of values (n,), (2 stretches,): the lowest first where the stretch rises
    from its first value to its last."""
    lowest = np.fmin.reduceat(values, starts)
    highest = np.fmax.reduceat(values, starts)
    rising = values[starts] <= values[np.append(starts[1:], values.size) - 1]
    first, second = np.where(rising, lowest, highest), np.where(rising, highest, lowest)
    return np.column_stack([first, second]).ravel()
