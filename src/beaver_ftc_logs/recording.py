"""A recorded flight as a reader returns it: named columns, each with its own time stamps.

Which rows of an autopilot's log are in order, and what is said of the others.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from io import StringIO
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput

Floats = NDArray[np.float64]
Parameters = Mapping[str, tuple[float, ...]]
"""Parameters of an autopilot by name: its value in the log; if it changes, the first and the last one."""
_S_PER_US = 1e-6
_N_LISTED_NEAREST_NAMES = 10
MIN_DIVISOR = float(np.sqrt(np.finfo(float).tiny))
"""Least value of a divisor that may be zero."""


@dataclass(frozen=True)
class Column:
    """One logged quantity. t_s (n,) s, increasing; values (n,) in the unit its name carries; note: a line on
    rows that were left out."""

    t_s: Floats
    values: Floats
    note: str = ""


@dataclass(frozen=True)
class LoggedFailure:
    """A failure that the log itself states: for scoring only, `diagnose` never reads it."""

    t_s: float
    surface: str


@dataclass(frozen=True)
class RecordedFlight:
    """One flight: its columns by name, what went wrong by the log's own word, remarks on the reading, and the
    autopilot's parameters that the log carries.

    unread_column_names: names of further columns of the log, for the message that a wanted column is missing.
    A reader of wanted columns gives them where the log lacks one of these.
    """

    name: str
    columns: Mapping[str, Column]
    logged_failures: tuple[LoggedFailure, ...] = ()
    notes: tuple[str, ...] = field(default=())
    parameters: Parameters = field(default_factory=dict)
    unread_column_names: tuple[str, ...] = ()

    def nearest_columns_text(self, wanted_name: str) -> str:
        """The names of the log's columns that are nearest to one that it has not, read or not."""
        return nearest_names_text(wanted_name, {*self.columns, *self.unread_column_names})


def add_parameter(values_by_name: dict[str, tuple[float, ...]], name: str, value: float) -> None:
    """Note a value that a log gives to a parameter."""
    values = values_by_name.get(name, ())
    is_as_before = bool(values) and (values[-1] == value or (isnan(values[-1]) and isnan(value)))
    if not is_as_before:
        values_by_name[name] = (*values[:1], float(value))


def nearest_names_text(wanted_name: str, names: Iterable[str]) -> str:
    """The ten names nearest to what was given, and how many there are besides."""
    sorted_names = sorted(names)
    ranked_names = sorted(
        sorted_names, key=lambda name: -SequenceMatcher(None, name.lower(), wanted_name.lower()).ratio()
    )
    nearest_text = (
        ", ".join(
            name if name.isprintable() else repr(name) for name in ranked_names[:_N_LISTED_NEAREST_NAMES]
        )
        or "none"
    )
    return (
        nearest_text
        if len(sorted_names) <= _N_LISTED_NEAREST_NAMES
        else f"{nearest_text}, and {len(sorted_names) - _N_LISTED_NEAREST_NAMES} more"
    )


@contextmanager
def package_errors_as_bad_input(
    path: Path, log_kind: str, package: str, valid_log_file_text: str
) -> Iterator[None]:
    """Within this an autopilot's log is read with a package of others: what it prints of damaged files stays
    here. Raises BadInput where the package is missing, or the file is none that it can read.

    log_kind: such a log is called; valid_log_file_text: says which files hold one.
    """
    try:
        with redirect_stdout(StringIO()):
            yield
    except ImportError:
        missing_package_text = (
            f"reading a {log_kind} needs {package}, allowed: pip install 'beaver-ftc[flights]'"
        )
        raise BadInput(f"{path}: {missing_package_text}") from None
    except Exception as error:  # these packages raise whatever a damaged file makes them stumble over
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(
            f"{path}: is no {log_kind} that can be read ({reason}), allowed: {valid_log_file_text}"
        ) from None


def columns_and_time_origin(
    topics: dict[str, dict[str, Any]], stamp_field: str, other_first_stamps_us: Iterable[float] = ()
) -> tuple[dict[str, Column], float]:
    """The fields of all topics as columns `topic.field`, and the first stamp, from which time counts, s.

    topics: each topic's fields by name, one of them the stamps in us; they are used up, so that no number is
    in memory twice. other_first_stamps_us: of topics that are not kept.
    """
    stamps_of_topic = {name: _as_float_array(fields.pop(stamp_field)) for name, fields in topics.items()}
    kept_rows_and_note_of_topic: dict[str, tuple[NDArray[np.int64] | None, str]] = {}
    first_stamps_us = [*other_first_stamps_us]
    for name, stamps in stamps_of_topic.items():
        kept_rows, note = rows_with_increasing_time(name, stamps)
        first_stamps_us += stamps[kept_rows[:1]].tolist()
        kept_rows_and_note_of_topic[name] = (kept_rows if len(kept_rows) < len(stamps) else None), note
    origin_us = min(first_stamps_us, default=0.0)
    columns: dict[str, Column] = {}
    for name, fields in topics.items():
        kept_rows_or_all, note = kept_rows_and_note_of_topic.pop(name)
        t_s = (_selected_rows(stamps_of_topic.pop(name), kept_rows_or_all) - origin_us) * _S_PER_US
        for field_name in list(fields):
            values = _selected_rows(_as_float_array(fields.pop(field_name)), kept_rows_or_all)
            columns[f"{name}.{field_name}"] = Column(t_s, values, note)
    return columns, origin_us * _S_PER_US


def columns_without_numbers(
    fields_by_topic: Mapping[str, Iterable[str]], stamp_field: str
) -> dict[str, Column]:
    """The columns of all topics by their names, each without a row: those of a log that has none that is
    wanted."""
    no_rows = Column(np.empty(0), np.empty(0))
    return dict.fromkeys(column_names_of_topics(fields_by_topic, stamp_field), no_rows)


def column_names_of_topics(fields_by_topic: Mapping[str, Iterable[str]], stamp_field: str) -> tuple[str, ...]:
    """The names of the columns of all topics, without their stamps."""
    return tuple(
        f"{topic}.{field_name}"
        for topic, field_names in fields_by_topic.items()
        for field_name in field_names
        if field_name != stamp_field
    )


def _as_float_array(values: Any) -> Floats:
    return np.asarray(values, dtype=float)


def _selected_rows(values: Floats, rows_or_all: NDArray[np.int64] | None) -> Floats:
    return values if rows_or_all is None else values[rows_or_all]


def rows_with_increasing_time(topic: str, stamps: Floats) -> tuple[NDArray[np.int64], str]:
    """Places of the rows whose stamps increase, as many as can be, and a line on those left out.

    One damaged stamp costs its own row, not all rows after it. Of rows with one stamp the first is kept, and
    nothing is said: autopilots write a stamp twice.
    """
    if (np.diff(stamps) >= 0).all() and np.isfinite(stamps).all():
        return np.flatnonzero(np.diff(stamps, prepend=-np.inf)), ""
    finite_stamp_rows = np.flatnonzero(np.isfinite(stamps))
    kept_rows = finite_stamp_rows[_longest_increasing_rows(stamps[finite_stamp_rows])]
    left_out_rows = np.setdiff1d(np.arange(len(stamps)), kept_rows)
    misplaced_rows = [k for k in left_out_rows.tolist() if k == 0 or stamps[k] != stamps[k - 1]]
    if not misplaced_rows:
        return kept_rows, ""
    n_further = len(misplaced_rows) - 1
    others_text = (
        f", as {'is' if n_further == 1 else 'are'} {n_further} more of {len(stamps)}" if n_further else ""
    )
    return (
        kept_rows,
        f"{topic}: row {misplaced_rows[0] + 1}: its stamp is out of order, the row is left out{others_text}",
    )


def _longest_increasing_rows(stamps: Floats) -> NDArray[np.int64]:
    """Places of a longest strictly increasing subsequence, by patience sorting from the end.

    From the end, so that of a row and one that comes late behind it the late one is left out.
    """
    negated_first_stamp_by_length: list[float] = []
    first_row_by_length: list[int] = []
    next_rows = np.full(len(stamps), -1)
    for k in range(len(stamps) - 1, -1, -1):
        longest_following_length = bisect_left(negated_first_stamp_by_length, -stamps[k])
        next_rows[k] = first_row_by_length[longest_following_length - 1] if longest_following_length else -1
        negated_first_stamp_by_length[longest_following_length : longest_following_length + 1] = [-stamps[k]]
        first_row_by_length[longest_following_length : longest_following_length + 1] = [k]
    kept_rows = first_row_by_length[-1:]
    while kept_rows and next_rows[kept_rows[-1]] >= 0:
        kept_rows.append(int(next_rows[kept_rows[-1]]))
    return np.array(kept_rows, dtype=np.int64)
