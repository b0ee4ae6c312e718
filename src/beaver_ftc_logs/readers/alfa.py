"""A flight of the ALFA data set in its processed form: a folder of CSV files, one a topic [ALFA2021].

The diagnosis reads the commanded and the measured roll and pitch (`mavros-nav_info-*`), which are upstream of
a frozen output. It never reads `mavros-rc-out`, whose failed channel stands still from the fault on. The
outputs are read only for the freeze rule of the benchmark.

Time counts from the first row of `mavros-imu-data_raw`. A fault begins at the first row of a
`failure_status-*` topic that has its code.
"""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import read_json
from beaver_ftc_logs.readers.table import read_numbers
from beaver_ftc_logs.readers.topics import rows_with_increasing_time
from beaver_ftc_logs.recording import Column, Columns, Floats, Ints, LoggedFailure, RecordedFlight
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.time_base import latest_values
from beaver_ftc_logs.units import HALF_PULSE_RANGE_US, NEUTRAL_PULSE_US

_S_PER_NS = 1e-9
_TIME_FIELD = "%time"
_GYRO_TOPIC = "mavros-imu-data_raw"
_FAILURE_PREFIX = "failure_status-"

TopicTable = dict[str, Floats]


_CONVERSION_OF_UNIT: dict[str, Callable[[Floats], Floats]] = {
    "": np.asarray,
    "deg": np.deg2rad,
    "us": lambda us: (us - NEUTRAL_PULSE_US) / HALF_PULSE_RANGE_US,  # share of travel
}


@cache
def _alfa_names() -> dict[str, dict[str, Any]]:
    """The tables in alfa.json. columns: name of a column -> topic, field, and unit in the topic, empty if it
    is already that of the column. failures: part and code of a failure status -> name of the failed part.
    """
    return read_json(Path(__file__).with_name("alfa.json"))


def read(path: Path, _wanted: Any = None) -> RecordedFlight:
    """The flight in a folder of topics, with all its columns. Raises BadInput if it is no folder, or has no
    topic of the gyro.

    _wanted: every reader receives the columns that are wanted; this one reads all of its few topics.
    """
    if not path.is_dir():
        raise refusal(path, "is a file", "a folder of the ALFA data set's processed CSV files")
    tables = dict(_read_topic_tables(path))
    if _GYRO_TOPIC not in tables:
        raise refusal(path, f"no {_GYRO_TOPIC} topic", "a processed folder of the ALFA data set")
    kept = {topic: rows_with_increasing_time(topic, table[_TIME_FIELD]) for topic, table in tables.items()}
    zero_ns = float(tables[_GYRO_TOPIC][_TIME_FIELD][kept[_GYRO_TOPIC][0][0]])
    columns = dict(_read_columns(tables, kept, zero_ns))
    _add_attitude_errors(columns)
    _add_airspeed_from_wind(columns)
    failures = sorted(_failure_events(tables, zero_ns), key=lambda failure: failure.t_s)
    return RecordedFlight(path.name, columns, tuple(failures))


def _read_topic_tables(path: Path) -> Iterator[tuple[str, TopicTable]]:
    """Yield each topic with columns of alfa.json or a failure status, and its table, if it has a stamp."""
    wanted = {topic for topic, _, _ in _alfa_names()["columns"].values()}
    for file in sorted(path.glob("*.csv")):
        topic = file.stem.removeprefix(path.name).removeprefix("-")
        if topic in wanted or topic.startswith(_FAILURE_PREFIX):
            table = read_numbers(file)
            if np.isfinite(table.get(_TIME_FIELD, np.empty(0))).any():
                yield topic, table


def _read_columns(
    tables: dict[str, TopicTable], kept: dict[str, tuple[Ints, str]], zero_ns: float
) -> Iterator[tuple[str, Column]]:
    """Yield each column in our units; kept: for each topic the rows that are kept and a note."""
    for name, (topic, field, unit) in _alfa_names()["columns"].items():
        if field in tables.get(topic, {}):
            rows, note = kept[topic]
            t_s = (tables[topic][_TIME_FIELD][rows] - zero_ns) * _S_PER_NS
            yield (name, Column(t_s, _CONVERSION_OF_UNIT[unit](tables[topic][field])[rows], note))


def _add_attitude_errors(columns: Columns) -> None:
    """Add commanded less measured attitude, rad: the demand on the surfaces, upstream of a frozen output."""
    for axis in ("roll", "pitch"):
        command = columns.get(f"{axis}_command_rad")
        measured = columns.get(f"{axis}_rad")
        if command is not None and measured is not None:
            columns[f"{axis}_error_rad"] = Column(command.t_s, command.values - measured.values, command.note)


def _add_airspeed_from_wind(columns: Columns) -> None:
    """Add the magnitude of ground speed less the last estimate of the wind, m/s, nan before the first
    estimate: most flights have no measured airspeed.
    """
    directions = ("north", "east")
    names = [f"{vector}_{direction}_m_s" for direction in directions for vector in ("ground", "wind")]
    if any(name not in columns or not len(columns[name].t_s) for name in names):
        return
    stamps = columns[names[0]].t_s

    def held(name: str) -> Floats:
        """The last value of a component, m/s, at each stamp."""
        column = columns[f"{name}_m_s"]
        return latest_values(stamps, column.t_s, column.values)

    north, east = (held(f"ground_{direction}") - held(f"wind_{direction}") for direction in directions)
    columns["airspeed_by_wind_m_s"] = Column(stamps, np.hypot(north, east))


def _failure_events(tables: dict[str, TopicTable], zero_ns: float) -> Iterator[LoggedFailure]:
    """Each failure that a status states, at the first row with its code."""
    for topic, table in tables.items():
        if topic.startswith(_FAILURE_PREFIX):
            part = topic.removeprefix(_FAILURE_PREFIX)
            stamps = table[_TIME_FIELD]
            codes = np.where(np.isfinite(stamps), table.get("field.data", np.nan), np.nan)
            for code in sorted(set(codes[np.isfinite(codes)])):
                first = int(np.argmax(codes == code))
                t_s = float((stamps[first] - zero_ns) * _S_PER_NS)
                yield LoggedFailure(t_s, _alfa_names()["failures"].get(f"{part} {int(code)}", part))
