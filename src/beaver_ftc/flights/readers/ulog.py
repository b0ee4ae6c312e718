"""A PX4 log (ULog). A column is named `topic.field`, `topic_1.field` for a second instance of a topic.

Time counts from the first message of the log. Reading needs pyulog: the extra `flights`.
"""

from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.recording import Column, Recording

_US = 1e-6


def read(path: Path) -> Recording:
    """The flight in a .ulg file. Raises BadInput where it is none, or pyulog is missing."""
    topics = _topics(path)
    stamps = [topic.data["timestamp"] for topic in topics if len(topic.data["timestamp"])]
    if not stamps:
        raise BadInput(f"{path}: holds no message, allowed: a log of a flight")
    origin_us = min(int(one[0]) for one in stamps)
    columns: dict[str, Column] = {}
    for topic in topics:
        columns |= _columns(topic, origin_us)
    notes = (f"time counts from {origin_us * _US:.3f} s of the autopilot's clock",)
    return Recording(path.stem, columns, notes=notes)


def _topics(path: Path) -> list[Any]:
    try:
        from pyulog import ULog
    except ImportError:
        raise BadInput(
            f"{path}: reading a ULog needs pyulog, allowed: pip install 'beaver-ftc[flights]'"
        ) from None
    try:
        return list(ULog(str(path)).data_list)
    except Exception as error:  # pyulog raises whatever a damaged file makes it stumble over
        says = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{path}: is no ULog that can be read ({says}), allowed: a .ulg file of PX4") from None


def _columns(topic: Any, origin_us: int) -> dict[str, Column]:
    """The fields of one topic, in the order of their stamps, each stamp once."""
    name = topic.name if topic.multi_id == 0 else f"{topic.name}_{topic.multi_id}"
    t_s = (topic.data["timestamp"].astype(np.int64) - origin_us) * _US
    kept = np.flatnonzero(np.diff(np.maximum.accumulate(t_s), prepend=-np.inf) > 0)
    return {
        f"{name}.{field}": Column(t_s[kept], np.asarray(values, dtype=float)[kept])
        for field, values in topic.data.items()
        if field != "timestamp"
    }
