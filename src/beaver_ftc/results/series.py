"""A log reduced to what an eye can tell apart: of each stretch of a long flight its lowest and highest.

Read a row group at a time, so that a ten-hour flight fits; a short flight is returned as it is.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from beaver_ftc.results import log
from beaver_ftc.results.views import sources

MAX_POINTS = 4000
WHOLE = (-math.inf, math.inf)
Series = dict[str, np.ndarray]


def read_series(
    path: Path, columns: Sequence[str], window_s: tuple[float, float] = WHOLE, max_points: int = MAX_POINTS
) -> Series:
    """What `series_of` makes of the log in a parquet file."""
    return series_of(log.StoredLog(path), columns, window_s, max_points)


def series_of(
    source: log.Log,
    columns: Sequence[str],
    window_s: tuple[float, float] = WHOLE,
    max_points: int = MAX_POINTS,
) -> Series:
    """`t_s` and the named columns within a window of time, each of shape (points,), about max_points at most.

    A longer log is cut into stretches of equal length; each gives two points at its first two instants, the
    lowest value and the highest in the order in which they occur, so that no peak is lost.
    """
    wanted = tuple(dict.fromkeys(("t_s", *columns)))
    frame_s = _frame_s(source)
    rows = min(source.row_count(), (window_s[1] - window_s[0]) / frame_s)
    stretch = 1 if rows <= max_points else math.ceil(2 * rows / max_points)
    whole = _unwrap_heading(source.read_chunks(sources(wanted)))
    chunks = (_derive(_within(chunk, window_s), wanted) for chunk in whole)
    parts = [chunk if stretch == 1 else _envelope(chunk, stretch) for chunk in chunks if chunk["t_s"].size]
    return {name: np.concatenate([part[name] for part in parts] or [np.empty(0)]) for name in wanted}


def _unwrap_heading(chunks: Iterable[Series]) -> Iterator[Series]:
    """Heading without its jumps of a whole turn."""
    last = np.empty(0)
    for chunk in chunks:
        if "psi_rad" in chunk:
            chunk["psi_rad"] = np.unwrap(np.append(last, chunk["psi_rad"]))[last.size :]
            last = chunk["psi_rad"][-1:]
        yield chunk


def _derive(chunk: Series, wanted: Sequence[str]) -> Series:
    return {name: chunk[name] if name in chunk else _ratio(chunk, sources([name])) for name in wanted}


def _ratio(chunk: Series, names: Sequence[str]) -> np.ndarray:
    """|residual| / threshold, the threshold on the residual's side; NaN where there is no threshold."""
    residual, *bounds = (chunk[name] for name in names)
    bound = bounds[0] if len(bounds) == 1 else np.where(residual < 0, bounds[0], bounds[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(residual / bound)
    return np.where(np.isfinite(ratio), ratio, np.nan)


def _frame_s(source: log.Log) -> float:
    """Time from one row to the next, s; infinite in a log of a single row."""
    first = next(source.read_chunks(["t_s"]), {"t_s": np.empty(0)})["t_s"][:2]
    return float(first[1] - first[0]) if first.size == 2 else math.inf


def _within(chunk: Series, window_s: tuple[float, float]) -> Series:
    first, last = np.searchsorted(chunk["t_s"], window_s, side="left")
    return {name: values[first:last] for name, values in chunk.items()}


def _envelope(chunk: Series, stretch: int) -> Series:
    starts = np.arange(0, chunk["t_s"].size, stretch)
    middles = np.minimum(starts + stretch // 2, chunk["t_s"].size - 1)
    out = {name: _extremes(values, starts) for name, values in chunk.items() if name != "t_s"}
    return {"t_s": np.column_stack([chunk["t_s"][starts], chunk["t_s"][middles]]).ravel()} | out


def _extremes(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    lowest = np.fmin.reduceat(values, starts)
    highest = np.fmax.reduceat(values, starts)
    rising = values[starts] <= values[np.append(starts[1:], values.size) - 1]
    first, second = np.where(rising, lowest, highest), np.where(rising, highest, lowest)
    return np.column_stack([first, second]).ravel()
