"""The log for other tools: as CSV, as a flight recording for Tacview, and as a recorder on board would have
written it, which is a table, a PX4 ULog or a dataflash log.

Of the last, only what an autopilot records: rates with the errors of the gyros, attitude, flow and what else
the aircraft measures as perfect instruments have them, since the log has no other readings, and the commands
to the surfaces as shares of travel. `vehicle.yaml` beside it names the columns for `identify` and `diagnose`.

ULog: https://docs.px4.io/main/en/dev_log/ulog_file_format; dataflash: FMT messages, then packed ones.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from math import ceil, cos, degrees, radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.aircraft import AXES, Aircraft, load
from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M
from beaver_ftc.plant.adapter import START_LATITUDE_DEG
from beaver_ftc.results import log
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.results.style import marks

ACMI_RATE_HZ = 25.0  # smooth to look at; a viewer interpolates
FLAP = "flap"  # a surface of this name is shown as a share of its travel
_FLAP_COLUMN = "flap_pos_rad"
# Any time will do as reference; it is the same for every run, so that runs overlay.
_ACMI_HEAD = """\
FileType=text/acmi/tacview
FileVersion=2.2
0,ReferenceTime=2005-06-27T12:00:00Z
0,DataSource=JSBSim
0,DataRecorder=beaver-ftc
0,Title={scenario}
b1,Type=Air+FixedWing,Name={aircraft},Color=Blue
"""
# Longitude, latitude (deg), altitude (m), roll, pitch, yaw (deg); air data (m/s, deg).
_ACMI_FRAME = (
    "#{t_s:.3f}\n"
    "b1,T={longitude:.8f}|{latitude:.8f}|{altitude_m:.3f}|{phi_deg:.3f}|{theta_deg:.3f}|{psi_deg:.3f},"
    "TAS={airspeed_mps:.3f},AOA={alpha_deg:.3f},AOS={beta_deg:.3f}{flaps}\n"
)
_ACMI_COLUMNS = (
    "t_s", "north_m", "east_m", "altitude_m", "phi_rad", "theta_rad", "psi_rad",
    "airspeed_mps", "alpha_rad", "beta_rad",
)  # fmt: skip

ColumnsByTopic = dict[str, log.Values]
"""Fields of each message; every message has the stamps `t_s`."""
Stamps = NDArray[np.int64]
"""Time of each row, us."""
Exports = dict[str, Callable[[], None]]
"""By the name of an export the function that writes it."""

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


def exports_of(
    folder: Path, aircraft: Aircraft, document: Document, kinds: Collection[str], recording: str | None
) -> Exports:
    """By its name, the function that writes each export of a result folder that has its log.

    document: the metrics, empty if there are none: then there is no ACMI. kinds: of "csv" and "acmi".
    recording: of RECORDING_FILE_OF_KIND.
    """
    log_path = folder / "log.parquet"
    exports: Exports = {}
    if "csv" in kinds:
        exports["log.csv"] = partial(write_csv, log_path, folder / "log.csv")
    if "acmi" in kinds and document:
        to = folder / "flight.acmi"
        exports["flight.acmi"] = partial(write_acmi, log_path, Metrics.of(document), to, aircraft)
    if recording is not None:
        stops_rad = {s: max(abs(at.min_rad), abs(at.max_rad)) for s, at in aircraft.travel.items()}
        exports[f"the recording ({recording})"] = partial(
            write_recording, log_path, stops_rad, recording, folder, tuple(aircraft.signals)
        )
    return exports


def write_csv(log_path: Path, path: Path) -> None:
    """The log as CSV: one header line with the columns' names, then a line a frame."""
    from pyarrow.csv import CSVWriter, WriteOptions

    # pyarrow quotes the names in its header whatever it is told: ours is written by hand
    options = WriteOptions(include_header=False, quoting_style="none")
    with log.open_parquet_log(log_path) as source:
        schema = source.schema_arrow
        with path.open("wb") as file:
            file.write((",".join(schema.names) + "\n").encode())
            with CSVWriter(file, schema, write_options=options) as writer:
                for group in range(source.num_row_groups):
                    writer.write_table(source.read_row_group(group))


def write_acmi(log_path: Path, metrics: Metrics, path: Path, aircraft: Aircraft | None = None) -> None:
    """The flight as a Tacview recording (ACMI 2.2): path, attitude, air data, flap, bookmarks for events."""
    aircraft = aircraft or load()
    title = aircraft.file.description.partition(",")[0] or aircraft.name
    names = {"scenario": _escape_acmi_text(metrics.scenario), "aircraft": _escape_acmi_text(title)}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_ACMI_HEAD.format(**names))
        file.writelines(_acmi_frames(log_path, metrics, aircraft))


def _escape_acmi_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace(",", "\\,").replace("\n", " ")


def _acmi_frames(log_path: Path, metrics: Metrics, aircraft: Aircraft) -> Iterator[str]:
    """A frame of the recording at ACMI_RATE_HZ at most, each event in the first frame not before it."""
    events = sorted(marks(metrics), key=lambda mark: mark.time_s)
    full_rad = None
    if FLAP in aircraft.surfaces:
        full_rad = aircraft.travel[FLAP].max_rad or aircraft.travel[FLAP].min_rad
    columns = _ACMI_COLUMNS if full_rad is None else (*_ACMI_COLUMNS, _FLAP_COLUMN)
    radius_m = 0.0
    flaps = ""
    for row in _rows_at_acmi_rate(log.StoredLog(log_path), columns):
        radius_m = radius_m or EARTH_RADIUS_M + row["altitude_m"]  # of the first
        latitude = START_LATITUDE_DEG + degrees(row["north_m"] / radius_m)
        longitude = degrees(row["east_m"] / (radius_m * cos(radians(START_LATITUDE_DEG))))
        angles = {name.replace("_rad", "_deg"): degrees(row[name]) for name in row if name.endswith("_rad")}
        if full_rad is not None:
            flaps = f",Flaps={row[_FLAP_COLUMN] / full_rad:.4f}"
        yield _ACMI_FRAME.format(**row, **angles, latitude=latitude, longitude=longitude, flaps=flaps)
        while events and events[0].time_s <= row["t_s"] + 1e-9:
            yield f"0,Event=Bookmark|b1|{_escape_acmi_text(events.pop(0).label)}\n"


def _rows_at_acmi_rate(source: log.Log, columns: tuple[str, ...]) -> Iterator[dict[str, float]]:
    every = max(1, ceil(1.0 / (ACMI_RATE_HZ * source.frame_s) - 1e-9))
    seen = 0
    for chunk in source.read_chunks(columns):
        rows = len(chunk["t_s"])
        for i in range(-seen % every, rows, every):
            yield {name: float(values[i]) for name, values in chunk.items()}
        seen += rows


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
    named: dict[str, dict[str, str]] = {}
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


def _vehicle_file_text(named: dict[str, dict[str, str]], travel_rad: dict[str, float], kind: str) -> str:
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
    """Definitions and subscriptions, then every message in the order of time."""
    head = [b"ULog\x01\x12\x35\x01" + np.uint64(t_us[0]).tobytes()]
    for topic, fields in topics.items():
        layout = f"{topic}:uint64_t timestamp;{_ulog_field_declarations(list(fields))}"
        head.append(_ulog_message("F", layout.encode()))
    packed = []
    for number, (topic, fields) in enumerate(topics.items()):
        of_topic = np.uint16(number).tobytes()
        head.append(_ulog_message("A", b"\x00" + of_topic + topic.encode()))
        length = np.uint16(10 + 8 * len(fields)).tobytes()
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
    head = [_dataflash_fmt_message(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    packed = []
    for number, (name, fields) in enumerate(topics.items(), start=140):
        rows = _packed_messages(bytes([0xA3, 0x95, number]), t_us, fields)
        layout, labels = "Q" + "d" * len(fields), ",".join(["TimeUS", *fields])
        head.append(_dataflash_fmt_message(number, rows.dtype.itemsize, name, layout, labels))
        packed.append(rows)
    path.write_bytes(b"".join(head) + _interleave_messages(packed))


def _dataflash_fmt_message(number: int, length: int, name: str, layout: str, labels: str) -> bytes:
    """One FMT message, 89 bytes."""
    padded = (text.encode().ljust(size, b"\0") for text, size in ((name, 4), (layout, 16), (labels, 64)))
    return bytes([0xA3, 0x95, 128, number, length]) + b"".join(padded)


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
