"""What a command on recorded flights is given: all of them read and checked before the first is used."""

from collections.abc import Sequence
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.readers import read_flight
from beaver_ftc.flights.samples import Samples, sample
from beaver_ftc.flights.vehicle import Vehicle


def load_flights(paths: Sequence[Path], vehicle: Vehicle, reader: str | None = None) -> list[Samples]:
    """The flights, each on one time base. Raises BadInput with a line for each that cannot be used."""
    loaded: list[Samples] = []
    mistakes: list[str] = []
    for path in paths:
        try:
            loaded.append(sample(read_flight(path, reader or vehicle.reader), vehicle))
        except BadInput as error:
            mistakes.append(str(error))
    mistakes += _repeated([samples.name for samples in loaded])
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded


def _repeated(names: list[str]) -> list[str]:
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    return [f"two flights are named {name}: one result would replace the other" for name in twice]
