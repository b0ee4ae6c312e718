"""The topics of an autopilot's log as columns: which of its rows are in order, and a line on the others."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Column, Columns, Floats, Ints, Wanted

_S_PER_US = 1e-6


@contextmanager
def package_errors_as_bad_input(
    path: Path, log_kind: str, package: str, valid_log_file_text: str
) -> Iterator[None]:
    """Within this an autopilot's log is read with a package of others: what it prints of damaged files stays
    here. Raises BadInput where the package is missing, or the file is none that it can read.

    log_kind: what such a log is called; valid_log_file_text: which files hold one.
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
    except Exception as error:  # these packages raise whatever a damaged file makes them stumble over
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(
            f"{path}: is no {log_kind} that can be read ({reason}), allowed: {valid_log_file_text}"
        ) from None


@dataclass(frozen=True)
class Topic:
    """What an autopilot's log has of one topic.

    stamps_us (n,). fields: the names of the others. values: gives the numbers of a field, (n,).
    """

    stamps_us: Floats
    fields: list[str]
    values: Callable[[str], Any]


def names_of_topics(topics: Mapping[str, Topic]) -> tuple[str, ...]:
    """The names of the columns of all topics."""
    return tuple(f"{name}.{field}" for name, topic in topics.items() for field in topic.fields)


class TopicColumns(NamedTuple):
    """The columns of a log by name; the names of all its columns; the stamp, s, from which the times count,
    None if no row has one."""

    columns: Columns
    all_names: tuple[str, ...]
    origin_s: float | None


def columns_of_topics(
    topics: Mapping[str, Topic], wanted: Wanted, all_topics: Mapping[str, Topic]
) -> TopicColumns:
    """The columns `topic.field` of a log: those of the wanted names, all of `topics` if wanted is None.

    topics: the topics that were read, those of the wanted columns among them. all_topics: gives names only.
    It is `topics` itself if these have every wanted column, or are all that the log has. A reader that reads
    some topics passes all topics of the log if a wanted column is missing, for the message that says so.

    The origin of the times is the earliest stamp of `topics`. If all_topics has none of the wanted names, the
    columns are all of its names, without rows.
    """
    names = names_of_topics(all_topics)
    if wanted is not None and not {*wanted} & {*names}:
        return TopicColumns(dict.fromkeys(names, Column(np.empty(0), np.empty(0))), names, None)
    kept = {name: rows_with_increasing_time(name, topic.stamps_us) for name, topic in topics.items()}
    first_us = [topics[name].stamps_us[rows[0]] for name, (rows, _) in kept.items() if len(rows)]
    origin_us = min(first_us, default=0.0)
    origin_s = float(origin_us * _S_PER_US) if first_us else None
    columns: Columns = {}
    for name, topic in topics.items():
        rows, note = kept[name]
        t_s = (topic.stamps_us[rows] - origin_us) * _S_PER_US
        for field_name in topic.fields:
            if wanted is None or f"{name}.{field_name}" in wanted:
                values = np.asarray(topic.values(field_name)[rows], dtype=float)
                columns[f"{name}.{field_name}"] = Column(t_s, values, note)
    return TopicColumns(columns, names, origin_s)


def rows_with_increasing_time(topic: str, stamps: Floats) -> tuple[Ints, str]:
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
    n_more = len(misplaced_rows) - 1
    others = f", as {'is' if n_more == 1 else 'are'} {n_more} more of {len(stamps)}" if n_more else ""
    first = f"{topic}: row {misplaced_rows[0] + 1}"
    return kept_rows, f"{first}: its stamp is out of order, the row is left out{others}"


def _longest_increasing_rows(stamps: Floats) -> Ints:
    """Places of a longest strictly increasing subsequence, by patience sorting from the end.

    From the end, so that of a row and one that comes late behind it the late one is left out.
    """
    # by length of a subsequence: its largest first stamp, negated, and the row of that
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
