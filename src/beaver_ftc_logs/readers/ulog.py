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


def read(path: Path, wanted: Collection[str] | None = None) -> RecordedFlight:
    """The flight in a .ulg file. Raises BadInput where it is none, or pyulog is missing.

    wanted: the columns that are kept in memory, all where None. Where the log has none of them, all
    columns are returned, without numbers. Where it lacks one, the log is read once more for the names of all.
    """
    params: dict[str, tuple[float, ...]] = {}
    fields, kept = _read_topics(path, wanted, params)
    names = column_names_of_topics(fields, _TIME_FIELD)
    lacks = wanted is not None and not {*wanted} <= {*names}
    if lacks:
        fields, _ = _read_topics(path, (), {})
        names = column_names_of_topics(fields, _TIME_FIELD)
    if not fields:
        raise BadInput(f"{path}: holds no message, allowed: a log of a flight")
    if wanted is not None and not {*wanted} & {*names}:
        return RecordedFlight(path.stem, columns_without_numbers(fields, _TIME_FIELD), parameters=params)
    columns, origin_s = columns_and_time_origin(kept, _TIME_FIELD)
    unread = tuple(name for name in names if name not in columns)
    notes = (f"time counts from {origin_s:.3f} s of the autopilot's clock",)
    return RecordedFlight(path.stem, columns, notes=notes, parameters=params, unread_column_names=unread)


def _read_topics(
    path: Path, wanted: Collection[str] | None, params: dict[str, tuple[float, ...]]
) -> tuple[dict[str, list[str]], dict[str, dict[str, Floats]]]:
    """All fields and the numbers of the kept ones, by topic: of the topics of the wanted columns, of any
    instance; where none of these is in the log, the fields of all topics, and no numbers.

    params: receives those of the log.
    """
    with package_errors_as_bad_input(path, "ULog", "pyulog", "a .ulg file of PX4"):
        import_module("pyulog")  # here, since the module below may have been imported before
        from beaver_ftc_logs.readers import ulog_blocks

        topics = _select_topics(path, wanted)
        any_wanted = wanted is None or bool(topics)

        def kept_fields(topic: str, fields: list[str]) -> list[str]:
            if not any_wanted or wanted is None:
                return list(fields) if any_wanted else []
            return [field for field in fields if field == _TIME_FIELD or f"{topic}.{field}" in wanted]

        fields_by_topic: dict[str, list[str]] = {}
        kept_by_topic: dict[str, dict[str, Floats]] = {}
        for topic, fields, kept in ulog_blocks.read_topics(path, topics or None, kept_fields, params):
            if _TIME_FIELD in fields:
                fields_by_topic[topic], kept_by_topic[topic] = fields, kept
    return fields_by_topic, kept_by_topic


def _select_topics(path: Path, wanted: Collection[str] | None) -> list[str]:
    """The topics in a log that a wanted column may be of. Raises ValueError for a message too large."""
    from pyulog import ULog

    formats = ULog(str(path), parse_header_only=True).message_formats
    for name in formats:
        if _min_message_bytes(formats, name, ()) > _MAX_MESSAGE_BYTES:  # pyulog writes every field of one out
            raise ValueError(f"a message {name} would have more than {_MAX_MESSAGE_BYTES} bytes")
    topics = {column.partition(".")[0] for column in wanted or ()}
    topics |= {re.sub(r"_\d+$", "", topic) for topic in topics}
    return sorted(topics & set(formats))


def _min_message_bytes(formats: dict[str, Any], name: str, outer: tuple[str, ...]) -> int:
    """Bytes of a message at least, its nested messages in it."""
    if name in outer:
        raise ValueError(f"a message {name} holds itself")
    if name not in formats:  # a number, or a type that pyulog complains about
        return 1
    fields, outer = formats[name].fields, (*outer, name)
    return sum(max(count, 1) * _min_message_bytes(formats, kind, outer) for kind, count, _ in fields)
