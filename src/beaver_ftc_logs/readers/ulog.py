"""A PX4 log (ULog). A column is named `topic.field`, `topic_1.field` for a second instance of a topic.

Time counts from the first message of the log. Reading needs pyulog: the extra `flights`.
"""

import re
from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import (
    Floats,
    RecordedFlight,
    column_names_of_topics,
    columns_and_time_origin,
    columns_without_numbers,
    package_errors_as_bad_input,
)

_TIME_FIELD = "timestamp"
_MAX_MESSAGE_BYTES = 65535
"""Bytes of a message: its length is written in 16 bits."""


def read(path: Path, wanted_columns: Collection[str] | None = None) -> RecordedFlight:
    """The flight in a .ulg file. Raises BadInput where it is none, or pyulog is missing.

    wanted_columns: the columns that are kept in memory, all where None. Where the log has none of them, all
    columns are returned, without numbers. Where it lacks one, the log is read once more for the names of all.
    """
    parameters: dict[str, tuple[float, ...]] = {}
    fields_by_topic, kept_by_topic = _read_topics(path, wanted_columns, parameters)
    column_names = column_names_of_topics(fields_by_topic, _TIME_FIELD)
    lacks_wanted = wanted_columns is not None and not {*wanted_columns} <= {*column_names}
    if lacks_wanted:
        fields_by_topic, _ = _read_topics(path, (), {})
        column_names = column_names_of_topics(fields_by_topic, _TIME_FIELD)
    if not fields_by_topic:
        raise BadInput(f"{path}: holds no message, allowed: a log of a flight")
    if wanted_columns is not None and not {*wanted_columns} & {*column_names}:
        return RecordedFlight(
            path.stem, columns_without_numbers(fields_by_topic, _TIME_FIELD), parameters=parameters
        )
    columns, origin_s = columns_and_time_origin(kept_by_topic, _TIME_FIELD)
    return RecordedFlight(
        path.stem,
        columns,
        notes=(f"time counts from {origin_s:.3f} s of the autopilot's clock",),
        parameters=parameters,
        unread_column_names=tuple(name for name in column_names if name not in columns),
    )


def _read_topics(
    path: Path, wanted_columns: Collection[str] | None, parameters: dict[str, tuple[float, ...]]
) -> tuple[dict[str, list[str]], dict[str, dict[str, Floats]]]:
    """All fields and the numbers of the kept ones, by topic: of the topics of the wanted columns, of any
    instance; where none of these is in the log, the fields of all topics, and no numbers.

    parameters: receives those of the log.
    """
    with package_errors_as_bad_input(path, "ULog", "pyulog", "a .ulg file of PX4"):
        import_module("pyulog")  # here, since the module below may have been imported before
        from beaver_ftc_logs.readers import ulog_blocks

        topic_names = _check_formats_and_select_topics(path, wanted_columns)
        is_any_wanted = wanted_columns is None or bool(topic_names)

        def kept_fields(topic: str, fields: list[str]) -> list[str]:
            return [
                field
                for field in fields
                if is_any_wanted
                and (field == _TIME_FIELD or wanted_columns is None or f"{topic}.{field}" in wanted_columns)
            ]

        fields_by_topic: dict[str, list[str]] = {}
        kept_by_topic: dict[str, dict[str, Floats]] = {}
        for topic, fields, kept in ulog_blocks.read_topics(
            path, topic_names or None, kept_fields, parameters
        ):
            if _TIME_FIELD in fields:
                fields_by_topic[topic], kept_by_topic[topic] = fields, kept
    return fields_by_topic, kept_by_topic


def _check_formats_and_select_topics(path: Path, wanted_columns: Collection[str] | None) -> list[str]:
    """The topics in a log that a wanted column may be of. Raises ValueError for a message too large."""
    from pyulog import ULog

    formats = ULog(str(path), parse_header_only=True).message_formats
    for name in formats:
        if _min_message_bytes(formats, name, ()) > _MAX_MESSAGE_BYTES:  # pyulog writes every field of one out
            raise ValueError(f"a message {name} would have more than {_MAX_MESSAGE_BYTES} bytes")
    wanted_topics = {column.partition(".")[0] for column in wanted_columns or ()}
    wanted_topics |= {re.sub(r"_\d+$", "", topic) for topic in wanted_topics}
    return sorted(wanted_topics & set(formats))


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
