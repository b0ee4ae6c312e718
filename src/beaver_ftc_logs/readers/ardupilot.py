"""An ArduPilot dataflash log (.bin, or .log as text). A column is named `MESSAGE.Field`.

A message that comes from several instances (_INSTANCE_FIELDS) has the instance's number behind its name,
unless this is 0: `IMU1.GyrX`. Time counts from the earliest message with columns. Reading needs pymavlink:
the extra `flights`.
"""

from collections.abc import Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers.topics import (
    Topic,
    flight_of_topics,
    names_of_topics,
    package_errors_as_bad_input,
)
from beaver_ftc_logs.recording import Floats, Ints, Parameters, RecordedFlight, Wanted, add_parameter

_TIME_FIELD = "TimeUS"
# The first of these fields that a message has holds the number of its instance.
_INSTANCE_FIELDS = ("I", "C", "Instance")
_IGNORED_MESSAGES = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"}


def read(path: Path, wanted: Wanted = None) -> RecordedFlight:
    """The flight in a dataflash log. Raises BadInput where it is none, or pymavlink is missing.

    wanted: the columns that are kept in memory, all if None. If the log has none of them, all columns are
    returned without numbers, so that the caller knows their names.
    """
    params: Parameters = {}
    with package_errors_as_bad_input(path, "dataflash log", "pymavlink", "ArduPilot's .bin or .log"):
        import_module("pymavlink")  # for its error, which an earlier import of `dataflash` would hide
        from beaver_ftc_logs.readers import dataflash

        messages = dataflash.read_messages(path)
        settings = messages.get("PARM")
        if settings and "Name" in settings.format.colhash and "Value" in settings.fields:
            for name, value in zip(settings.texts("Name"), settings.numbers("Value").tolist(), strict=True):
                add_parameter(params, name, value)
        topics = {
            topic: part
            for name, messages_of_name in messages.items()
            if name not in _IGNORED_MESSAGES and _TIME_FIELD in messages_of_name.fields
            for topic, part in _topics_of_instances(name, messages_of_name)
        }
        if not topics:
            reason = "holds no message with a time stamp, allowed: a dataflash log of a flight"
            raise BadInput(f"{path}: {reason}")
        return flight_of_topics(path, topics, wanted, names_of_topics(topics), params)[0]


def _topics_of_instances(name: str, messages: Any) -> Iterator[tuple[str, Topic]]:
    """For each instance of a message, its name and its messages as a topic."""
    stamps = messages.numbers(_TIME_FIELD)
    fields = [field for field in messages.fields if field != _TIME_FIELD]
    key = next((field for field in _INSTANCE_FIELDS if messages.fields.get(field) is int), None)
    numbers = messages.numbers(key).astype(int) if key else np.zeros(len(stamps), dtype=int)
    for number in dict.fromkeys(numbers.tolist()):
        rows = np.flatnonzero(numbers == number)
        values = partial(_values, messages, rows)
        yield f"{name}{number}" if number else name, Topic(stamps[rows], fields, values)


def _values(messages: Any, rows: Ints, field: str) -> Floats:
    """The numbers of a field in these rows of the messages."""
    return messages.numbers(field)[rows]
