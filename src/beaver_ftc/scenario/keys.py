"""Sections of a scenario as text, by which what has been computed from them is found again."""

from collections.abc import Iterable

from pydantic import BaseModel

_MOST = 256
_texts: dict[int, tuple[BaseModel, str]] = {}  # a section is kept, so its id stays its own


def texts_of(scenario: BaseModel, sections: Iterable[str]) -> tuple[str, ...]:
    """What they hold. Flights of a sweep share the sections that do not vary, whose text is written once."""
    return tuple(_text_of(getattr(scenario, name)) for name in sections)


def _text_of(section: BaseModel) -> str:
    known = _texts.get(id(section))
    if known is None:
        if len(_texts) >= _MOST:
            _texts.clear()
        known = _texts[id(section)] = section, section.model_dump_json()
    return known[1]
