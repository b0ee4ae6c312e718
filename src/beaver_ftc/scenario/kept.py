"""What was computed from sections of a scenario, kept for further flights that share them."""

from collections.abc import Callable, Hashable, Iterable
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

Found = TypeVar("Found")


class KeptBySections(Generic[Found]):
    """What was found of sections, for further flights that have the same objects.

    Each entry holds its sections, so that their ids stay their own. Of more than `most` entries all are
    dropped.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._entries: dict[tuple[Hashable, ...], tuple[tuple[object, ...], Found]] = {}

    def __len__(self) -> int:
        return len(self._entries)

    def get(self, sections: tuple[object, ...], find: Callable[[], Found], *besides: Hashable) -> Found:
        """What `find` returns for these sections, and for these values besides; called if nothing is kept."""
        key = (*map(id, sections), *besides)
        if key not in self._entries:
            if len(self._entries) >= self._most:
                self._entries.clear()
            self._entries[key] = sections, find()
        return self._entries[key][1]


_MOST = 256
_texts: KeptBySections[str] = KeptBySections(_MOST)


def texts_of(scenario: Any, sections: Iterable[str]) -> tuple[str, ...]:
    """What sections hold, nothing where a scenario has none. Flights of a sweep share those that do not vary,
    whose text is written once."""
    return tuple(_text_of(getattr(scenario, name)) for name in sections)


def _text_of(section: BaseModel | None) -> str:
    if section is None:
        return ""
    return _texts.get((section,), section.model_dump_json)
