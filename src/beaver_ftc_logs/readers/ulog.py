"""A PX4 log (ULog). A column is named `topic.field`, `topic_1.field` for a second instance of a topic.

Time counts from the first message of the log. Reading needs pyulog: the extra `flights`.
"""

import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import RecordedFlight, columns_and_time_origin, package_errors_as_bad_input

_TIME_FIELD = "timestamp"
_MAX_MESSAGE_BYTES = 65535
"""Bytes of a message: its length is written in 16 bits."""


def read(path: Path, wanted_columns: Collection[str] | None = None) -> RecordedFlight:
    """The flight in a .ulg file. Raises BadInput where it is none, or pyulog is missing.

    wanted_columns: the columns that are kept in memory, all where None.
    """
    data_by_topic = {
        _topic_name(topic): topic.data
        for topic in _read_topics(path, wanted_columns)
        if len(topic.data.get(_TIME_FIELD, ()))
    }
    if wanted_columns is not None and data_by_topic:
        data_by_topic = {
            name: _select_wanted_fields(name, data, wanted_columns) for name, data in data_by_topic.items()
        }
    if not data_by_topic:
        raise BadInput(f"{path}: holds no message, allowed: a log of a flight")
    columns, origin_s = columns_and_time_origin(data_by_topic, _TIME_FIELD)
    time_origin_notes = (f"time counts from {origin_s:.3f} s of the autopilot's clock",)
    return RecordedFlight(path.stem, columns, notes=time_origin_notes)


def _topic_name(topic: Any) -> str:
    return str(topic.name) if topic.multi_id == 0 else f"{topic.name}_{topic.multi_id}"


def _select_wanted_fields(name: str, data: dict[str, Any], wanted_columns: Collection[str]) -> dict[str, Any]:
    return {
        field: values
        for field, values in data.items()
        if field == _TIME_FIELD or f"{name}.{field}" in wanted_columns
    }


def _read_topics(path: Path, wanted_columns: Collection[str] | None) -> list[Any]:
    """Read the topics of the wanted columns, of any instance; all where none of these is in the log."""
    with package_errors_as_bad_input(path, "ULog", "pyulog", "a .ulg file of PX4"):
        from pyulog import ULog

        formats = ULog(str(path), parse_header_only=True).message_formats
        for name in formats:
            if (
                _min_message_bytes(formats, name, ()) > _MAX_MESSAGE_BYTES
            ):  # pyulog writes every field of one out
                raise ValueError(f"a message {name} would have more than {_MAX_MESSAGE_BYTES} bytes")
        topic_names = {re.sub(r"_\d+$", "", column.partition(".")[0]) for column in wanted_columns or ()}
        topic_names = (topic_names | {column.partition(".")[0] for column in wanted_columns or ()}) & set(
            formats
        )
        topics = list(ULog(str(path), sorted(topic_names) if topic_names else None).data_list)
    return topics


def _min_message_bytes(formats: dict[str, Any], name: str, enclosing_messages: tuple[str, ...]) -> int:
    """Bytes of a message at least, its nested messages in it."""
    if name in enclosing_messages:
        raise ValueError(f"a message {name} holds itself")
    if name not in formats:  # a number, or a type that pyulog complains about
        return 1
    return sum(
        max(n_elements, 1) * _min_message_bytes(formats, field_type, (*enclosing_messages, name))
        for field_type, n_elements, _ in formats[name].fields
    )
