"""Any value that a JSON schema allows, drawn at random; what `ranges.py` says of a key goes first."""

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

import numpy as np

from tools.schema import Node

Random = np.random.Generator
GIVEN_SHARE = 0.3  # of the keys of a section that may be left out
FACTOR = 2.0  # a number with a positive default is drawn within this factor of it
MOST_ITEMS = 2
NEVER = "never"
LARGEST = 100.0  # of a number without limits


@dataclass(frozen=True)
class Circumstances:
    """Quantities on which a range may depend."""

    rng: Random
    aircraft: Any  # beaver_ftc.aircraft.Aircraft
    duration_s: float = 5.0


class Ranges:
    """pattern of a key's path -> function of circumstances and path, or NEVER for a key that is left out.
    The first pattern that fits counts. A path has no indices: `faults.at_s`."""

    def __init__(self, given: Mapping[str, Any]) -> None:
        self._given = given

    @cache  # noqa: B019 (there are two, as long as the process)
    def of(self, path: str) -> Any:
        """The range of a path; None if there is none."""
        fitting = (ranged for pattern, ranged in self._given.items() if fnmatchcase(path, pattern))
        return next(fitting, None)


class Undrawable(Exception):
    """The schema does not say which values are allowed."""


class Walk:
    """Draws values that a schema allows."""

    def __init__(self, ranges: Ranges, now: Circumstances) -> None:
        self._ranges, self.now = ranges, now

    def value(self, node: Node, path: str) -> Any:
        """A value for the key at this path. Raises Undrawable."""
        ranged = self._ranges.of(path)
        if callable(ranged):
            return ranged(self.now, path)
        if "const" in node:
            return node["const"]
        if "enum" in node:
            return node["enum"][self.now.rng.integers(len(node["enum"]))]
        forms = node.get("oneOf", () if "properties" in node else node.get("anyOf", ()))
        given = [
            form for form in forms if form.get("type") != "null"
        ]  # null: that is what leaving out is for
        if given:
            return self.value(given[self.now.rng.integers(len(given))], path)
        return self._by_type(node, path)

    def _by_type(self, node: Node, path: str) -> Any:
        kind = node.get("type")
        if kind == "boolean":
            return bool(self.now.rng.random() < 0.5)
        if kind == "integer":
            return round(self._number(node))
        if kind == "number":
            return self._number(node)
        if kind == "array":
            return self._array(node, path)
        if kind == "object" or "properties" in node:
            return self._object(node, path)
        raise Undrawable(path)

    def _number(self, node: Node) -> float:
        """A number near the default if this is positive, else one of the range."""
        low = node.get("minimum", node.get("exclusiveMinimum", -LARGEST))
        high = node.get("maximum", node.get("exclusiveMaximum", max(LARGEST, low + LARGEST)))
        default = node.get("default")
        if isinstance(default, int | float) and default > 0:
            low, high = max(low, default / FACTOR), min(high, default * FACTOR)
            return log_uniform(self.now.rng, low, high)
        span = high - low
        return float(self.now.rng.uniform(low + 1e-6 * span, high - 1e-6 * span))

    def _array(self, node: Node, path: str) -> list[Any]:
        """A list of a few drawn items."""
        if "prefixItems" in node:
            return [self.value(item, path) for item in node["prefixItems"]]
        least, most = node.get("minItems", 1), min(node.get("maxItems", MOST_ITEMS), MOST_ITEMS)
        return [self.value(node["items"], path) for _ in range(self.now.rng.integers(least, most + 1))]

    def _object(self, node: Node, path: str) -> dict[str, Any]:
        """An object with its required keys and some of the others."""
        properties, required = node.get("properties", {}), set(node.get("required", ()))
        if not properties:
            raise Undrawable(path)
        names = [name for name in properties if self._ranges.of(f"{path}.{name}") != NEVER]
        if node.get("maxProperties") == 1:
            wanted = {names[self.now.rng.integers(len(names))]}
        else:
            wanted = required | {name for name in names if self.now.rng.random() < GIVEN_SHARE}
            wanted |= set() if wanted else {names[self.now.rng.integers(len(names))]}
        return {name: self.value(properties[name], f"{path}.{name}") for name in names if name in wanted}


def log_uniform(rng: Random, low: float, high: float) -> float:
    """A number whose logarithm is from a uniform distribution."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
