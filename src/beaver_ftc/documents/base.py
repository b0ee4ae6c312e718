"""What every section of a scenario shares: frozen, strict about its keys, no coercion of values."""

from collections.abc import Iterable
from typing import Annotated, Any, NoReturn

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict
from pydantic_core import PydanticCustomError

from beaver_ftc.documents.docstrings import split_docstring

Location = tuple[int | str, ...]
Conflict = tuple[Location, str]


class Section(BaseModel):
    """A part of a file (scenario, aircraft, model): immutable, strict about its keys, finite in its numbers.

    Lines `name: text` at the end of a section's docstring become the descriptions of its fields in the JSON
    schema, which editors show.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        cls.__doc__, says = split_docstring(cls.__doc__, cls.__annotations__)
        for name, text in says.items():
            cls.__annotations__[name] = Annotated[cls.__annotations__[name], Field(description=text)]


def _whole(value: Any) -> Any:
    """1e4 and 2.0 are accepted as whole numbers."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Number = Annotated[float, Strict()]
Whole = Annotated[int, Strict(), BeforeValidator(_whole)]
Flag = Annotated[bool, Strict()]


def entry(default: Any, says: str | None = None, **limits: Any) -> Any:
    """A field and its description in the JSON schema.

    default: a value, a function that makes one, or ... where the key must be given. says: the description,
    where the section's docstring has none. limits: those of pydantic, and unit; examples, each a value;
    range, a text where limits do not say it; needs, other keys that the example requires.
    """
    how = "default_factory" if callable(default) else "default"
    said: dict[str, Any] = {"description": says} if says else {}
    if shown := {key: limits.pop(key) for key in ("unit", "range", "needs") if key in limits}:
        said["json_schema_extra"] = shown
    return Field(**{how: default}, **said, **limits)


def number(default: Any, unit: str, says: str | None = None, **limits: Any) -> Any:
    """A field of one number, or several alike: the JSON Schema has their unit and meaning."""
    return entry(default, says and f"{says}, {unit}", unit=unit, **limits)


def refuse(conflicts: Iterable[Conflict]) -> None:
    """Raise if values that are each fine contradict one another; every conflict keeps its own location."""
    if found := list(conflicts):
        raise PydanticCustomError("conflict", "contradictory values", {"conflicts": found})


def refuse_unknown(keys: Iterable[Any], known: Iterable[str]) -> None:
    """Raise if there are keys of a mapping that are none of those known."""
    if unknown := list(keys):
        raise PydanticCustomError("unknown_keys", "unknown keys", {"unknown": unknown, "known": list(known)})


def deny(says: str, *at: int | str) -> NoReturn:
    """Raise what is wrong with a value, or with what is below it at these keys."""
    raise PydanticCustomError("conflict", "contradictory values", {"conflicts": [(at, says)]})


def order_conflicts(start_s: float, end_s: float | None, start_key: str) -> list[Conflict]:
    """The conflict of an end that does not come after its start."""
    if end_s is None or end_s > start_s:
        return []
    return [(("end_s",), f"{end_s:g} is not after {start_key}, allowed: later than {start_s:g} s")]
