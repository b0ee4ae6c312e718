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
from beaver_ftc_logs.recording import RecordedFlight, columns_and_time_origin, package_errors_as_bad_input

_TIME_FIELD, _INSTANCE_FIELDS = "TimeUS", ("I", "C", "Instance")
_IGNORED_MESSAGES = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"}

ValuesByField = dict[str, Any]


def read(path: Path, wanted_columns: Collection[str] | None = None) -> RecordedFlight:
    """The flight in a dataflash log. Raises BadInput where it is none, or pymavlink is missing.

    wanted_columns: the columns that are kept in memory, all where None.
    """
    values_by_message_and_field = _read_messages(path, wanted_columns)
    if not values_by_message_and_field:
        raise BadInput(f"{path}: holds no message with a time stamp, allowed: a dataflash log of a flight")
    return RecordedFlight(path.stem, columns_and_time_origin(values_by_message_and_field, _TIME_FIELD)[0])


def _read_messages(path: Path, wanted_columns: Collection[str] | None) -> dict[str, ValuesByField]:
    """The numeric fields of all messages with a stamp, by message and instance: those of its first."""
    values_by_message_and_field: dict[str, ValuesByField] = {}
    with (
        package_errors_as_bad_input(path, "dataflash log", "pymavlink", "ArduPilot's .bin or .log"),
        _silence_stderr(),
    ):
        from pymavlink import DFReader

        is_text_log = path.suffix.lower() == ".log"
        log_reader = (DFReader.DFReader_text if is_text_log else DFReader.DFReader_binary)(str(path))
        while (message := log_reader.recv_msg()) is not None:
            fields = message.to_dict()
            numeric_fields = {
                field_name: float(value)
                for field_name, value in fields.items()
                if isinstance(value, int | float)
            }
            if message.get_type() not in _IGNORED_MESSAGES and _TIME_FIELD in numeric_fields:
                message_name = _message_name(message.get_type(), fields)
                for field, field_values in values_by_message_and_field.setdefault(
                    message_name, _empty_arrays_of_wanted_fields(message_name, numeric_fields, wanted_columns)
                ).items():
                    field_values.append(numeric_fields.get(field, nan))
    return values_by_message_and_field


def _empty_arrays_of_wanted_fields(
    message_name: str, numeric_fields: ValuesByField, wanted_columns: Collection[str] | None
) -> ValuesByField:
    kept_fields = [
        field
        for field in numeric_fields
        if wanted_columns is None or field == _TIME_FIELD or f"{message_name}.{field}" in wanted_columns
    ]
    return {field: array("d") for field in kept_fields}


@contextmanager
def _silence_stderr() -> Iterator[None]:
    """Nothing on standard error: pymavlink, and its indexer in C, print what they skip."""
    sys.stderr.flush()
    saved_stderr, null_device = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null_device, 2)
    try:
        yield
    finally:
        os.dup2(saved_stderr, 2)
        os.close(saved_stderr)
        os.close(null_device)


def _message_name(message_type: str, fields: dict[str, Any]) -> str:
    instance_number = next((fields[key] for key in _INSTANCE_FIELDS if isinstance(fields.get(key), int)), 0)
    return message_type if instance_number == 0 else f"{message_type}{instance_number}"
