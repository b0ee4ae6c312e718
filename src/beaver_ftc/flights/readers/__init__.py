"""Readers of recorded flights, by name. A new format is one file here and one line in `READERS`."""

from importlib import import_module
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.recording import Recording

READERS = ("table", "alfa", "ulog", "ardupilot")
_BY_SUFFIX = {".csv": "table", ".parquet": "table", ".ulg": "ulog", ".bin": "ardupilot", ".log": "ardupilot"}


def read_flight(path: Path, reader: str | None = None) -> Recording:
    """The recorded flight in a file or folder.

    reader: one of READERS; by the path's own form where None. Raises BadInput with one line: why the log
    cannot be used.
    """
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder, allowed: a recorded flight")
    name = reader or _evident(path)
    if name not in READERS:
        raise BadInput(f"--reader {name}: is not known, allowed: {', '.join(READERS)}")
    recording: Recording = import_module(f"beaver_ftc.flights.readers.{name}").read(path)
    return recording


def _evident(path: Path) -> str:
    if path.is_dir():
        return "alfa"
    name = _BY_SUFFIX.get(path.suffix.lower())
    if name is None:
        raise BadInput(
            f"{path}: what kind of log this is cannot be seen, allowed: {', '.join(sorted(_BY_SUFFIX))}, "
            f"or --reader {', '.join(READERS)}"
        )
    return name
