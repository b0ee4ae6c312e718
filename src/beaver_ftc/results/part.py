"""Sections of a document as records. `Part` converts a section into a record and back, from the fields of the
record."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from types import UnionType
from typing import Annotated, Any, ClassVar, Self, TypeVar, Union, get_args, get_origin, get_type_hints

Value = TypeVar("Value")
_KNOWN = "a key that the document has only where its value is known"
# A field whose key is left out of the document if its value is None. Other fields are then null.
Known = Annotated[Value | None, _KNOWN]


@dataclass(frozen=True)
class Part:
    """A section of the document, its keys in the order of its fields.

    _first, _last: keys that the document has before and after all others. Inherited fields come first in a
    record, so that the places of its fields do not always give the order of the document.
    """

    _first: ClassVar[tuple[str, ...]] = ()
    _last: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(cls, section: Any) -> Self:
        """The record of a section of JSON, of a tuple of its values, or of such a record. A missing key gives
        None, or an empty tuple or mapping; a key that the record does not have is ignored."""
        part: Any = cls
        if isinstance(section, cls):
            return section
        if isinstance(section, tuple):
            return cls(*section)
        return cls(**{name: _read(hint, section.get(name)) for name, (hint, _) in _fields_of(part).items()})

    def document(self) -> dict[str, Any]:
        """The section as a mapping of keys to values."""
        part: Any = type(self)
        return {
            name: as_json_value(value)
            for name, (_, only_known) in _fields_of(part).items()
            if not ((value := getattr(self, name)) is None and only_known)
        }

    def at(self, path: str) -> Any:
        """The value at a path such as `detection.delay_s`; None if a section on the way is None."""
        value: Any = self
        for key in path.split("."):
            if value is None:
                break
            value = value.get(key) if isinstance(value, dict) else getattr(value, key)
        return value


@cache
def _fields_of(part: Any) -> dict[str, tuple[Any, bool]]:
    """(type, whether it is `Known`) of each field of a section, in the order of the document."""
    hints, marks = get_type_hints(part), get_type_hints(part, include_extras=True)
    others = [item.name for item in fields(part) if item.name not in part._first + part._last]
    names = (*part._first, *others, *part._last)
    return {name: (hints[name], _KNOWN in get_args(marks[name])) for name in names}


def without_none(hint: Any) -> Any:
    """The type of a field without None: `float` of `float | None`."""
    if get_origin(hint) not in (Union, UnionType):
        return hint
    return next(kind for kind in get_args(hint) if kind is not type(None))


@cache
def _kind_of(hint: Any) -> tuple[Any, Any, bool]:
    """The class of a field, the types of its entries, and whether it may be None: (tuple, (str, ...), True)
    of `tuple[str, ...] | None`."""
    bare = without_none(hint)
    return get_origin(bare) or bare, get_args(bare), bare is not hint


def _read(hint: Any, value: Any) -> Any:
    """A value of JSON as a field of this type."""
    kind, entry_types, may_be_none = _kind_of(hint)
    if value is None and (may_be_none or kind not in (tuple, dict)):
        return None
    if kind is tuple:
        return tuple(_read(entry_types[0], entry) for entry in value or ())
    if kind is dict:
        return {key: _read(entry_types[1], entry) for key, entry in (value or {}).items()}
    if isinstance(kind, type) and issubclass(kind, Part):
        return kind.of(value)
    return tuple(value) if isinstance(value, list) else value


def as_json_value(value: Any) -> Any:
    """A value of a field as JSON: records and mappings as mappings, tuples as lists."""
    if isinstance(value, Part):
        return value.document()
    if isinstance(value, Mapping):
        return {key: as_json_value(entry) for key, entry in value.items()}
    return [as_json_value(entry) for entry in value] if isinstance(value, tuple | list) else value


def rounded(value: Any) -> Any:
    """A value with each number rounded to nine decimals, which removes the rounding of frame times; None for
    a number that is not finite."""
    if isinstance(value, float):  # the most frequent type is tested first
        return round(float(value), 9) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    return tuple(map(rounded, value)) if isinstance(value, tuple | list) else value
