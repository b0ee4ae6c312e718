"""An ArduPilot dataflash log (.bin, or .log as text). A column is named `MESSAGE.Field`.

A message that comes from several instances (field `I` or `C`) has the instance's number with its name, from
the second on: `IMU1.GyrX`. Time counts from the first message with a stamp. Reading needs pymavlink: the
extra `flights`.
"""

import os
import sys
from array import array
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from math import nan
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Recording, columns_of, reading

_TIME, _INSTANCES = "TimeUS", ("I", "C", "Instance")
_OVERHEAD = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"}

Fields = dict[str, Any]


def read(path: Path, wanted: Collection[str] | None = None) -> Recording:
    """The flight in a dataflash log. Raises BadInput where it is none, or pymavlink is missing.

    wanted: the columns that are kept in memory, all where None.
    """
    messages = _messages(path, wanted)
    if not messages:
        raise BadInput(f"{path}: holds no message with a time stamp, allowed: a dataflash log of a flight")
    return Recording(path.stem, columns_of(messages, _TIME)[0])


def _messages(path: Path, wanted: Collection[str] | None) -> dict[str, Fields]:
    """The numeric fields of all messages with a stamp, by message and instance: those of its first."""
    found: dict[str, Fields] = {}
    with reading(path, "dataflash log", "pymavlink", "ArduPilot's .bin or .log"), _silence():
        from pymavlink import DFReader

        text = path.suffix.lower() == ".log"
        log = (DFReader.DFReader_text if text else DFReader.DFReader_binary)(str(path))
        while (message := log.recv_msg()) is not None:
            fields = message.to_dict()
            numbers = {k: float(value) for k, value in fields.items() if isinstance(value, int | float)}
            if message.get_type() not in _OVERHEAD and _TIME in numbers:
                name = _name(message.get_type(), fields)
                for field, values in found.setdefault(name, _empty(name, numbers, wanted)).items():
                    values.append(numbers.get(field, nan))
    return found


def _empty(name: str, numbers: Fields, wanted: Collection[str] | None) -> Fields:
    kept = [field for field in numbers if wanted is None or field == _TIME or f"{name}.{field}" in wanted]
    return {field: array("d") for field in kept}


@contextmanager
def _silence() -> Iterator[None]:
    """Nothing on standard error: pymavlink, and its indexer in C, print what they skip."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _name(kind: str, fields: dict[str, Any]) -> str:
    number = next((fields[key] for key in _INSTANCES if isinstance(fields.get(key), int)), 0)
    return kind if number == 0 else f"{kind}{number}"
