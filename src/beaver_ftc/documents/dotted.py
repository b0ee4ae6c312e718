"""A dotted key such as `faults[0].magnitude` is a place in the data: read, and filled."""

import re
from functools import lru_cache
from typing import Any

from beaver_ftc.documents.document import Location, copied
from beaver_ftc.documents.report import key_path

_PART = re.compile(r"(?:^|\.)([^.\[\]]+)|\[(\d{1,6})\]")
_IDEAL = "ideal"  # the preset that stands for a section with nothing in it


class UnusableKeyError(ValueError):
    """The key is none, or the data has no such place; the message says what is allowed."""


@lru_cache(maxsize=1024)  # a sweep asks for the same few again for each flight
def parse_key(key: str) -> Location:
    """'faults[0].magnitude' -> ('faults', 0, 'magnitude'). Raises UnusableKeyError."""
    parts = [(name or int(index)) for name, index in _PART.findall(key)] if isinstance(key, str) else []
    if not parts or key_path(tuple(parts)) != key:
        raise UnusableKeyError("is no dotted key, allowed: keys like faults[0].magnitude")
    return tuple(parts)


def with_values(data: dict[str, Any], values: dict[Location, Any]) -> dict[str, Any]:
    """A copy of the data with these values in these places; sections that are missing are made."""
    changed = copied(data)
    for location, value in values.items():
        _put(changed, location, copied(value))
    return changed


def _put(data: Any, location: Location, value: Any) -> None:
    *above, last = location
    here = data
    for depth, part in enumerate(above):
        here = _below(here, part, location[: depth + 1])
    if isinstance(here, list):
        _check_index(here, last, location)
    elif not isinstance(here, dict) or not isinstance(last, str):
        raise UnusableKeyError(f"{key_path(tuple(above))} has no such part, allowed: a key of the base")
    here[last] = value


def _below(here: Any, part: int | str, location: Location) -> Any:
    """The section one step down, made where it is missing or left to its empty preset."""
    if isinstance(here, list):
        _check_index(here, part, location)
    elif isinstance(here, dict) and isinstance(part, str):
        if here.get(part) in (None, _IDEAL):
            here[part] = {}
    else:
        raise UnusableKeyError(f"{key_path(location)} is not there, allowed: a key of the base")
    if not isinstance(here[part], dict | list):
        raise UnusableKeyError(f"{key_path(location)} is a single value, allowed: to vary it as a whole")
    return here[part]


def _check_index(here: list[Any], part: int | str, location: Location) -> None:
    if not isinstance(part, int) or part >= len(here):
        allowed = f"allowed: [0] to [{len(here) - 1}]" if here else "allowed: no index, the list is empty"
        raise UnusableKeyError(f"the base has no {key_path(location)}, {allowed}")
