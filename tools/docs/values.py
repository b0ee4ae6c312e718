"""A value out of a document, as prose and tables have it."""

import shlex
from collections import Counter
from typing import Any, NamedTuple

from beaver_ftc.documents.errors import BadInput

_LONGEST = 200  # of what is listed


class Place(NamedTuple):
    """Where a value stands in a document, and in which form it is shown."""

    path: str
    factor: float = 1.0
    format: str = ""

    @classmethod
    def read(cls, words: str) -> "Place":
        """Of words such as `delay.median_s .2f`, `share *100 .0f`. Raises ValueError for others."""
        path, *rest = shlex.split(words)
        (factor,) = [word[1:] for word in rest if word.startswith("*")] or ["1"]
        (spec,) = [word for word in rest if not word.startswith("*")] or [""]
        return cls(path, float(factor), spec)


def at(document: Any, path: str) -> Any:
    """What stands under a dotted path: keys of a mapping (dots in a key are its own), the index of a list, or
    `key=value`, the one element of a list that has it. Raises BadInput where there is nothing.
    """
    value, rest = document, path
    while rest:
        steps, allowed = _steps(value)
        fits = [name for name in steps if f"{rest}.".startswith(f"{name}.")]
        if not fits:
            raise BadInput(f"{path}: no {rest.partition('.')[0]}, allowed: {allowed}")
        name = max(fits, key=len)
        value, rest = steps[name], rest[len(name) + 1 :]
    return value


def _steps(value: Any) -> tuple[dict[str, Any], str]:
    """What is one step below, by its name; and what is allowed there, in words."""
    if isinstance(value, dict):
        return {str(key): of for key, of in value.items()}, ", ".join(map(str, value))[:_LONGEST]
    if not isinstance(value, list):
        return {}, "a path to a value"
    rows = [(f"{key}={of}", row) for row in value if isinstance(row, dict) for key, of in row.items()]
    count = Counter(name for name, _ in rows)
    known = {name: row for name, row in rows if count[name] == 1}
    known |= {str(i): row for k, row in enumerate(value) for i in (k, k - len(value))}
    return known, f"an index below {len(value)}, or key=value of one row"


def printed(document: Any, place: Place) -> str:
    """The value as it stands in prose. Raises BadInput where it cannot be taken or formatted."""
    value = at(document, place.path)
    if isinstance(value, dict | list) or value is None:
        raise BadInput(f"{place.path}: is {_kind(value)}, allowed: a number, a text, yes or no")
    if isinstance(value, bool):
        value = "yes" if value else "no"
    try:
        if isinstance(value, str):
            return format(value, place.format)
        return format(value * place.factor if place.factor != 1.0 else value, place.format)
    except ValueError as error:
        raise BadInput(f"{place.path}: {error}: {place.format}, allowed: a format of Python") from None


def _kind(value: Any) -> str:
    return "null" if value is None else f"a {'mapping' if isinstance(value, dict) else 'list'}"
