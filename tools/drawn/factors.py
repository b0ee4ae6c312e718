"""The factors of the covering array: every key of a scenario, down to two levels, and what only several say.

A key that the schema has is a factor with the levels `-` (left out), each value of an enumeration, `true` and
`false`, or `drawn`. What is said by several keys together, or has no list in the schema, stands in `OWN`.
"""

from collections.abc import Iterator, Sequence
from functools import cache

from beaver_ftc.plugins import DETECTORS, LAWS, OURS, registered
from tools.drawn.array import Factor
from tools.drawn.ranges import DECLARED_ONLY, RANGES
from tools.drawn.walk import Node

LEFT_OUT, DRAWN = "-", "drawn"
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
    """Every factor. declared: of flights whose every error is declared."""
    ranges = DECLARED_ONLY if declared else RANGES
    of_keys = [
        Factor(path, (LEFT_OUT, *levels))
        for path, node in keys_of(schema)
        if path not in SPOKEN_FOR and not ranges.never_given(path) and (levels := levels_of(schema, node))
    ]
    return [*_own(schema, aircraft), *of_keys]


def keys_of(schema: Node, node: Node | None = None, path: str = "") -> Iterator[tuple[str, Node]]:
    """(path, schema) of every key that is a factor by itself."""
    for name, below in (node or schema)["properties"].items():
        inside, here = section_of(schema, below), f"{path}.{name}" if path else name
        if inside and here not in WHOLE and (not path or here in DEEPER):
            yield from keys_of(schema, inside, here)
        else:
            yield here, below


def section_of(schema: Node, node: Node) -> Node | None:
    """The keys under a key that has nothing but keys under it."""
    forms = [form for form in forms_of(schema, node) if form.get("type") != "null"]
    return forms[0] if len(forms) == 1 and "properties" in forms[0] and "anyOf" not in forms[0] else None


def forms_of(schema: Node, node: Node) -> list[Node]:
    """What may stand there, references followed."""
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    inside = node.get("anyOf") or node.get("oneOf")
    if not inside or "properties" in node:
        return [node]
    return [form for one in inside for form in forms_of(schema, one)]


def levels_of(schema: Node, node: Node) -> tuple[str, ...]:
    """Values of an enumeration, true and false, or `drawn`."""
    levels: list[str] = []
    for form in forms_of(schema, node):
        if form.get("type") == "boolean":
            levels += ["true", "false"]
        elif "enum" in form:
            levels += map(str, form["enum"])
        elif form.get("type") != "null":
            levels.append(DRAWN)
    return tuple(dict.fromkeys(levels))


def _own(schema: Node, aircraft: Sequence[str]) -> Iterator[Factor]:
    at_fault = {"faults": STRUCK}
    change = schema["$defs"]["Change"]["properties"]
    yield Factor("aircraft", tuple(aircraft))
    yield Factor("airspeed", ("middle", "slow", "fast"))
    yield Factor("rate", ("usual", "slow", "fast"))
    yield Factor("substeps", ("1", "2", "many"))
    yield Factor("air", (LEFT_OUT, *severities(schema)))
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


def severities(schema: Node) -> tuple[str, ...]:
    """Of turbulence."""
    return levels_of(schema, schema["$defs"]["Environment"]["properties"]["severity"])


def fault_types(schema: Node) -> dict[str, Node]:
    """Fault type of a surface, or of the aircraft -> its schema; not damage, which none of these declares."""
    variants = forms_of(schema, schema["properties"]["faults"]["items"])
    of_ours = (one for one in variants if not {"sensor", "case"} & one["properties"].keys())
    return {one["properties"]["type"]["const"]: one for one in of_ours}


def sensor_fault_types(schema: Node) -> dict[str, Node]:
    """Fault type of an instrument -> its schema."""
    variants = forms_of(schema, schema["properties"]["faults"]["items"])
    return {one["properties"]["type"]["const"]: one for one in variants if "sensor" in one["properties"]}


def grows(schema: Node, kind: str) -> bool:
    """Whether a fault of this type may be incipient."""
    return "incipient" in fault_types(schema)[kind]["properties"]["profile"].get("enum", ())


# What goes with the published scheme.
_AS_PUBLISHED = {
    "detector": ("worst-case",), "fdi.fault_class": (LEFT_OUT, "published"),
    "fdi.pairs": (LEFT_OUT, "false"), "fdi.sensor_monitor": (LEFT_OUT, "auto", "never"),
    "fdi.probing": (LEFT_OUT,),
    "fdi.thresholds": (LEFT_OUT, "published"), "fdi.sharpen": (LEFT_OUT, "none"),
}  # fmt: skip
MOVING_AIR = ("air", "gusts", "environment.wind_mps")
NOISY = ("tactical-grade", "consumer-grade", DRAWN)


class Together:
    """What may not stand together in one scenario."""

    def __init__(self, schema: Node, declared: bool) -> None:
        self._switched = {kind for kind in fault_types(schema) if not grows(schema, kind)}
        self._declared = declared

    def forbidden(self, name: str, level: str, other: str, there: str) -> bool:
        """Whether the schema, or what is promised, rules out the pair. Asked both ways."""
        rules = (
            self._derived,
            self._faults,
            self._keys,
            *((self._promises_nothing,) if self._declared else ()),
        )
        return any(rule(name, level, other, there) for rule in rules)

    @staticmethod
    def _derived(name: str, level: str, other: str, there: str) -> bool:
        """Other aircraft than ours: in still air, with three surfaces, and nothing known of their thrust."""
        if name != "aircraft" or level == "beaver":
            return False
        lacking = (*MOVING_AIR, "autopilot.airspeed_mps", "fdi.probing")
        if other in lacking or other.startswith("uncertainty."):
            return there != LEFT_OUT
        if (
            other == "fdi.bounds.turbulence"
        ):  # declared: the vanes are asked, and the forces are not known well
            return there not in (LEFT_OUT, "none")
        return (other, there) in (("surface", "4"), ("fdi.pairs", "true"))

    def _faults(self, name: str, level: str, other: str, there: str) -> bool:
        """A jam does not grow; what is declared constant is there from its start to the end."""
        if (name, other) == ("type", "profile"):
            return level in self._switched and there == "incipient"
        return (name, level, other) == ("fdi.fault_profile", "abrupt", "profile") and there != "abrupt"

    @classmethod
    def _keys(cls, name: str, level: str, other: str, there: str) -> bool:
        """What the schema's own checks refuse."""
        if (name, other) == ("autopilot.heading_deg", "autopilot.bank_deg"):
            return LEFT_OUT not in (level, there)
        if (name, level) == ("scheme", "zhang2005"):
            return there not in _AS_PUBLISHED.get(other, (there,))
        return (name, level) == ("fdi.pairs", "true") and cls._not_with_pairs(other, there)

    @staticmethod
    def _not_with_pairs(other: str, there: str) -> bool:
        varying = {"sensors": NOISY, "changes": ("sensors", "declared_sensors", "several")}
        return (other == "fdi.fault_class" and there != "all") or there in varying.get(other, ())

    @staticmethod
    def _promises_nothing(name: str, level: str, other: str, there: str) -> bool:
        """A gust is not declared to the watch of the instruments, and `never` watches none."""
        watched = (other, there) in (("fdi.sensor_monitor", "always"), ("fdi.fault_class", "all"))
        if name == "gusts" and level != LEFT_OUT:
            return watched
        return (
            (name, level) == ("fdi.sensor_monitor", "never") and other == "sensor fault" and there != LEFT_OUT
        )
