"""The log as a recorder on board would have written it: a table, a PX4 ULog or a dataflash log.

A recording has only the signals that an autopilot records. The rates have the errors of the gyros. Attitude,
flow and other signals of the aircraft are exact, since the log has no measured ones. Commands to the surfaces
are shares of travel. The file `vehicle.yaml` names the columns for `identify` and `diagnose`.

ULog: https://docs.px4.io/main/en/dev_log/ulog_file_format; dataflash: FMT messages, then packed ones.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.aircraft import AXES
from beaver_ftc.results import log

ColumnsByTopic = dict[str, log.Values]
"""By topic, the fields of its messages; the stamps of the messages are in `Stamps`."""
Stamps = NDArray[np.int64]
"""Time of each row, us."""
Names = dict[str, dict[str, str]]
"""By part (`rates`, `commands`, ...) and name of a signal, its name in the recording."""
RECORDING_FILE_OF_KIND = {"table": "flight.csv", "ulog": "flight.ulg", "ardupilot": "flight.bin"}
_MOST_FIELDS = 15  # fields of a dataflash message beside its stamp: its layout has 16 bytes
# By kind and part, the pattern of the names: `topic.field`, or the column of a table. In a pattern, i counts
# the signals of the part from 0 on. The commands of _MOST_FIELDS surfaces are in the dataflash message SRFC,
# those of further ones in SRFD; n counts the fields of each message from 1 on.
_NAMES_OF_KIND = {
    "table": {
        "rates": "{name}_rad_s", "commands": "{name}_command", "attitude": "{name}_rad",
        "airspeed": "airspeed_mps", "flow": "{name}",
    },
    "ulog": {
        "rates": "vehicle_angular_velocity.xyz[{i}]", "commands": "actuator_servos.control[{i}]",
        "airspeed": "airspeed.true_airspeed_m_s", "attitude": "attitude.{name}_rad", "flow": "flow.{name}",
    },
    "ardupilot": {
        "rates": "IMU.Gyr{axis}", "commands": "SRF{letter}.C{n}", "airspeed": "ARSP.Airspeed",
        "attitude": "ATT.{title}", "flow": "FL{i}.V",
    },
}  # fmt: skip
_VEHICLE_FILE = """\
# Written with the log beside it: which column is what. Commands are shares of travel.
name: {kind}-of-a-simulated-flight
reader: {kind}
rates: {rates}
commands: [{commands}]
attitude: {attitude}
airspeed: {airspeed!r}
surfaces:
{surfaces}
full_deflection_rad: {stops}
signals: [{signals}]
flow: {flow}
"""
_COLUMN_OF_ANGLE = {"roll": "phi_rad", "pitch": "theta_rad", "yaw": "psi_rad"}
_DYNAMIC_PRESSURE_COLUMN = "qdyn_pa"
_FLOW_COLUMNS = ("alpha_rad", "beta_rad", _DYNAMIC_PRESSURE_COLUMN)
_FIRST_STAMP_US = 1_000_000
"""Time of the first row: a clock on board runs before the log starts."""
_ULOG_MAGIC = b"ULog\x01\x12\x35\x01"  # the last byte is the version
_DATAFLASH_HEAD = b"\xa3\x95"  # first bytes of each message; the number of its type follows
_FMT = 128  # type of the FMT messages, which describe the other types


def write_recording(
    log_path: Path, travel_rad: dict[str, float], kind: str, folder: Path, signals: Sequence[str]
) -> None:
    """Write the log of a flight as `kind` (of RECORDING_FILE_OF_KIND) with its vehicle.yaml into a folder.

    travel_rad: the farther stop of each surface; a command of 1 is this deflection. signals: what the
    aircraft measures beside rates and flow.
    """
    source_of = {
        "rates": {axis: f"{axis}_measured_rad_s" for axis in AXES},
        "commands": {surface: f"{surface}_cmd_rad" for surface in travel_rad},
        "attitude": _COLUMN_OF_ANGLE,
        "airspeed": {"airspeed": "airspeed_mps"},
        "flow": {name: name for name in (*_FLOW_COLUMNS, *signals)},
    }
    columns = {"t_s", *(column for part in source_of.values() for column in part.values())}
    series = log.StoredLog(log_path).read(list(columns))
    names: Names = {}
    topics: ColumnsByTopic = {}
    for part, pattern in _NAMES_OF_KIND[kind].items():
        names[part] = {}
        for i, (name, column) in enumerate(source_of[part].items()):
            recorded = pattern.format(
                name=name, title=name.title(), axis="XYZ"[i % 3], i=i, n=i % _MOST_FIELDS + 1,
                letter="CD"[i // _MOST_FIELDS],
            )  # fmt: skip
            names[part][name] = recorded
            values = series[column]
            if part == "commands":
                values = values / travel_rad[name]
            elif part == "attitude" and kind == "ardupilot":
                values = np.rad2deg(values)
            topic, _, field = recorded.rpartition(".")
            topics.setdefault(topic, {})[field] = values
    t_us = np.round(series["t_s"] * 1e6).astype(np.int64) + _FIRST_STAMP_US
    _WRITER_OF_KIND[kind](folder / RECORDING_FILE_OF_KIND[kind], t_us, topics)
    (folder / "vehicle.yaml").write_text(_vehicle_file_text(names, travel_rad, kind), encoding="utf-8")


def _vehicle_file_text(names: Names, travel_rad: dict[str, float], kind: str) -> str:
    """The text of vehicle.yaml. The attitude of a dataflash log is in deg, all other angles are in rad."""
    angle = "{{column: {}, unit: deg}}" if kind == "ardupilot" else "{!r}"
    commands = names["commands"]
    flow = names["flow"]
    return _VEHICLE_FILE.format(
        kind=kind,
        rates=_flow_mapping(names["rates"], "{!r}"),
        commands=", ".join(map(repr, commands.values())),
        attitude=_flow_mapping(names["attitude"], angle),
        airspeed=names["airspeed"]["airspeed"],
        surfaces="\n".join(f"  {surface}: {{{command!r}: 1.0}}" for surface, command in commands.items()),
        stops=_flow_mapping(travel_rad, "{!r}"),
        signals=", ".join(column for name, column in flow.items() if name != _DYNAMIC_PRESSURE_COLUMN),
        flow=_flow_mapping(flow, "{}"),
    )


def _flow_mapping(entries: Mapping[str, object], form: str) -> str:
    """A mapping of YAML in one line."""
    return f"{{{', '.join(f'{key}: {form.format(value)}' for key, value in entries.items())}}}"


def _write_table(path: Path, t_us: Stamps, topics: ColumnsByTopic) -> None:
    """A CSV file; its columns are `t_s`, s, and the fields of the one topic without a name."""
    import pyarrow as pa
    from pyarrow import csv

    csv.write_csv(pa.table({"t_s": (t_us - _FIRST_STAMP_US) * 1e-6, **topics[""]}), path)


def _write_ulog(path: Path, t_us: Stamps, topics: ColumnsByTopic) -> None:
    """Definitions (F) and subscriptions (A), then every message (D) in the order of time."""
    head = [_ULOG_MAGIC + np.uint64(t_us[0]).tobytes()]
    for topic, fields in topics.items():
        layout = f"{topic}:uint64_t timestamp;{_ulog_field_declarations(list(fields))}"
        head.append(_ulog_message("F", layout.encode()))
    packed = []
    for number, (topic, fields) in enumerate(topics.items()):
        number_bytes = np.uint16(number).tobytes()
        head.append(_ulog_message("A", b"\x00" + number_bytes + topic.encode()))
        length = np.uint16(10 + 8 * len(fields)).tobytes()  # bytes: number 2, stamp 8, each field 8
        packed.append(_packed_messages(length + b"D" + number_bytes, t_us, fields))
    path.write_bytes(b"".join(head) + _interleave_messages(packed))


def _ulog_field_declarations(fields: Sequence[str]) -> str:
    """Declarations of the fields of a topic; `xyz[0]`, `xyz[1]`, ... are one array."""
    arrays = Counter(field.partition("[")[0] for field in fields)
    return "".join(
        f"double[{count}] {name};" if f"{name}[0]" in fields else f"double {name};"
        for name, count in arrays.items()
    )


def _ulog_message(kind: str, body: bytes) -> bytes:
    """A ULog message: length of the body, kind, body."""
    return np.uint16(len(body)).tobytes() + kind.encode() + body


def _write_dataflash(path: Path, t_us: Stamps, topics: ColumnsByTopic) -> None:
    """FMT messages (the first describes FMT itself), then every message in the order of time."""
    head = [_dataflash_fmt_message(_FMT, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    packed = []
    for type_number, (name, fields) in enumerate(topics.items(), start=140):  # above 128, the number of FMT
        rows = _packed_messages(bytes([*_DATAFLASH_HEAD, type_number]), t_us, fields)
        layout, labels = "Q" + "d" * len(fields), ",".join(["TimeUS", *fields])
        head.append(_dataflash_fmt_message(type_number, rows.dtype.itemsize, name, layout, labels))
        packed.append(rows)
    path.write_bytes(b"".join(head) + _interleave_messages(packed))


def _dataflash_fmt_message(number: int, length: int, name: str, layout: str, labels: str) -> bytes:
    """One FMT message, 89 bytes; name, layout and labels have at most 4, 16 and 64 bytes."""
    padded = (text.encode().ljust(size, b"\0") for text, size in ((name, 4), (layout, 16), (labels, 64)))
    return bytes([*_DATAFLASH_HEAD, _FMT, number, length]) + b"".join(padded)


def _packed_messages(head: bytes, t_us: Stamps, fields: log.Values) -> np.ndarray:
    """The messages of one topic, a structured array (rows,): head, stamp (us), and the fields as doubles."""
    layout = [("head", "u1", (len(head),)), ("t", "<u8"), ("v", "<f8", (len(fields),))]
    rows = np.zeros(len(t_us), dtype=layout)
    rows["head"] = list(head)
    rows["t"] = t_us
    rows["v"] = np.column_stack(list(fields.values()))
    return rows


def _interleave_messages(topics: Sequence[np.ndarray]) -> bytes:
    """The bytes of the messages of several topics in the order of time: each row has one message of each
    topic."""
    rows = [topic.view(np.uint8).reshape(len(topic), -1) for topic in topics]
    return np.hstack(rows).tobytes()


_WRITER_OF_KIND: dict[str, Callable[[Path, Stamps, ColumnsByTopic], None]] = {
    "table": _write_table, "ulog": _write_ulog, "ardupilot": _write_dataflash,
}  # fmt: skip
