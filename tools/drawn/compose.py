"""From a row of the covering array to a scenario."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.scenario.faults import TYPES
from beaver_ftc.scenario.schema import json_schema
from beaver_ftc.scenario.sensors import QUANTITIES
from tools.drawn.array import CoveringArray, Row
from tools.drawn.declare import Words, declare, fit
from tools.drawn.factors import (
    DRAWN,
    LEFT_OUT,
    factors_of,
    fault_types,
    grows,
    keys_of,
    registered_of,
    sensor_fault_types,
    together,
)
from tools.drawn.ranges import DECLARED_ONLY, RANGES, size_of_sensor_fault
from tools.drawn.walk import Circumstances, Undrawable, Walk, log_uniform
from tools.schema import Node, inlined

SHORTEST_S, LONGEST_S = 3.0, 6.0
RATES_HZ = {"slow": (20, 40), "usual": (50, 150), "fast": (200, 500)}
COUNTS = {"one": (1, 2), "two": (2, 3), "many": (3, 7)}


@dataclass(frozen=True)
class Kind:
    """A kind of covering array. declared: whether every error of the truth is declared. only: levels to which
    a factor is restricted."""

    declared: bool
    only: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


EVERYTHING = Kind(declared=True)
OURS = Kind(declared=True, only={"scheme": ("adaptive-estimators",)})  # the scheme that promises something
PLAIN = Kind(
    declared=True, only={**OURS.only, "changes": ("-",), "sensor fault": ("-",), "faults": ("one", "none")}
)
UNDECLARED = Kind(declared=False)
KINDS = (EVERYTHING, OURS, PLAIN, PLAIN, UNDECLARED)  # one array after the other


@dataclass(frozen=True)
class Drawn:
    """A scenario by number. declared: whether `fdi.bounds` covers every error of its truth."""

    index: int
    row: Row
    words: Words
    declared: bool

    def scenario(self) -> bf.Scenario:
        """The scenario. Raises BadInput if it cannot be flown."""
        return bf.load(self.words)


def drawn_flights(seed: int, aircraft: Sequence[str], kinds: Sequence[Kind] = KINDS) -> Iterator[Drawn]:
    """One covering array after the other, without end. Flight I of a seed is always the same."""
    schema, index, arrays = inlined(json_schema()), 0, 0
    while True:
        kind = kinds[arrays % len(kinds)]
        array = array_of(schema, aircraft, kind, np.random.default_rng([seed, arrays]))
        for row in array.rows():
            rng = np.random.default_rng([seed, arrays, index])
            words = Composer(schema, row, kind.declared, rng).words()
            words |= {"name": f"drawn-{seed}-{index}", "seed": index}
            yield Drawn(index, row, words, kind.declared)
            index += 1
        arrays += 1


def array_of(schema: Node, aircraft: Sequence[str], kind: Kind, rng: np.random.Generator) -> CoveringArray:
    """The covering array of all factors."""
    schema = inlined(schema)
    factors = [
        replace(factor, levels=kind.only.get(factor.name, factor.levels))
        for factor in factors_of(schema, aircraft, kind.declared)
    ]
    return CoveringArray(factors, together(schema, kind.declared), rng)


@lru_cache(maxsize=8)
def _airframe(reference: str) -> Any:
    return bf.load({"aircraft": reference}).airframe if reference != "beaver" else load("beaver")


class Composer:
    """Makes the scenario of a row."""

    def __init__(self, schema: Node, row: Row, declared: bool, rng: np.random.Generator) -> None:
        self._schema, self._row, self._rng, self._declared = schema, row, rng, declared
        self._aircraft = _airframe(row["aircraft"])
        self._now = Circumstances(rng, self._aircraft, float(rng.uniform(SHORTEST_S, LONGEST_S)))
        self._walk = Walk(DECLARED_ONLY if declared else RANGES, self._now)

    def words(self) -> Words:
        """The scenario as the data of a file."""
        words: Words = {"aircraft": self._row["aircraft"], "duration_s": self._now.duration_s}
        for path, node in keys_of(self._schema):
            self._put_key(words, path, node)
        for part in (self._frame, self._air, self._diagnosis, self._changes, self._faults):
            part(words)
        fit(words)
        if self._declared:
            declare(words)
        return words

    def _put_key(self, words: Words, path: str, node: Node) -> None:
        """Set a key that is a factor by itself."""
        level = self._row.get(path, LEFT_OUT)
        if level == LEFT_OUT or (path.startswith("initial.") and not self._is_of_aircraft(path)):
            return
        value = {"true": True, "false": False}.get(level, level)
        if level == DRAWN:
            try:
                value = self._walk.value(node, path)
            except Undrawable:
                return
        if path.endswith("actuators") and isinstance(value, dict):
            value = self._of_its_surfaces(value)
        put(words, path, value)

    def _of_its_surfaces(self, actuators: Words) -> Words:
        """The actuators without the surfaces of the Beaver that this aircraft does not have: the schema names
        the surfaces of the Beaver."""
        ours = set(load("beaver").surfaces) - set(self._aircraft.surfaces)
        return {key: value for key, value in actuators.items() if key not in ours}

    def _is_of_aircraft(self, path: str) -> bool:
        """Whether the aircraft has this key of the section `initial`."""
        key = path.removeprefix("initial.")
        return (
            key == "altitude_m"
            or key in self._aircraft.engine.settings
            or key.removesuffix("_deg") in self._aircraft.surfaces
        )

    def _frame(self, words: Words) -> None:
        """Write airspeed, rate and substeps."""
        rng, (low, high) = self._rng, self._aircraft.envelope.airspeed_mps
        third = (high - low) / 3.0
        begin = low + ("slow", "middle", "fast").index(self._row["airspeed"]) * third
        put(words, "initial.airspeed_mps", float(rng.uniform(begin + 0.1 * third, begin + 0.9 * third)))
        words["rate_hz"] = float(round(log_uniform(rng, *RATES_HZ[self._row["rate"]])))
        many = self._row["substeps"] == "many"
        words["substeps"] = int(rng.integers(3, 11)) if many else int(self._row["substeps"])

    def _air(self, words: Words) -> None:
        """Write turbulence, and gusts that follow one another."""
        severity, gusts = self._row["air"], self._row["gusts"]
        if severity != LEFT_OUT:
            put(words, "environment.turbulence", "dryden")
            put(words, "environment.severity", severity)
        if gusts == LEFT_OUT:
            return
        node = self._schema["$defs"]["Gust"]
        blown = [self._walk.value(node, "environment.gust") for _ in range(1 if gusts == "one" else 2)]
        for before, after in pairwise(blown):
            lasts_s = before.get("rise_s", 1.0) + before.get("hold_s", 0.0) + before.get("fade_s", 1.0)
            after["at_s"] = before["at_s"] + lasts_s + 0.01
        put(words, "environment.gust", blown[0] if gusts == "one" else blown)

    def _diagnosis(self, words: Words) -> None:
        """Write scheme, law and detectors."""
        put(words, "fdi.scheme", self._row["scheme"])
        put(words, "control.law", self._row["law"])
        detector = self._row["detector"]
        if detector == "worst-case":
            return
        node = self._schema["$defs"]["Statistical"]
        put(words, "fdi.statistical", self._walk.value(node, "fdi.statistical"))
        put(words, "fdi.authority", detector.replace("both, worst-case counts", "worst-case"))

    def _changes(self, words: Words) -> None:
        """Write what changes in flight, and when."""
        level = self._row["changes"]
        if level == LEFT_OUT:
            return
        node = self._schema["$defs"]["Change"]["properties"]
        keys = [key for key in node if key != "at_s"]
        several = level == "several"
        wanted = [list(self._rng.permutation(keys)[:2]) for _ in range(2)] if several else [[level]]
        made = [{key: self._changed(key, node[key]) for key in some} for some in wanted]
        times = sorted(self._walk.value(node["at_s"], "changes.at_s") for _ in made)
        words["changes"] = [{"at_s": at_s, **one} for at_s, one in zip(times, made, strict=True)]

    def _changed(self, key: str, node: Node) -> Any:
        groups = {"law": "beaver_ftc.laws", "scheme": "beaver_ftc.detectors"}
        if key in groups:
            return str(self._rng.choice(registered_of(groups[key])))
        return self._walk.value(node, f"changes.{key}")

    def _faults(self, words: Words) -> None:
        """Write the faults, without those that another one hides."""
        broken = []
        if self._row["faults"] != "none":
            count = int(self._rng.integers(*COUNTS[self._row["faults"]]))
            broken.append(self._fault(self._row["type"], self._row["profile"], int(self._row["surface"])))
            broken += [self._another() for _ in range(count - 1)]
        kind = self._row["sensor fault"]
        if kind != LEFT_OUT:
            broken.append(self._sensor_fault(kind))
        words["faults"] = kept = broken[:1]
        for fault in broken[1:]:
            if not (_is_masked(fault, kept) or any(_is_masked(one, [fault]) for one in kept)):
                kept.append(fault)

    def _another(self) -> Words:
        kind = str(self._rng.choice(list(fault_types(self._schema))))
        courses = ["abrupt", "ended", *(["incipient"] if grows(self._schema, kind) else [])]
        return self._fault(kind, str(self._rng.choice(courses)), int(self._rng.integers(1, 5)))

    def _fault(self, kind: str, profile: str, surface: int) -> Words:
        """A fault with all keys of its type, sometimes without the position of a jam; the profile is that of
        the row."""
        keys = fault_types(self._schema)[kind]["properties"]
        left_out = {"end_s", "profile", "kappa_per_s"}
        if kind == "stuck" and self._rng.random() < 0.3:
            left_out.add("position_deg")

        def drawn(key: str) -> Any:
            return self._walk.value(keys[key], f"faults.{kind}.{key}")

        fault = {key: drawn(key) for key in keys if key not in left_out}
        if "actuator" in fault:
            fault["actuator"] = self._aircraft.surfaces[(surface - 1) % len(self._aircraft.surfaces)]
        if profile == "incipient":
            fault |= {"profile": "incipient", "kappa_per_s": drawn("kappa_per_s")}
        if profile == "ended":
            fault["end_s"] = max(drawn("end_s"), fault["at_s"] + 0.05)
        return fault

    def _sensor_fault(self, kind: str) -> Words:
        """A fault of this type of an instrument that the aircraft has."""
        node = sensor_fault_types(self._schema)[kind]["properties"]
        there = [
            name
            for name in QUANTITIES
            if self._aircraft.has_engine_instruments or name not in ("engine_rpm", "manifold_pressure")
        ]
        sensor = str(self._rng.choice(there))
        fault = {"sensor": sensor, "type": kind, "at_s": self._walk.value(node["at_s"], "faults.sensor.at_s")}
        if "magnitude" in node:
            fault["magnitude"] = size_of_sensor_fault(self._now, sensor, kind)
        if self._rng.random() < 0.2:
            fault["end_s"] = self._walk.value(node["end_s"], "faults.sensor.end_s")
        return fault


def put(words: Words, path: str, value: Any) -> None:
    """Set a key, and make the sections above it."""
    *sections, key = path.split(".")
    for name in sections:
        words = words.setdefault(name, {})
    words[key] = value


def _is_masked(fault: Words, faults: list[Words]) -> bool:
    """Whether another fault of the same surface hides a fault at its beginning; a scenario with such a fault
    is refused."""
    for other in faults:
        same = other is not fault and "actuator" in fault and other.get("actuator") == fault["actuator"]
        if same and other["at_s"] <= fault["at_s"] < other.get("end_s", inf):
            row = TYPES[other["type"]]
            if fault["type"] in row.masks and not (other["type"] == fault["type"] and row.replaces_like):
                return True
    return False
