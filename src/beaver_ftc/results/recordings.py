"""The log as a recorder on board would have written it: a table, a PX4 ULog or a dataflash log.

It has only what an autopilot records: rates with the errors of the gyros, attitude, flow and what else the
aircraft measures as perfect instruments have them, since the log has no other readings, and the commands to
the surfaces as shares of travel. `vehicle.yaml` beside it names the columns for `identify` and `diagnose`.

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
"""Fields of each message; every message has the stamps `t_s`."""
Stamps = NDArray[np.int64]
"""Time of each row, us."""
Names = dict[str, dict[str, str]]
"""By part and name, what a recording calls it."""
RECORDING_FILE_OF_KIND = {"table": "flight.csv", "ulog": "flight.ulg", "ardupilot": "flight.bin"}
# What each kind calls what it records, in its order: `topic.field`, or the column of a table. i: place from 0
# on, n: from 1 on.
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
        "rates": "IMU.Gyr{axis}", "commands": "SRFC.C{n}", "airspeed": "ARSP.Airspeed",
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
"""A clock on board does not start with the log."""
_ULOG_MAGIC = b"ULog\x01\x12\x35\x01"  # the last byte is the version
_DATAFLASH_HEAD = b"\xa3\x95"  # of each message, before the number of its type
_FMT = 128  # the type that describes types


def write_recording(
    log_path: Path, travel_rad: dict[str, float], kind: str, folder: Path, signals: Sequence[str]
) -> None:
    """Write a flight's log as `kind` (of RECORDING_FILE_OF_KIND) with its vehicle.yaml into a folder.

    travel_rad: the farther stop of each surface. signals: what the aircraft measures beside rates and flow.
    """
    source_of = {
        "rates": {axis: f"{axis}_measured_rad_s" for axis in AXES},
        "commands": {surface: f"{surface}_cmd_rad" for surface in travel_rad},
        "attitude": _COLUMN_OF_ANGLE,
        "airspeed": {"airspeed": "airspeed_mps"},
        "flow": {name: name for name in (*_FLOW_COLUMNS, *signals)},
    }
    wanted = {"t_s", *(column for part in source_of.values() for column in part.values())}
    known = log.StoredLog(log_path).read(list(wanted))
    named: Names = {}
    topics: ColumnsByTopic = {}
    for part, pattern in _NAMES_OF_KIND[kind].items():
        named[part] = {}
        for i, (name, column) in enumerate(source_of[part].items()):
            recorded = pattern.format(name=name, title=name.title(), i=i, n=i + 1, axis="XYZ"[i % 3])
            named[part][name] = recorded
            values = known[column]
            if part == "commands":
                values = values / travel_rad[name]
            elif part == "attitude" and kind == "ardupilot":
                values = np.rad2deg(values)
            topic, _, field = recorded.rpartition(".")
            topics.setdefault(topic, {})[field] = values
    t_us = np.round(known["t_s"] * 1e6).astype(np.int64) + _FIRST_STAMP_US
    _WRITER_OF_KIND[kind](folder / RECORDING_FILE_OF_KIND[kind], t_us, topics)
    (folder / "vehicle.yaml").write_text(_vehicle_file_text(named, travel_rad, kind), encoding="utf-8")


def _vehicle_file_text(named: Names, travel_rad: dict[str, float], kind: str) -> str:
    """The vehicle file: which column is what."""
    angle = "{{column: {}, unit: deg}}" if kind == "ardupilot" else "{!r}"
    commands = named["commands"]
    flow = named["flow"]
    return _VEHICLE_FILE.format(
        kind=kind,
        rates=_flow_mapping(named["rates"], "{!r}"),
        commands=", ".join(map(repr, commands.values())),
        attitude=_flow_mapping(named["attitude"], angle),
        airspeed=named["airspeed"]["airspeed"],
        surfaces="\n".join(f"  {surface}: {{{command!r}: 1.0}}" for surface, command in commands.items()),
        stops=_flow_mapping(travel_rad, "{!r}"),
        signals=", ".join(column for name, column in flow.items() if name != _DYNAMIC_PRESSURE_COLUMN),
        flow=_flow_mapping(flow, "{}"),
    )


def _flow_mapping(entries: Mapping[str, object], form: str) -> str:
    """A mapping of YAML in one line."""
    return f"{{{', '.join(f'{key}: {form.format(value)}' for key, value in entries.items())}}}"


def _write_table(path: Path, t_us: Stamps, topics: ColumnsByTopic) -> None:
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
        of_topic = np.uint16(number).tobytes()
        head.append(_ulog_message("A", b"\x00" + of_topic + topic.encode()))
        length = np.uint16(10 + 8 * len(fields)).tobytes()  # of number, stamp and fields
        packed.append(_packed_messages(length + b"D" + of_topic, t_us, fields))
    path.write_bytes(b"".join(head) + _interleave_messages(packed))


def _ulog_field_declarations(fields: Sequence[str]) -> str:
    """Fields of one format; `xyz[0]`, `xyz[1]`, ... are one array."""
    arrays = Counter(field.partition("[")[0] for field in fields)
    return "".join(
        f"double[{count}] {name};" if f"{name}[0]" in fields else f"double {name};"
        for name, count in arrays.items()
    )


def _ulog_message(kind: str, body: bytes) -> bytes:
    return np.uint16(len(body)).tobytes() + kind.encode() + body


def _write_dataflash(path: Path, t_us: Stamps, topics: ColumnsByTopic) -> None:
    """FMT messages (the first describes FMT itself), then every message in the order of time."""
    head = [_dataflash_fmt_message(_FMT, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    packed = []
    for number, (name, fields) in enumerate(topics.items(), start=140):  # above that of FMT
        rows = _packed_messages(bytes([*_DATAFLASH_HEAD, number]), t_us, fields)
        layout, labels = "Q" + "d" * len(fields), ",".join(["TimeUS", *fields])
        head.append(_dataflash_fmt_message(number, rows.dtype.itemsize, name, layout, labels))
        packed.append(rows)
    path.write_bytes(b"".join(head) + _interleave_messages(packed))


def _dataflash_fmt_message(number: int, length: int, name: str, layout: str, labels: str) -> bytes:
    """One FMT message, 89 bytes."""
    padded = (text.encode().ljust(size, b"\0") for text, size in ((name, 4), (layout, 16), (labels, 64)))
    return bytes([*_DATAFLASH_HEAD, _FMT, number, length]) + b"".join(padded)


def _packed_messages(head: bytes, t_us: Stamps, fields: log.Values) -> np.ndarray:
    """The messages of one topic: each its head, the stamp, and the fields as doubles."""
    layout = [("head", "u1", (len(head),)), ("t", "<u8"), ("v", "<f8", (len(fields),))]
    rows = np.zeros(len(t_us), dtype=layout)
    rows["head"] = list(head)
    rows["t"] = t_us
    rows["v"] = np.column_stack(list(fields.values()))
    return rows


def _interleave_messages(topics: Sequence[np.ndarray]) -> bytes:
    """Records of several topics, one of each a stamp."""
    rows = [topic.view(np.uint8).reshape(len(topic), -1) for topic in topics]
    return np.hstack(rows).tobytes()


_WRITER_OF_KIND: dict[str, Callable[[Path, Stamps, ColumnsByTopic], None]] = {
    "table": _write_table, "ulog": _write_ulog, "ardupilot": _write_dataflash,
}  # fmt: skip
