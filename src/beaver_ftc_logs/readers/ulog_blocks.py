"""Topics of a ULog, read in blocks: memory holds the fields that are kept, and a block of each topic.

pyulog collects all messages of a topic, whatever is wanted of them. Here, its collection has a limit: a full
block is reduced to the kept fields, in the numbers' own types.
"""

from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyulog import ULog

from beaver_ftc_logs.recording import Floats, add_parameter

_BLOCK_BYTES = 1_000_000
"""Bytes of messages of a topic that are held before they are reduced."""

KeptFields = Callable[[str, list[str]], list[str]]
"""The fields of a topic that are kept: of the topic's column name and all fields of a message."""


def read_topics(
    path: Path, topics: list[str] | None, kept: KeptFields, params: dict[str, tuple[float, ...]]
) -> Iterator[tuple[str, list[str], dict[str, Floats]]]:
    """Of each topic with a message: its name in columns, all its fields, and the numbers of the kept ones.

    topics: the topics that are read, of any instance, all where None. params: receives those of the
    log.
    """
    log = _read_log(path, topics, kept)
    changes = [(name, value) for _, name, value in log.changed_parameters]
    for name, value in [*log.initial_parameters.items(), *changes]:
        if isinstance(value, int | float):
            add_parameter(params, name, value)
    while log.data_list:
        topic = log.data_list.pop(0)
        name, fields = _column_topic_name(topic.name, topic.multi_id), list(topic.data)
        blocks = [*chain(*(messages.blocks for messages in log.messages_of_topics if messages.is_of(topic)))]
        numbers: dict[str, Floats] = {}
        for field in kept(name, fields):
            parts = [*(block.pop(field) for block in blocks), topic.data[field]]
            numbers[field] = np.concatenate(parts, dtype=float, casting="unsafe")
        yield name, fields, numbers


def _column_topic_name(name: str, instance: int) -> str:
    return name if instance == 0 else f"{name}_{instance}"


class _MessagesOfTopic(bytearray):
    """Messages of a topic, as pyulog adds them one by one; those of full blocks are in `blocks`, by field.

    The last message always stays here, since pyulog leaves out a topic that has none.
    """

    def __init__(self, source: Any, kept: KeptFields) -> None:
        super().__init__()
        self.blocks: list[dict[str, NDArray[Any]]] = []
        self._subscription = source
        name = _column_topic_name(source.message_name, source.multi_id)
        self._kept_fields = kept(name, list(source.dtype.names))

    def __iadd__(self, message: Any) -> "_MessagesOfTopic":  # type: ignore[misc]
        if len(self) >= _BLOCK_BYTES:
            rows = np.frombuffer(bytes(self), dtype=self._subscription.dtype)
            self.blocks.append({field: rows[field].copy() for field in self._kept_fields})
            self.clear()
        self.extend(message)
        return self

    def is_of(self, topic: Any) -> bool:
        """Whether pyulog made the topic of these messages: both then have one list of fields."""
        return topic.field_data is self._subscription.field_data


def _read_log(path: Path, topics: list[str] | None, kept_fields: KeptFields) -> Any:
    kept: list[_MessagesOfTopic] = []

    class LogInBlocks(ULog):
        class _MessageAddLogged(ULog._MessageAddLogged):
            def __init__(self, *arguments: Any) -> None:
                super().__init__(*arguments)
                self.buffer = _MessagesOfTopic(self, kept_fields)
                kept.append(self.buffer)

    log = LogInBlocks(str(path), topics)
    log.messages_of_topics = kept
    return log
