"""An ArduPilot dataflash log (.bin, or .log as text). A column is named `MESSAGE.Field`.

A message that comes from several instances (field `I` or `C`) has the instance's number with its name, from
the second on: `IMU1.GyrX`. Time counts from the first message with a stamp. Reading needs pymavlink: the
extra `flights`.
"""

import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.recording import Column, Recording

_US = 1e-6
_TIME, _INSTANCES = "TimeUS", ("I", "C", "Instance")
_OVERHEAD = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"}

Rows = dict[str, list[dict[str, float]]]


def read(path: Path) -> Recording:
    """The flight in a dataflash log. Raises BadInput where it is none, or pymavlink is missing."""
    messages = _messages(path)
    if not messages:
        raise BadInput(f"{path}: holds no message with a time stamp, allowed: a dataflash log of a flight")
    origin_us = min(rows[0][_TIME] for rows in messages.values())
    columns: dict[str, Column] = {}
    for name, rows in messages.items():
        columns |= _columns(name, rows, origin_us)
    return Recording(path.stem, columns)


def _messages(path: Path) -> Rows:
    """The numeric fields of all messages with a stamp, by message and instance."""
    found: Rows = defaultdict(list)
    reader = _reader(path)
    try:
        with _silence():
            log = reader(str(path))
            while (message := log.recv_msg()) is not None:
                fields = message.to_dict()
                if message.get_type() not in _OVERHEAD and _TIME in fields:
                    numbers = {
                        k: float(value) for k, value in fields.items() if isinstance(value, int | float)
                    }
                    found[_name(message.get_type(), fields)].append(numbers)
    except Exception as error:  # pymavlink raises whatever a damaged file makes it stumble over
        raise _unreadable(path, error) from None
    return dict(found)


@contextmanager
def _silence() -> Iterator[None]:
    """Nothing on standard error: pymavlink's indexer, in C, prints every damaged byte it skips."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _reader(path: Path) -> Any:
    try:
        from pymavlink import DFReader
    except ImportError:
        raise BadInput(
            f"{path}: reading a dataflash log needs pymavlink, allowed: pip install 'beaver-ftc[flights]'"
        ) from None
    text = path.suffix.lower() == ".log"
    return DFReader.DFReader_text if text else DFReader.DFReader_binary


def _unreadable(path: Path, error: Exception) -> BadInput:
    says = " ".join(str(error).split()) or type(error).__name__
    return BadInput(
        f"{path}: is no dataflash log that can be read ({says}), allowed: ArduPilot's .bin or .log"
    )


def _name(kind: str, fields: dict[str, Any]) -> str:
    number = next((fields[key] for key in _INSTANCES if isinstance(fields.get(key), int)), 0)
    return kind if number == 0 else f"{kind}{number}"


def _columns(name: str, rows: list[dict[str, float]], origin_us: float) -> dict[str, Column]:
    t_s = (np.array([row[_TIME] for row in rows]) - origin_us) * _US
    kept = np.flatnonzero(np.diff(np.maximum.accumulate(t_s), prepend=-np.inf) > 0)
    fields = [field for field in rows[0] if field != _TIME]
    return {
        f"{name}.{field}": Column(t_s[kept], np.array([row.get(field, np.nan) for row in rows])[kept])
        for field in fields
    }
