"""What would be wrong besides, were the mistakes found so far mended as suggested.

A mistyped key or type hides what else is wrong in its section: nothing there can be held against a schema.
"""

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from beaver_ftc.documents.base import Location
from beaver_ftc.documents.document import Document, Problem

_MEANT = re.compile(r"did you mean ([^?\s]+)\?")
_UNKNOWN_KEY = "unknown key"


def repaired(document: Document, problems: Iterable[Problem], known: set[Location]) -> Document | None:
    """The document with unknown keys and types as they were meant, or without; None if none is unknown.

    known: gets the keys that were renamed: a value given to another key is not to be judged by this one.
    """
    data, lines, changed = _copied(document.data), dict(document.lines), False
    for problem in problems:
        meant = _MEANT.search(problem.says)
        section = _at(data, problem.location[:-1])
        key = problem.location[-1] if problem.location else None
        if not isinstance(section, dict) or key not in section:
            continue
        if problem.says.startswith(_UNKNOWN_KEY):
            value = section.pop(key)
            if meant and meant[1] not in section:
                section[meant[1]] = value
                known.add((*problem.location[:-1], meant[1]))
                lines |= _moved(lines, problem.location, (*problem.location[:-1], meant[1]))
            changed = True
        elif meant and key == "type":
            section[key], changed = meant[1], True
    return replace(document, data=data, lines=lines) if changed else None


def _moved(lines: dict[Location, int], old: Location, new: Location) -> dict[Location, int]:
    depth = len(old)
    return {(*new, *at[depth:]): line for at, line in lines.items() if at[:depth] == old}


def _at(data: Any, location: Location) -> Any:
    for part in location:
        known = isinstance(data, dict) and part in data
        if not known and not (isinstance(data, list) and isinstance(part, int) and part < len(data)):
            return None
        data = data[part]
    return data


def _copied(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _copied(value) for key, value in data.items()}
    return [_copied(value) for value in data] if isinstance(data, list) else data
