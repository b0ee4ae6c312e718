"""A number out of a document, as prose has it."""

from collections import Counter
from typing import Any

from beaver_ftc.documents.errors import BadInput
from tools.docs.marks import Number

_LONGEST = 200  # of what is listed


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


def printed(document: Any, number: Number) -> str:
    """The number as it stands in prose. Raises BadInput where it cannot be taken or formatted."""
    value = at(document, number.path)
    if isinstance(value, dict | list) or value is None:
        raise BadInput(f"{number.path}: is {_kind(value)}, allowed: a number, a text, yes or no")
    if isinstance(value, bool):
        value = "yes" if value else "no"
    try:
        if isinstance(value, str):
            return format(value, number.format)
        return format(value * number.factor if number.factor != 1.0 else value, number.format)
    except ValueError as error:
        raise BadInput(f"{number.path}: {error}: {number.format}, allowed: a format of Python") from None


def _kind(value: Any) -> str:
    return "null" if value is None else f"a {'mapping' if isinstance(value, dict) else 'list'}"
