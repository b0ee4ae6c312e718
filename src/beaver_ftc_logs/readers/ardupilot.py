"""An ArduPilot dataflash log (.bin, or .log as text). A column is named `MESSAGE.Field`.

A message that comes from several instances (field `I` or `C`) has the instance's number with its name, from
the second on: `IMU1.GyrX`. Time counts from the first message with a stamp. Reading needs pymavlink: the
extra `flights`.
"""

import os
import re
import sys
from array import array
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from math import inf, nan
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import (
    RecordedFlight,
    add_parameter,
    column_names_of_topics,
    columns_and_time_origin,
    columns_without_numbers,
    package_errors_as_bad_input,
)

_TIME_FIELD, _INSTANCE_FIELDS = "TimeUS", ("I", "C", "Instance")
_IGNORED_MESSAGES = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"}

ValuesByField = dict[str, Any]


@dataclass
class _Stamps:
    """The stamps of a message that is not kept, us: the first, the last, and whether they never decrease.

    Where they do not, the first is the first that is kept of them (`rows_with_increasing_time`).
    """

    first: float
    last: float = -inf
    in_order: bool = True

    def add(self, stamp: float) -> None:
        self.in_order = self.in_order and self.last <= stamp < inf
        self.last = stamp


@dataclass
class _Messages:
    """What is kept of a log, by message and instance: its numeric fields, those of its first message; the
    values of its wanted fields with their stamps; the stamps alone of one without such a field.

    wanted_columns: all where None. wanted_messages: those whose stamps are kept in any case.
    """

    wanted_columns: Collection[str] | None
    wanted_messages: Collection[str]
    fields_by_message: dict[str, list[str]] = field(default_factory=dict)
    values_by_message: dict[str, ValuesByField] = field(default_factory=dict)
    parameters: dict[str, tuple[float, ...]] = field(default_factory=dict)
    stamps_by_message: dict[str, _Stamps] = field(default_factory=dict)

    def fields_to_read(self, kind: str, fields: list[str]) -> list[str]:
        """The fields of a kind of message that any instance of it is read for."""
        if kind in _IGNORED_MESSAGES or _TIME_FIELD not in fields:
            return []
        instance = re.compile(re.escape(kind) + r"(-?\d+)?")
        parts = (column.partition(".") for column in self.wanted_columns or ())
        wanted = {name for message, _, name in parts if instance.fullmatch(message)}
        wanted |= {_TIME_FIELD, *_INSTANCE_FIELDS}
        return [name for name in fields if self.wanted_columns is None or name in wanted]

    def add(self, message: str, fields: list[str], numbers: Mapping[str, float]) -> None:
        if message not in self.fields_by_message:
            self._begin_message(message, fields, numbers[_TIME_FIELD])
        if message in self.stamps_by_message:
            self.stamps_by_message[message].add(numbers[_TIME_FIELD])
        else:
            for name, values in self.values_by_message[message].items():
                values.append(numbers.get(name, nan))

    def _begin_message(self, message: str, fields: list[str], stamp: float) -> None:
        self.fields_by_message[message] = fields
        wanted = self.wanted_columns
        kept = [name for name in fields if wanted is None or f"{message}.{name}" in wanted]
        if kept or message in self.wanted_messages:
            self.values_by_message[message] = {name: array("d") for name in (_TIME_FIELD, *kept)}
        else:
            self.stamps_by_message[message] = _Stamps(stamp)


def read(path: Path, wanted: Collection[str] | None = None) -> RecordedFlight:
    """The flight in a dataflash log. Raises BadInput where it is none, or pymavlink is missing.

    wanted: the columns that are kept in memory, all where None. Where the log has none of them, all
    columns are returned, without numbers: their names are known then.
    """
    messages = _read_messages(path, wanted)
    if not messages.fields_by_message:
        raise BadInput(f"{path}: holds no message with a time stamp, allowed: a dataflash log of a flight")
    if not messages.values_by_message:
        empty = columns_without_numbers(messages.fields_by_message, _TIME_FIELD)
        return RecordedFlight(path.stem, empty, parameters=messages.parameters)
    damaged = [name for name, stamps in messages.stamps_by_message.items() if not stamps.in_order]
    if damaged:  # which of their stamps is the first depends on all of them
        messages = _read_messages(path, wanted, damaged)
    first_us = [stamps.first for stamps in messages.stamps_by_message.values()]
    names = column_names_of_topics(messages.fields_by_message, _TIME_FIELD)
    columns, _ = columns_and_time_origin(messages.values_by_message, _TIME_FIELD, first_us)
    unread = tuple(name for name in names if name not in columns)
    return RecordedFlight(path.stem, columns, parameters=messages.parameters, unread_column_names=unread)


def _read_messages(
    path: Path, wanted: Collection[str] | None, wanted_messages: Collection[str] = ()
) -> _Messages:
    """The messages with a stamp. wanted_messages: those whose stamps are kept, whatever else is wanted."""
    found = _Messages(wanted, wanted_messages)
    with (
        package_errors_as_bad_input(path, "dataflash log", "pymavlink", "ArduPilot's .bin or .log"),
        _silence_stderr(),
    ):
        import_module("pymavlink")  # here, since the module below may have been imported before
        from beaver_ftc_logs.readers import dataflash

        for kind, fields, numbers in dataflash.read_messages(path, found.fields_to_read):
            if kind == dataflash.PARAMETER_MESSAGE and dataflash.PARAMETER_NAME in numbers:
                name, value = (numbers[key] for key in dataflash.PARAMETER_FIELDS)
                add_parameter(found.parameters, name, value)
            elif _TIME_FIELD in numbers:
                found.add(_message_name(kind, numbers), fields, numbers)
    return found


def _message_name(kind: str, numbers: Mapping[str, Any]) -> str:
    instance = next((numbers[key] for key in _INSTANCE_FIELDS if isinstance(numbers.get(key), int)), 0)
    return kind if instance == 0 else f"{kind}{instance}"


@contextmanager
def _silence_stderr() -> Iterator[None]:
    """Nothing on standard error: pymavlink, and its indexer in C, print what they skip."""
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
