"""What an earlier revision made of a case, kept below tests/kept/: nothing of it changes unseen.

Whether it is right the other tests say, and people who read it: figures, pages and tables were looked at
before they were kept. `pytest --keep` writes anew what differs; read the difference before you commit it.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from decimal import Decimal
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).with_name("kept")
RELATIVE, ABSOLUTE, DIGITS = 1e-6, 1e-9, 9
_ROUNDED = re.compile(r"\d+\.\d+(?:e[+-]?\d+)?|\d+e[+-]?\d+")
_EMBEDDED = re.compile(r"data:[a-z/+-]+;base64,[A-Za-z0-9+/=]+")
TOLD: list[Callable[[str, Any, Any, float | None], None]] = []
"""Who is told of each kept value that is not found again to the last digit: its path, what is kept, what is
found, and the difference of two numbers as a share of the tolerance.
"""
_INNERMOST = re.compile(r"\[\n[^\[\]{}]*\n *\]")  # lists of numbers or words, as JSON writes them


def differences(name: str, found: Any, anew: bool = False, relative: float = RELATIVE) -> list[str]:
    """From the document kept under this name. anew: keep this one instead. relative: the tolerance of a
    number."""
    file, found = FOLDER / f"{name}.json", _plain(found)
    if anew:
        if not file.exists() or any(_differences(json.loads(file.read_text()), found, relative)):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(
                _INNERMOST.sub(_on_a_line, json.dumps(found, indent=1, ensure_ascii=False)) + "\n"
            )
        return []
    if not file.exists():
        return [f"{name}: nothing is kept; pytest --keep"]
    return list(_differences(json.loads(file.read_text()), found, relative, name))


class Fields(dict[str, Any]):
    """Numbers of a record by their paths. One that is absent is zero."""


def _on_a_line(found: re.Match[str]) -> str:
    return re.sub(r"\n *", " ", found[0]).replace("[ ", "[").replace(" ]", "]")


def _plain(value: Any) -> Any:
    """A document of JSON's own types; floats rounded, those that are none by name."""
    match value:
        case Fields():
            return Fields({key: _plain(inner) for key, inner in value.items()})
        case Mapping():
            return {str(key): _plain(inner) for key, inner in value.items()}
        case list() | tuple() | set() | frozenset():
            return [_plain(one) for one in (sorted(value) if isinstance(value, set | frozenset) else value)]
        case np.ndarray() | np.generic():
            return _plain(value.tolist())
        case float() if isfinite(value):
            return float(f"{value:.{DIGITS}g}")
    return value if isinstance(value, int | None) else str(value)


def _differences(kept: Any, found: Any, relative: float, path: str = "", size: float = 0.0) -> Iterator[str]:
    """size: of the largest number beside it, in the unit of the number."""
    if isinstance(kept, dict) and isinstance(found, dict):
        for key in kept | found:
            absent = _zero(kept.get(key, found.get(key))) if isinstance(found, Fields) else "-"
            yield from _differences(kept.get(key, absent), found.get(key, absent), relative, f"{path}.{key}")
    elif isinstance(kept, list) and isinstance(found, list) and len(kept) == len(found):
        size = max((abs(one) for one in kept if isinstance(one, float) and isfinite(one)), default=0.0)
        for i, (before, now) in enumerate(zip(kept, found, strict=True)):
            yield from _differences(before, now, relative, f"{path}[{i}]", size)
    elif kept != found or type(kept) is not type(found):
        if isinstance(kept, str) and isinstance(found, str) and _reads_the_same(kept, found):
            return
        share = _share(kept, found, size, relative)
        for told in TOLD:
            told(path, kept, found, share)
        if share is None or share > 1.0:
            yield f"{path}: {str(kept)[:200]} -> {str(found)[:200]}"


def _zero(like: Any) -> Any:
    """What an array or number that is zero to the last digit would have been kept as. An array whose sums are
    zero was kept because not all of it is finite.
    """
    if isinstance(like, list):
        return [0.0, 0.0, like[-1]] if any(like[:2]) else "-"
    return type(like)(0)


def _reads_the_same(kept: str, found: str) -> bool:
    """Whether two texts differ in nothing but numbers with a point or an exponent, each of these by at most
    a unit of the last digit, or ABSOLUTE.
    """
    if _ROUNDED.sub("#", kept) != _ROUNDED.sub("#", found):
        return False
    pairs = zip(map(Decimal, _ROUNDED.findall(kept)), map(Decimal, _ROUNDED.findall(found)), strict=True)
    return all(abs(a - b) <= max(Decimal(10) ** a.as_tuple().exponent, Decimal(ABSOLUTE)) for a, b in pairs)


def _share(kept: Any, found: Any, size: float, relative: float) -> float | None:
    """The difference as a share of the tolerance; None if these are not two numbers."""
    if not (isinstance(kept, float) and isinstance(found, float)):
        return None
    return abs(kept - found) / max(ABSOLUTE * max(1.0, size), relative * max(abs(kept), abs(found)))


def in_short(array: Any) -> list[float]:
    """An array of numbers in three: the sums, by weights that differ, of those above and of those below zero,
    and how many are finite. A complex number is two.
    """
    parts = [array.real, array.imag] if np.iscomplexobj(array) else array
    flat = np.asarray(parts, float).ravel()
    finite = np.isfinite(flat)
    numbers = np.where(finite, flat, 0.0)
    weighted = numbers * (1.0 + 0.618034 * np.arange(1, flat.size + 1) % 1.0)
    return [float(weighted[numbers > 0].sum()), float(weighted[numbers < 0].sum()), int(finite.sum())]


def of_record(record: np.ndarray, path: str = "") -> Fields:
    """Every field of a record that is not zero, by its path: a number as it is, an array in short."""
    if record.dtype.names:
        return Fields(
            (key, value)
            for name in record.dtype.names
            for key, value in of_record(record[name], f"{path}.{name}" if path else name).items()
        )
    array = np.asarray(record)
    if not array.any():
        return Fields()
    return Fields({path: array.item() if array.size == 1 else in_short(array)})


_WORDS = ("title", "description", "discriminator")


def keys_of(schema: dict[str, Any]) -> dict[str, dict[str, str]]:
    """Of each section of a JSON Schema what its keys may be, without the words: a line a key."""
    sections = {**schema.get("$defs", {}), schema["title"]: schema}
    return {
        name: {key: json.dumps(_limits(value)) for key, value in of.get("properties", {}).items()}
        | {"(required)": " ".join(of.get("required", []))}
        for name, of in sections.items()
    }


def _limits(node: Any) -> Any:
    if isinstance(node, dict):
        said = {key: _limits(value) for key, value in node.items() if key not in _WORDS}
        return said.get("anyOf", said) if set(said) == {"anyOf"} else said
    return list(map(_limits, node)) if isinstance(node, list) else _plain(node)


def page(text: str) -> list[str]:
    """The lines of a page without the pictures in it."""
    return [line.rstrip() for line in _EMBEDDED.sub("data:", text).splitlines() if line.strip()]
