"""A number out of a document, as prose has it."""

from typing import Any

from beaver_ftc.documents.errors import BadInput, suggestion
from tools.docs.marks import Number


def at(document: Any, path: str) -> Any:
    """What stands under a dotted path: keys of a mapping (dots in a key are its own), the index of a list, or
    `key=value`, the one element of a list that has it. Raises BadInput where there is nothing.
    """
    value, parts, taken = document, path.split("."), 0
    while taken < len(parts):
        width, value = _next(value, parts[taken:], path)
        taken += width
    return value


def _next(value: Any, parts: list[str], path: str) -> tuple[int, Any]:
    """How many parts of the path lead one step further, and where to."""
    if isinstance(value, dict):
        for width in range(len(parts), 0, -1):
            key = ".".join(parts[:width])
            if key in value:
                return width, value[key]
        raise BadInput(f"{path}: no {parts[0]}{suggestion(parts[0], [str(key) for key in value])}")
    if not isinstance(value, list):
        raise BadInput(f"{path}: nothing is below {value!r}, allowed: a path to a value")
    for width in range(len(parts), 0, -1):
        key, equals, wanted = ".".join(parts[:width]).partition("=")
        found = [element for element in value if equals and str(element.get(key)) == wanted]
        if len(found) == 1:
            return width, found[0]
    index = parts[0].removeprefix("-")
    if not index.isdigit() or not -len(value) <= int(parts[0]) < len(value):
        raise BadInput(
            f"{path}: no {parts[0]}, allowed: an index below {len(value)}, or key=value of one row"
        )
    return 1, value[int(parts[0])]


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
