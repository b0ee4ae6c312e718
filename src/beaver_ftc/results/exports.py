"""The log for other tools: as CSV, and as a flight recording for Tacview."""

from collections.abc import Iterator
from math import ceil, cos, degrees, radians
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.loop.cockpit import EARTH_RADIUS_M
from beaver_ftc.plant.state import START_LATITUDE_DEG
from beaver_ftc.results import log
from beaver_ftc.results.looks import marks
from beaver_ftc.results.metrics import Document

ACMI_RATE_HZ = 25.0  # smooth to look at; a viewer interpolates
FLAP = "flap"  # a surface of this name is shown as a share of its travel
_AIRCRAFT = "b1"
_REFERENCE_TIME = "2005-06-27T12:00:00Z"  # any will do; the same for every run, so that runs overlay
_ACMI_COLUMNS = (
    "t_s", "north_m", "east_m", "altitude_m", "phi_rad", "theta_rad", "psi_rad",
    "airspeed_mps", "alpha_rad", "beta_rad",
)  # fmt: skip


def write_csv(log_path: Path, path: Path) -> None:
    """The log as CSV: one header line with the columns' names, then a line a frame."""
    from pyarrow.csv import CSVWriter, WriteOptions

    # pyarrow quotes the names in its header whatever it is told: ours is written by hand
    options = WriteOptions(include_header=False, quoting_style="none")
    with log.opened(log_path) as source:
        schema = source.schema_arrow
        with path.open("wb") as file:
            file.write((",".join(schema.names) + "\n").encode())
            with CSVWriter(file, schema, write_options=options) as writer:
                for group in range(source.num_row_groups):
                    writer.write_table(source.read_row_group(group))


def write_acmi(log_path: Path, metrics: Document, path: Path, aircraft: Aircraft | None = None) -> None:
    """The flight as a Tacview recording (ACMI 2.2): path, attitude, air data, flap, bookmarks for events."""
    aircraft = aircraft or load()
    title = aircraft.file.description.partition(",")[0] or aircraft.name
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("FileType=text/acmi/tacview\nFileVersion=2.2\n")
        file.write(f"0,ReferenceTime={_REFERENCE_TIME}\n0,DataSource=JSBSim\n0,DataRecorder=beaver-ftc\n")
        file.write(f"0,Title={_escaped(metrics['scenario'])}\n")
        file.write(f"{_AIRCRAFT},Type=Air+FixedWing,Name={_escaped(title)},Color=Blue\n")
        file.writelines(_frames(log_path, metrics, aircraft))


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace(",", "\\,").replace("\n", " ")


def _frames(log_path: Path, metrics: Document, aircraft: Aircraft) -> Iterator[str]:
    """A frame of the recording at ACMI_RATE_HZ at most, each event in the first frame not before it."""
    events = sorted(marks(metrics), key=lambda mark: mark.time_s)
    place = _Place(log_path)
    columns: tuple[str, ...] = _ACMI_COLUMNS
    full = aircraft.travel[FLAP].max_rad if FLAP in aircraft.surfaces else None
    if full is not None:
        columns += (f"{FLAP}_pos_rad",)
    for row in _thinned(log_path, columns):
        yield f"#{row['t_s']:.3f}\n{_AIRCRAFT},T={place.of(row)},{_properties(row)}{_flaps(row, full)}\n"
        while events and events[0].time_s <= row["t_s"] + 1e-9:
            yield f"0,Event=Bookmark|{_AIRCRAFT}|{_escaped(events.pop(0).label)}\n"


def _thinned(log_path: Path, columns: tuple[str, ...]) -> Iterator[dict[str, float]]:
    every, seen = _every(log_path), 0
    for chunk in log.read_chunks(log_path, columns):
        rows = len(chunk["t_s"])
        for i in range(-seen % every, rows, every):
            yield {name: float(values[i]) for name, values in chunk.items()}
        seen += rows


def _every(log_path: Path) -> int:
    first = next(log.read_chunks(log_path, ["t_s"]))["t_s"][:2]
    return max(1, ceil(1.0 / (ACMI_RATE_HZ * float(np.diff(first)[0])) - 1e-9)) if len(first) == 2 else 1


class _Place:
    """From the log's local plane back to longitude and latitude, with the attitude, as ACMI wants them."""

    def __init__(self, log_path: Path) -> None:
        start_m = float(next(log.read_chunks(log_path, ["altitude_m"]))["altitude_m"][0])
        self._radius_m = EARTH_RADIUS_M + start_m

    def of(self, row: dict[str, float]) -> str:
        """Longitude, latitude (deg), altitude (m), roll, pitch, yaw (deg)."""
        latitude = START_LATITUDE_DEG + degrees(row["north_m"] / self._radius_m)
        longitude = degrees(row["east_m"] / (self._radius_m * cos(radians(START_LATITUDE_DEG))))
        attitude = "|".join(f"{degrees(row[name]):.3f}" for name in ("phi_rad", "theta_rad", "psi_rad"))
        return f"{longitude:.8f}|{latitude:.8f}|{row['altitude_m']:.3f}|{attitude}"


def _properties(row: dict[str, float]) -> str:
    return (
        f"TAS={row['airspeed_mps']:.3f},AOA={degrees(row['alpha_rad']):.3f},"
        f"AOS={degrees(row['beta_rad']):.3f}"
    )


def _flaps(row: dict[str, float], full_rad: float | None) -> str:
    return "" if full_rad is None else f",Flaps={row[f'{FLAP}_pos_rad'] / full_rad:.4f}"
