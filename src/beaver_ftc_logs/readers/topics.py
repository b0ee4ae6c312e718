"""The topics of an autopilot's log as columns. Rows whose stamps are out of order are left out, with a line
on them."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Column, Floats, Ints, Parameters, RecordedFlight, Wanted
from beaver_ftc_logs.refusals import refusal

_S_PER_US = 1e-6


@contextmanager
def package_errors_as_bad_input(
    path: Path, log_kind: str, package: str, valid_log_file_text: str
) -> Iterator[None]:
    """Context in which a third-party package reads an autopilot's log: its printed messages on damaged files
    are discarded. Raises BadInput if the package is missing or cannot read the file.

    log_kind: words for such a log; valid_log_file_text: words for the files that hold one.
    """
    try:
        with redirect_stdout(StringIO()):
            yield
    except ImportError:
        missing_package_text = (
            f"reading a {log_kind} needs {package}, allowed: pip install 'beaver-ftc[flights]'"
        )
        raise BadInput(f"{path}: {missing_package_text}") from None
    except BadInput:
        raise
    except Exception as error:  # these packages raise errors of any type for a damaged file
        reason = " ".join(str(error).split()) or type(error).__name__
        raise refusal(path, f"is no {log_kind} that can be read ({reason})", valid_log_file_text) from None


@dataclass(frozen=True)
class Topic:
    """One topic of an autopilot's log.

    stamps_us (n,). fields: names of the other fields. values: function from a field to its numbers, (n,).
    """

    stamps_us: Floats
    fields: list[str]
    values: Callable[[str], Any]


def names_of_topics(topics: Mapping[str, Topic]) -> tuple[str, ...]:
    """The names of the columns of all topics."""
    return tuple(f"{name}.{field}" for name, topic in topics.items() for field in topic.fields)


def flight_of_topics(
    path: Path,
    topics: Mapping[str, Topic],
    wanted: Wanted,
    names: tuple[str, ...],
    params: Parameters,
) -> tuple[RecordedFlight, float | None]:
    """The flight with the columns `topic.field` of a log: those of the wanted names, all of `topics` if
    wanted is None; and the stamp, s, from which its times count, None if no row has one.

    topics: the topics that were read, those of the wanted columns among them; the earliest of their stamps is
    the origin of the times. names: of the columns of all topics of the log, which the message about a missing
    column lists; those of `topics` are enough if no wanted column is missing. If none of `names` is wanted,
    the flight has a column without rows for each of them.
    """
    flight = RecordedFlight(path.stem, {}, parameters=params, unread_column_names=names)
    if wanted is not None and not {*wanted} & {*names}:
        flight.columns.update(dict.fromkeys(names, Column(np.empty(0), np.empty(0))))
        return flight, None
    kept = {name: rows_with_increasing_time(name, topic.stamps_us) for name, topic in topics.items()}
    first_us = [topics[name].stamps_us[rows[0]] for name, (rows, _) in kept.items() if len(rows)]
    origin_us = min(first_us, default=0.0)
    for name, topic in topics.items():
        rows, note = kept[name]
        t_s = (topic.stamps_us[rows] - origin_us) * _S_PER_US
        for field_name in topic.fields:
            if wanted is None or f"{name}.{field_name}" in wanted:
                values = np.asarray(topic.values(field_name)[rows], dtype=float)
                flight.columns[f"{name}.{field_name}"] = Column(t_s, values, note)
    return flight, float(origin_us * _S_PER_US) if first_us else None


def rows_with_increasing_time(topic: str, stamps: Floats) -> tuple[Ints, str]:
    """Positions of as many rows as possible whose stamps increase, and a line on the rows that are left out.

    One damaged stamp removes its own row, not all rows after it. Of several rows with the same stamp, only
    the first is kept, without a remark: autopilots write a stamp twice.
    """
    if (np.diff(stamps) >= 0).all() and np.isfinite(stamps).all():
        return np.flatnonzero(np.diff(stamps, prepend=-np.inf)), ""
    finite_stamp_rows = np.flatnonzero(np.isfinite(stamps))
    kept_rows = finite_stamp_rows[_longest_increasing_rows(stamps[finite_stamp_rows])]
    left_out_rows = np.setdiff1d(np.arange(len(stamps)), kept_rows)
    misplaced_rows = [k for k in left_out_rows.tolist() if k == 0 or stamps[k] != stamps[k - 1]]
    if not misplaced_rows:
        return kept_rows, ""
    n_more = len(misplaced_rows) - 1
    others = f", as {'is' if n_more == 1 else 'are'} {n_more} more of {len(stamps)}" if n_more else ""
    first = f"{topic}: row {misplaced_rows[0] + 1}"
    return kept_rows, f"{first}: its stamp is out of order, the row is left out{others}"


def _longest_increasing_rows(stamps: Floats) -> Ints:
    """Positions of a longest strictly increasing subsequence, by patience sorting from the end.

    From the end, because then a row that comes late is left out, and not the row before it.

    next_rows: for each row the next row in the longest subsequence that begins with it, -1 for none.
    """
    # Entry i: the largest first stamp, negated, of a subsequence of length i + 1 so far, and the row of this
    # stamp.
    first_stamps: list[float] = []
    first_rows: list[int] = []
    next_rows = np.full(len(stamps), -1)
    for k in range(len(stamps) - 1, -1, -1):
        length = bisect_left(first_stamps, -stamps[k])
        next_rows[k] = first_rows[length - 1] if length else -1
        first_stamps[length : length + 1] = [-stamps[k]]
        first_rows[length : length + 1] = [k]
    kept_rows = first_rows[-1:]
    while kept_rows and next_rows[kept_rows[-1]] >= 0:
        kept_rows.append(int(next_rows[kept_rows[-1]]))
    return np.array(kept_rows, dtype=np.int64)
