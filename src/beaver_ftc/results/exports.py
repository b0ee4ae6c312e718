"""The log for other tools: as CSV, as a flight recording for Tacview, and as a recorder on board writes
it."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from math import ceil, cos, degrees, radians
from pathlib import Path

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M
from beaver_ftc.plant.adapter import START_LATITUDE_DEG
from beaver_ftc.results import log
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.results.recordings import write_recording
from beaver_ftc.results.style import marks

ACMI_RATE_HZ = 25.0  # at most so many frames in a second of the recording: a viewer interpolates
FLAP = "flap"  # a surface of this name is recorded as a share of its full deflection
_FLAP_COLUMN = "flap_pos_rad"
# The reference time is arbitrary. All runs have the same one, so that a viewer can overlay them.
_ACMI_HEAD = """\
FileType=text/acmi/tacview
FileVersion=2.2
0,ReferenceTime=2005-06-27T12:00:00Z
0,DataSource=JSBSim
0,DataRecorder=beaver-ftc
0,Title={scenario}
b1,Type=Air+FixedWing,Name={aircraft},Color=Blue
"""
# A frame: longitude, latitude (deg), altitude (m), roll, pitch, yaw (deg); air data (m/s, deg).
_ACMI_FRAME = (
    "#{t_s:.3f}\n"
    "b1,T={longitude:.8f}|{latitude:.8f}|{altitude_m:.3f}|{phi_deg:.3f}|{theta_deg:.3f}|{psi_deg:.3f},"
    "TAS={airspeed_mps:.3f},AOA={alpha_deg:.3f},AOS={beta_deg:.3f}{flaps}\n"
)
_ACMI_COLUMNS = (
    "t_s", "north_m", "east_m", "altitude_m", "phi_rad", "theta_rad", "psi_rad",
    "airspeed_mps", "alpha_rad", "beta_rad",
)  # fmt: skip

Exports = dict[str, Callable[[], None]]
"""By the name of an export the function that writes it."""


def exports_of(
    folder: Path, aircraft: Aircraft, document: Document, kinds: Collection[str], recording: str | None
) -> Exports:
    """By the name of each export, the function that writes it. The result folder has its log.

    document: the metrics; if it is empty, ACMI is left out. kinds: any of "csv" and "acmi". recording: a key
    of `RECORDING_FILE_OF_KIND` in recordings.py; None for no recording.
    """
    log_path = folder / "log.parquet"
    exports: Exports = {}
    if "csv" in kinds:
        exports["log.csv"] = partial(write_csv, log_path, folder / "log.csv")
    if "acmi" in kinds and document:
        to = folder / "flight.acmi"
        exports["flight.acmi"] = lambda: write_acmi(log_path, Metrics.of(document), to, aircraft)
    if recording is not None:
        stops_rad = {s: max(abs(at.min_rad), abs(at.max_rad)) for s, at in aircraft.travel.items()}
        exports[f"the recording ({recording})"] = partial(
            write_recording, log_path, stops_rad, recording, folder, tuple(aircraft.signals)
        )
    return exports


def write_csv(log_path: Path, path: Path) -> None:
    """The log as CSV: one header line with the columns' names, then a line a frame."""
    from pyarrow.csv import CSVWriter, WriteOptions

    # pyarrow quotes the names in its header with any quoting style, so the header is written here
    options = WriteOptions(include_header=False, quoting_style="none")
    with log.open_parquet_log(log_path) as source:
        schema = source.schema_arrow
        with path.open("wb") as file:
            file.write((",".join(schema.names) + "\n").encode())
            with CSVWriter(file, schema, write_options=options) as writer:
                for group in range(source.num_row_groups):
                    writer.write_table(source.read_row_group(group))


def write_acmi(log_path: Path, metrics: Metrics, path: Path, aircraft: Aircraft) -> None:
    """The flight as a Tacview recording (ACMI 2.2): path, attitude, air data, flap, bookmarks for events."""
    title = aircraft.file.description.partition(",")[0] or aircraft.name
    names = {"scenario": _escape_acmi_text(metrics.scenario), "aircraft": _escape_acmi_text(title)}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_ACMI_HEAD.format(**names))
        file.writelines(_acmi_frames(log_path, metrics, aircraft))


def _escape_acmi_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace(",", "\\,").replace("\n", " ")


def _acmi_frames(log_path: Path, metrics: Metrics, aircraft: Aircraft) -> Iterator[str]:
    """The frames of the recording. An event stands behind the first recorded frame whose time is not before
    it.

    On a sphere about the centre of the Earth through the first frame, of radius R (m): latitude = latitude_0
    + north / R, longitude = east / (R cos(latitude_0)), both in rad.
    """
    events = sorted(marks(metrics), key=lambda mark: mark.time_s)
    full_flap_rad = None
    if FLAP in aircraft.surfaces:
        full_flap_rad = aircraft.travel[FLAP].max_rad or aircraft.travel[FLAP].min_rad
    columns = _ACMI_COLUMNS if full_flap_rad is None else (*_ACMI_COLUMNS, _FLAP_COLUMN)
    radius_m = 0.0
    flaps = ""
    for row in _rows_at_acmi_rate(log.StoredLog(log_path), columns):
        radius_m = radius_m or EARTH_RADIUS_M + row["altitude_m"]  # R, from the first row alone
        latitude = START_LATITUDE_DEG + degrees(row["north_m"] / radius_m)
        longitude = degrees(row["east_m"] / (radius_m * cos(radians(START_LATITUDE_DEG))))
        angles = {name.replace("_rad", "_deg"): degrees(row[name]) for name in row if name.endswith("_rad")}
        if full_flap_rad is not None:
            flaps = f",Flaps={row[_FLAP_COLUMN] / full_flap_rad:.4f}"
        yield _ACMI_FRAME.format(**row, **angles, latitude=latitude, longitude=longitude, flaps=flaps)
        while events and events[0].time_s <= row["t_s"] + 1e-9:
            yield f"0,Event=Bookmark|b1|{_escape_acmi_text(events.pop(0).label)}\n"


def _rows_at_acmi_rate(source: log.Log, columns: tuple[str, ...]) -> Iterator[dict[str, float]]:
    """Rows of the log by column: row 0, and every n-th one, for at most ACMI_RATE_HZ."""
    step = max(1, ceil(1.0 / (ACMI_RATE_HZ * source.frame_s) - 1e-9))
    rows_before = 0
    for chunk in source.read_chunks(columns):
        rows = len(chunk["t_s"])
        for i in range(-rows_before % step, rows, step):
            yield {name: float(values[i]) for name, values in chunk.items()}
        rows_before += rows
