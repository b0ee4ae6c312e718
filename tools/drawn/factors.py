"""The factors of the covering array: the keys of a scenario, down to two levels, and combinations of keys.

A key of the schema is a factor with the levels `-` (left out), each value of an enumeration, `true` and
`false`, or `drawn`. Factors that several keys express together, or whose levels the schema does not list, are
those of `_own`.
"""

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from beaver_ftc.plugins import DETECTORS, LAWS, OURS, registered
from tools.data import yaml_of
from tools.drawn.array import Factor, Forbidden
from tools.drawn.ranges import DECLARED_ONLY, RANGES
from tools.drawn.walk import NEVER
from tools.schema import Node

LEFT_OUT, DRAWN = "-", "drawn"
TOGETHER = Path(__file__).with_name("together.yaml")
STRUCK = frozenset({"one", "two", "many"})
WHOLE = ("expect",)  # sections of which a few keys are drawn together
DEEPER = ("fdi.bounds",)  # sections in a section whose keys are factors as well
# Keys that a factor of `OWN` stands for.
SPOKEN_FOR = (
    "aircraft", "duration_s", "seed", "rate_hz", "substeps", "initial.airspeed_mps", "faults", "changes",
    "environment.turbulence", "environment.severity", "environment.gust", "fdi.statistical", "fdi.authority",
    "fdi.scheme", "control.law", "fdi.bounds.sensors",
)  # fmt: skip


def factors_of(schema: Node, aircraft: Sequence[str], declared: bool) -> list[Factor]:
    """All factors. declared: whether the flights declare every error."""
    ranges = DECLARED_ONLY if declared else RANGES
    of_keys = [
        Factor(path, (LEFT_OUT, *levels))
        for path, node in keys_of(schema)
        if path not in SPOKEN_FOR and ranges.of(path) != NEVER and (levels := levels_of(node))
    ]
    return [*_own(schema, aircraft), *of_keys]


def keys_of(node: Node, path: str = "") -> Iterator[tuple[str, Node]]:
    """Yield path and schema of every key that is a factor by itself."""
    for name, below in node["properties"].items():
        inside, here = section_of(below), f"{path}.{name}" if path else name
        if inside and here not in WHOLE and (not path or here in DEEPER):
            yield from keys_of(inside, here)
        else:
            yield here, below


def section_of(node: Node) -> Node | None:
    """The schema of a key that can only be a section; None for another key."""
    forms = [form for form in forms_of(node) if form.get("type") != "null"]
    return forms[0] if len(forms) == 1 and "properties" in forms[0] and "anyOf" not in forms[0] else None


def forms_of(node: Node) -> list[Node]:
    """The schemas of the values that are allowed."""
    inside = node.get("anyOf") or node.get("oneOf")
    if not inside or "properties" in node:
        return [node]
    return [form for one in inside for form in forms_of(one)]


def levels_of(node: Node) -> tuple[str, ...]:
    """The levels of a key: the values of an enumeration, `true` and `false`, or `drawn`."""
    levels: list[str] = []
    for form in forms_of(node):
        if form.get("type") == "boolean":
            levels += ["true", "false"]
        elif "enum" in form:
            levels += map(str, form["enum"])
        elif form.get("type") != "null":
            levels.append(DRAWN)
    return tuple(dict.fromkeys(levels))


def _own(schema: Node, aircraft: Sequence[str]) -> Iterator[Factor]:
    """The factors that no key of the schema is by itself."""
    at_fault = {"faults": STRUCK}
    change = schema["$defs"]["Change"]["properties"]
    yield Factor("aircraft", tuple(aircraft))
    yield Factor("airspeed", ("middle", "slow", "fast"))
    yield Factor("rate", ("usual", "slow", "fast"))
    yield Factor("substeps", ("1", "2", "many"))
    severity = schema["$defs"]["Environment"]["properties"]["severity"]
    yield Factor("air", (LEFT_OUT, *levels_of(severity)))
    yield Factor("gusts", (LEFT_OUT, "one", "several"))
    yield Factor("detector", ("worst-case", "statistical", "either", "both, worst-case counts"))
    yield Factor("scheme", registered_of(DETECTORS))
    yield Factor("law", registered_of(LAWS))
    yield Factor("changes", (LEFT_OUT, *(key for key in change if key != "at_s"), "several"))
    yield Factor("faults", ("none", *sorted(STRUCK)))
    yield Factor("type", tuple(fault_types(schema)), at_fault)
    yield Factor("profile", ("abrupt", "incipient", "ended"), at_fault)
    yield Factor("surface", ("1", "2", "3", "4"), at_fault)
    yield Factor("sensor fault", (LEFT_OUT, *sensor_fault_types(schema)))


@cache
def registered_of(group: str) -> tuple[str, ...]:
    """Names of our own detectors or laws, the compiled ones first."""
    return tuple(name for name, entry in registered(group).items() if entry.package == OURS)


def fault_types(schema: Node) -> dict[str, Node]:
    """Fault type of a surface, or of the aircraft -> its schema; not damage, which none of these declares."""
    variants = forms_of(schema["properties"]["faults"]["items"])
    of_ours = (one for one in variants if not {"sensor", "case"} & one["properties"].keys())
    return {one["properties"]["type"]["const"]: one for one in of_ours}


def sensor_fault_types(schema: Node) -> dict[str, Node]:
    """Fault type of an instrument -> its schema."""
    variants = forms_of(schema["properties"]["faults"]["items"])
    return {one["properties"]["type"]["const"]: one for one in variants if "sensor" in one["properties"]}


def grows(schema: Node, kind: str) -> bool:
    """Whether a fault of this type can be incipient."""
    return "incipient" in fault_types(schema)[kind]["properties"]["profile"].get("enum", ())


class Levels:
    """Some levels of a factor: `a, b`, or `not a, b` for all others."""

    def __init__(self, words: str) -> None:
        self._others = words.startswith("not ")
        self._named = words.removeprefix("not ").split(", ")

    def __contains__(self, level: str) -> bool:
        return (level in self._named) != self._others


def together(schema: Node, declared: bool) -> Forbidden:
    """Which levels together.yaml rules out, and what of a jam cannot grow."""
    rules = [
        (name, Levels(levels), other, Levels(there))
        for rule in yaml_of(TOGETHER)
        if declared or not rule.get("declared")
        for name, levels in rule["if"].items()
        for other, there in rule["then"].items()
    ]
    switched = [kind for kind in fault_types(schema) if not grows(schema, kind)]
    rules.append(("type", Levels(", ".join(switched)), "profile", Levels("not incipient")))

    def forbidden(name: str, level: str, other: str, there: str) -> bool:
        return any(
            name == first and level in levels and fnmatchcase(other, second) and there not in allowed
            for first, levels, second, allowed in rules
        )

    return forbidden
