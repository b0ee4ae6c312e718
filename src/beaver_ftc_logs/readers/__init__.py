"""Readers of recorded flights, by name. A new format is one file here and one row of `READERS`."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Column, Floats, RecordedFlight, TimeSource, Wanted
from beaver_ftc_logs.refusals import refusal

# Number of rows in a part of a long table.
ROWS_PER_PART = 100_000
# Number of samples in a part of another long log, 67 min at 100 Hz: `diagnose` needs 1 GB for 480,000
# samples.
SAMPLES_PER_PART = 400_000
LAST_PART_FACTOR = 1.2  # the last part has at most this many times the rows of another part
PART_OVERLAP_SHARE = 0.1  # the next part begins with the last rows of a part once more: this share of them


@dataclass(frozen=True)
class Reader:
    """A format of logs.

    suffixes: suffixes of its files. time: column of the time and its unit, None if the vehicle file names
    them. of_autopilot: whether a log has parameters, and so many columns that only the wanted ones are read.
    If the log has none of the wanted columns, only the names of all columns are read.
    """

    suffixes: tuple[str, ...]
    time: TimeSource | None = None
    of_autopilot: bool = False


# Name of a format -> the format; the module of this folder with the same name reads it.
READERS = {
    "table": Reader((".csv", ".tsv", ".txt", ".parquet")),
    "alfa": Reader((), ("%time", "ns")),
    "ulog": Reader((".ulg",), ("timestamp", "us"), of_autopilot=True),
    "ardupilot": Reader((".bin", ".log"), ("TimeUS", "us"), of_autopilot=True),
}
SELECTIVE_READERS = tuple(name for name, reader in READERS.items() if reader.of_autopilot)
_READER_OF_SUFFIX = {suffix: name for name, reader in READERS.items() for suffix in reader.suffixes}
_BLACKBOX_PHRASE = (
    "a raw blackbox log of Betaflight or INAV, allowed: a table of it, which `blackbox_decode FILE` writes"
)
# Suffix of a log that another program must convert into a table -> words for the log and the way to convert
# it.
_WAYS_TO_TABLE = {
    ".tlog": "a telemetry log (MAVLink messages that a ground station received), allowed: the autopilot's "
    "own log (.bin, .ulg), or a table of the telemetry, which pymavlink writes: `mavlogdump.py --format csv "
    "--types ATTITUDE,SERVO_OUTPUT_RAW FILE > FILE.csv`",
    ".bbl": _BLACKBOX_PHRASE, ".bfl": _BLACKBOX_PHRASE,
}  # fmt: skip
_POINTER_BYTES = 200  # number of bytes of a file in which the begin of a pointer is searched
# Begin of a pointer -> name of the store, and command that fetches the file.
_LARGE_FILE_STORES = {
    rb"version https?://(git-lfs|hawser)\.github\.com/spec/": ("Git LFS", "git lfs pull"),
    rb"(\.\./|/)*(\.git/)?annex/objects/": ("git-annex", "git annex get FILE"),
}


def read_flight(path: Path, reader: str | None = None, columns: Wanted = None) -> RecordedFlight:
    """The recorded flight in a file or folder, as `read_parts`, in one part."""
    return next(read_parts(path, reader, None, columns, in_parts=False))


def read_parts(
    path: Path,
    reader: str | None = None,
    time: TimeSource | None = None,
    columns: Wanted = None,
    in_parts: bool = True,
) -> Iterator[RecordedFlight]:
    """The recorded flight in a file or folder; a long table in several parts, unless in_parts is false.
    Raises BadInput with one line: why the log cannot be used.

    reader: one of READERS; if None, by the form of the path. time: column of the time of a table, and its
    unit; if None, `t_s` in s. columns: the columns that are read and held in memory; all if None.
    """
    check_exists(path)
    reader = reader or reader_name_for_path(path)
    if reader not in READERS:
        raise refusal(f"--reader {reader}", "is not known", ", ".join(READERS))
    module = import_module(f"beaver_ftc_logs.readers.{reader}")
    own_time = READERS[reader].time
    if own_time is None:
        yield from module.read_parts(path, time, columns, ROWS_PER_PART if in_parts else None)
        return
    if time not in (None, own_time):
        reason = f"{' in '.join(time)} is not its time, allowed: {' in '.join(own_time)}"
        raise BadInput(f"{path}: time: {reason}")
    yield module.read(path, columns)


def split_long_recording(log: RecordedFlight, stamps: Floats, ratio: float) -> Iterator[RecordedFlight]:
    """A log in parts like those of a long table: numbered, and each begins with the end of the part before.

    stamps: increasing stamps of the rows that are counted, s. ratio: number of these rows for one sample. If
    a column has no value at the first row of a part, the part of the column begins with its last value
    before.
    """
    part_rows = round(SAMPLES_PER_PART * ratio)
    if len(stamps) <= LAST_PART_FACTOR * part_rows:
        yield log
        return
    begin = 0
    part = 1
    is_last = False
    while not is_last:
        is_last = len(stamps) - begin <= LAST_PART_FACTOR * part_rows
        end = len(stamps) if is_last else begin + part_rows
        period = stamps[begin], stamps[end - 1]
        columns = {name: _select_period(column, *period) for name, column in log.columns.items()}
        yield replace(log, name=f"{log.name}-part-{part}", columns=columns)
        begin = end - round(PART_OVERLAP_SHARE * part_rows)
        part = part + 1


def _select_period(column: Column, begin_s: float, end_s: float) -> Column:
    """The rows of a column in a period, s, and the last row before it if none is at its begin."""
    first = max(int(np.searchsorted(column.t_s, begin_s, side="right")) - 1, 0)
    end_row = int(np.searchsorted(column.t_s, end_s, side="right"))
    return Column(column.t_s[first:end_row], column.values[first:end_row], column.note)


def check_exists(path: Path) -> None:
    """Raise BadInput if there is no log, or only a pointer to one (`check_is_log_itself`)."""
    if not path.exists():
        raise refusal(path, "no such file or folder", "a recorded flight")
    check_is_log_itself(path)


def check_is_log_itself(path: Path) -> None:
    """Raise BadInput for a pointer: the few bytes in a repository that stand for a large file in another
    store."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(_POINTER_BYTES)
    for pattern, (store, command) in _LARGE_FILE_STORES.items():
        if re.match(pattern, head):
            raise refusal(
                path,
                f"is a pointer of a large-file store ({store}), not the log",
                f"the log itself, which `{command}` fetches",
            )


def reader_name_for_path(path: Path) -> str:
    """The name of the reader for a path, by its form. Raises BadInput if there is none."""
    if path.is_dir():
        return "alfa"
    if path.suffix.lower() in _WAYS_TO_TABLE:
        raise BadInput(f"{path}: is {_WAYS_TO_TABLE[path.suffix.lower()]}")
    name = _READER_OF_SUFFIX.get(path.suffix.lower())
    if name is None:
        raise refusal(
            path,
            "what kind of log this is cannot be seen",
            f"{', '.join(sorted(_READER_OF_SUFFIX))}, or --reader {', '.join(READERS)}",
        )
    return name
