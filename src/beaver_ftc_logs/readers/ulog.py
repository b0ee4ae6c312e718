"""A PX4 log (ULog). A column is named `topic.field`, `topic_1.field` for a second instance of a topic.

Time counts from the first message of the topics that are read. Reading needs pyulog: the extra `flights`.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from beaver_ftc_logs.readers.topics import (
    Topic,
    flight_of_topics,
    names_of_topics,
    package_errors_as_bad_input,
)
from beaver_ftc_logs.recording import Parameters, RecordedFlight, Wanted, add_parameter
from beaver_ftc_logs.refusals import refusal

_TIME_FIELD = "timestamp"
# Largest number of bytes of a message: its length is written in 16 bits.
_MAX_MESSAGE_BYTES = 65535


def read(path: Path, wanted: Wanted = None) -> RecordedFlight:
    """The flight in a .ulg file. Raises BadInput where it is none, or pyulog is missing.

    wanted: the columns that are returned, all if None; their topics are in memory while the log is read. If
    the log has none of them, all columns are returned without numbers. If one is missing, the log is read
    once more for the names of all columns.
    """
    params: Parameters = {}
    with package_errors_as_bad_input(path, "ULog", "pyulog", "a .ulg file of PX4"):
        topics = all_topics = _read_topics(path, wanted, params)
        if wanted is not None and not {*wanted} <= {*names_of_topics(topics)}:
            all_topics = _read_topics(path, None, {})
        if not all_topics:
            raise refusal(path, "holds no message", "a log of a flight")
        flight, origin_s = flight_of_topics(path, topics, wanted, names_of_topics(all_topics), params)
    if origin_s is None:
        return flight
    return replace(flight, notes=(f"time counts from {origin_s:.3f} s of the autopilot's clock",))


def _read_topics(path: Path, wanted: Wanted, params: Parameters) -> dict[str, Topic]:
    """The topics of the wanted columns, of any instance; all topics if the log has none of these.

    params: receives the parameters of the log. Raises ValueError for a message that is too large.
    """
    from pyulog import ULog

    formats = ULog(str(path), parse_header_only=True).message_formats
    for name in formats:
        # pyulog would expand each field of such a message.
        if _min_message_bytes(formats, name, ()) > _MAX_MESSAGE_BYTES:
            raise ValueError(f"a message {name} would have more than {_MAX_MESSAGE_BYTES} bytes")
    names = {column.partition(".")[0] for column in wanted or ()}
    names |= {re.sub(r"_\d+$", "", name) for name in names}
    log = ULog(str(path), sorted(names & set(formats)) or None)
    changes = [(name, value) for _, name, value in log.changed_parameters]
    for name, value in [*log.initial_parameters.items(), *changes]:
        if isinstance(value, int | float):
            add_parameter(params, name, value)
    topics = {}
    for part in log.data_list:
        if _TIME_FIELD in part.data:
            fields = [field for field in part.data if field != _TIME_FIELD]
            name = f"{part.name}_{part.multi_id}" if part.multi_id else part.name
            topics[name] = Topic(part.data[_TIME_FIELD].astype(float), fields, part.data.__getitem__)
    return topics


def _min_message_bytes(formats: dict[str, Any], name: str, outer: tuple[str, ...]) -> int:
    """Least number of bytes of a message, with its nested messages. outer: the messages in which it is
    nested. A field of a number counts one byte.
    """
    if name in outer:
        raise ValueError(f"a message {name} holds itself")
    if name not in formats:  # a number, or a type that pyulog complains about
        return 1
    fields = formats[name].fields
    outer = (*outer, name)
    return sum(max(count, 1) * _min_message_bytes(formats, kind, outer) for kind, count, _ in fields)
