"""A flight of the ALFA data set in its processed form: a folder of CSV files, one a topic [ALFA2021].

The diagnosis reads what is upstream of the frozen output: commanded and measured roll and pitch
(`mavros-nav_info-*`), never `mavros-rc-out`, whose failed channel stands still from the fault on. The outputs
are read for the freeze rule of the benchmark alone.

Time counts from the first row of `mavros-imu-data_raw`. A fault begins at the first row of a
`failure_status-*` topic.
"""

import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers.table import read_numbers
from beaver_ftc_logs.recording import Column, Event, Floats, Recording, in_order

_NS = 1e-9
_TIME = "%time"
_RAW = "mavros-imu-data_raw"
_STATUS = "failure_status-"

Table = dict[str, Floats]


def _microseconds(values: Floats) -> Floats:
    """Pulse width about its neutral, as a share of the half range of 400 us."""
    return (values - 1500.0) / 400.0


_FROM: dict[str, Callable[[Floats], Floats]] = {"": np.asarray, "deg": np.deg2rad, "us": _microseconds}


@cache
def _known() -> dict[str, dict[str, Any]]:
    """columns: of each its topic, its field and the unit there, empty for the column's own; failures: of a
    status' part and code, what has failed."""
    found: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_name("alfa.json").read_text("utf-8"))
    return found


def read(path: Path) -> Recording:
    """The flight in a folder of topics. Raises BadInput if it has none of the gyro."""
    if not path.is_dir():
        raise BadInput(f"{path}: is a file, allowed: a folder of the ALFA data set's processed CSV files")
    topics = dict(_topics(path))
    if _RAW not in topics:
        raise BadInput(f"{path}: no {_RAW} topic, allowed: a processed folder of the ALFA data set")
    ordered = {topic: in_order(topic, table[_TIME]) for topic, table in topics.items()}
    origin_ns = float(topics[_RAW][_TIME][ordered[_RAW][0][0]])
    columns = dict(_columns(topics, ordered, origin_ns))
    _add_errors(columns)
    _add_airspeed(columns)
    events = sorted(_events(topics, origin_ns), key=lambda event: event.t_s)
    return Recording(path.name, columns, tuple(events))


def _topics(path: Path) -> Iterator[tuple[str, Table]]:
    wanted = {topic for topic, _, _ in _known()["columns"].values()}
    for file in sorted(path.glob("*.csv")):
        topic = file.stem.removeprefix(path.name).removeprefix("-")
        if topic in wanted or topic.startswith(_STATUS):
            table = read_numbers(file)
            if np.isfinite(table.get(_TIME, np.empty(0))).any():
                yield topic, table


def _columns(
    topics: dict[str, Table], ordered: dict[str, tuple[NDArray[np.int64], str]], origin_ns: float
) -> Iterator[tuple[str, Column]]:
    for name, (topic, field, unit) in _known()["columns"].items():
        if field in topics.get(topic, {}):
            kept, note = ordered[topic]
            t_s = (topics[topic][_TIME][kept] - origin_ns) * _NS
            yield name, Column(t_s, _FROM[unit](topics[topic][field])[kept], note)


def _add_errors(columns: dict[str, Column]) -> None:
    """Commanded less measured attitude, rad: the demand on the surfaces, upstream of what froze."""
    for axis in ("roll", "pitch"):
        command, measured = columns.get(f"{axis}_command_rad"), columns.get(f"{axis}_rad")
        if command is not None and measured is not None:
            columns[f"{axis}_error_rad"] = Column(command.t_s, command.values - measured.values, command.note)


def _add_airspeed(columns: dict[str, Column]) -> None:
    """Ground speed less the wind last estimated, m/s: most flights have no airspeed of their own."""
    names = [f"{what}_{to}_m_s" for to in ("north", "east") for what in ("ground", "wind")]
    if any(name not in columns or not len(columns[name].t_s) for name in names):
        return
    stamps = columns[names[0]].t_s

    def held(name: str) -> Floats:
        column = columns[name]
        return column.values[np.maximum(np.searchsorted(column.t_s, stamps, side="right") - 1, 0)]

    north, east = (held(names[i]) - held(names[i + 1]) for i in (0, 2))
    columns["airspeed_by_wind_m_s"] = Column(stamps, np.hypot(north, east))


def _events(topics: dict[str, Table], origin_ns: float) -> Iterator[Event]:
    for topic, table in topics.items():
        if topic.startswith(_STATUS):
            part = topic.removeprefix(_STATUS)
            stamps = table[_TIME]
            codes = np.where(np.isfinite(stamps), table.get("field.data", np.nan), np.nan)
            for code in sorted(set(codes[np.isfinite(codes)])):
                first = int(np.argmax(codes == code))
                t_s = float((stamps[first] - origin_ns) * _NS)
                yield Event(t_s, _known()["failures"].get(f"{part} {int(code)}", part))
