"""Read a log without a vehicle file: its time, and the columns that may be quantities or commands."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.known_quantities import TIME_PATTERN, likely_columns, plain_form
from beaver_ftc_logs.mixing import Mixing, mixing_of_log
from beaver_ftc_logs.readers import (
    SELECTIVE_READERS,
    check_exists,
    read_flight,
    read_parts,
    reader_name_for_path,
)
from beaver_ftc_logs.readers.table import (
    TIME_COLUMN,
    column_names,
    first_cells_of_column,
    text_of_column_phrase,
)
from beaver_ftc_logs.recording import RecordedFlight, TimeSource, nearest_names_text
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.rotorcraft import VTOL_MODE
from beaver_ftc_logs.time_base import median_step_s
from beaver_ftc_logs.units import TIME_UNITS

_MAX_READ_COLUMNS = 60  # of a table with more likely columns, only the first are read
_LOG_STEPS_S = (1.0 / 2000.0, 1.0 / 4.0)  # shortest and longest usual step of a log


class LikelyLog(NamedTuple):
    """A log with the columns that may be quantities or commands; of a long table, only the first part.

    time: column and unit of the time, None for the column `t_s` in seconds. all_names: names of all columns.
    mixing: commands and surfaces by the parameters of the log, empty if it has none; `proposal` adds
    commands by their names.
    """

    reader: str
    time: TimeSource | None
    log: RecordedFlight
    all_names: list[str]
    mixing: Mixing

    @property
    def remarks(self) -> list[str]:
        """Lines on an unusual time, or on the mixing."""
        if self.time:
            return [f"time is in column {self.time[0]}, its steps fit {self.time[1]}"]
        return self.mixing.lines


def read_likely(path: Path, reader: str | None) -> LikelyLog:
    """Read a log. Raises BadInput if it cannot be read, or if a table has no time."""
    check_exists(path)
    reader = reader or reader_name_for_path(path)
    if reader in SELECTIVE_READERS:
        log = read_flight(path, reader, columns=())
        names = list(log.columns)
        mixing = mixing_of_log(reader, log.parameters, names)
        wanted = [*likely_columns(names), *mixing.entry_by_column, *({VTOL_MODE} & {*names})]
        log = read_flight(path, reader, columns=wanted)
        return LikelyLog(reader, None, log, names, mixing)
    time = columns = None
    if reader == "table":
        columns = likely_columns(column_names(path))[:_MAX_READ_COLUMNS]
        time = _find_time(path)
    log = next(read_parts(path, reader, time, columns))
    return LikelyLog(reader, time, log, list(log.columns), Mixing())


def _find_time(path: Path) -> TimeSource | None:
    """The time column of a table and its unit, None for the column `t_s` in seconds, which is tried first.
    Raises BadInput where the usual step of no column is that of a log (_LOG_STEPS_S) in any unit.

    If several units fit, the one at the end of the column's name is taken, otherwise the first in TIME_UNITS.
    """
    names = column_names(path)
    time_names = [name for name in names if re.fullmatch(TIME_PATTERN, plain_form(name))]
    phrases: list[str] = []
    for name in sorted(time_names, key=lambda name: name != TIME_COLUMN):
        cells = first_cells_of_column(path, name)
        stamps = cells.numbers.get(name, np.empty(0))  # none in a table whose times are dates
        stamps = stamps[np.isfinite(stamps)]
        if phrase := text_of_column_phrase(cells, name):
            phrases.append(f"{name} holds {phrase.removeprefix(', but ')}")
        step = median_step_s(stamps)
        (shortest_s, longest_s) = _LOG_STEPS_S
        units = [unit for unit, seconds in TIME_UNITS.items() if shortest_s <= step * seconds <= longest_s]
        if units:
            unit = next((unit for unit in units if plain_form(name).endswith(unit)), units[0])
            return None if (name, unit) == (TIME_COLUMN, "s") else (name, unit)
    allowed = f"a table with {TIME_COLUMN} in seconds, or another time that increases"
    phrase = f" ({'; '.join(phrases)})" if phrases else ""
    nearest = nearest_names_text(TIME_COLUMN, names)
    raise refusal(path, f"no column of time{phrase}", f"{allowed}; it has {nearest}")
