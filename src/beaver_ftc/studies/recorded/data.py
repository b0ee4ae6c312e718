"""The data sets in a folder: ENAC's tables beside their vehicle file, ALFA's folders of topics."""

from dataclasses import dataclass
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.readers import read_flight
from beaver_ftc.flights.recording import Recording
from beaver_ftc.flights.samples import Samples, sample
from beaver_ftc.flights.vehicle import Vehicle, load_vehicle

VEHICLE_FILE = "vehicle.yaml"
_RAW = "*-mavros-imu-data_raw.csv"


@dataclass(frozen=True)
class DataSet:
    """Flights of one vehicle: as they were logged, and on one time base."""

    name: str
    vehicle: Vehicle
    recordings: tuple[Recording, ...]
    flights: tuple[Samples, ...]


def data_sets(folder: Path) -> list[DataSet]:
    """The data sets below a folder. Raises BadInput where there is none, or a flight cannot be used."""
    if not folder.is_dir():
        raise BadInput(f"compare: --flights {folder}: no such folder, allowed: a folder of recorded flights")
    found = [entry for path in (folder, *sorted(folder.iterdir())) if (entry := _data_set(path))]
    if not found:
        raise BadInput(
            f"compare: --flights {folder}: holds no data set, allowed: folders with tables and a "
            f"{VEHICLE_FILE}, or with processed folders of the ALFA data set"
        )
    return found


def _data_set(path: Path) -> DataSet | None:
    if not path.is_dir():
        return None
    if (path / VEHICLE_FILE).is_file():
        tables = sorted([*path.glob("*.csv"), *path.glob("*.parquet")])
        return _read(path.name, load_vehicle(path / VEHICLE_FILE), tables) if tables else None
    alfa = sorted(flight for flight in path.iterdir() if flight.is_dir() and any(flight.glob(_RAW)))
    return _read(path.name, load_vehicle("alfa"), alfa) if alfa else None


def _read(name: str, vehicle: Vehicle, paths: list[Path]) -> DataSet:
    recordings = tuple(read_flight(path, vehicle.reader) for path in paths)
    return DataSet(name, vehicle, recordings, tuple(sample(one, vehicle) for one in recordings))
