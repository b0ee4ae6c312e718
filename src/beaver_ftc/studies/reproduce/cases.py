"""The flights of the published study, further ones for comparison, and the changes of their setting.

    case      a published flight: a change of the published setting, such as a fault, by name
    setting   a change for all cases: a choice that the paper leaves open, another condition, another gain
    flown     a case in a setting (flown.py)

Choices that the paper leaves open are changed, one in each setting, and all statements are tested again, to
show whether the conclusions depend on the choices.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import measure
from beaver_ftc.studies.reproduce.choices import FAULT_AT_S, GIVEN, data_of, gains, scenario
from beaver_ftc.studies.reproduce.flown import Flown

PUBLISHED_LOSS = 0.4  # share of the effectiveness
AFTER_S = 18.0  # time that is flown after the fault


Changes = Mapping[str, Any]
"""Values by dotted key of a scenario."""


@dataclass(frozen=True)
class Changed:
    """A change of the published setting. shown_in: its place in the paper, or empty."""

    name: str
    changes: Changes
    shown_in: str = ""


_FILE = data_of("cases.yaml")
PUBLISHED, VARIANTS = (
    tuple(Changed(name, changes, _FILE["shown_in"].get(name, "")) for name, changes in _FILE[these].items())
    for these in ("published", "variants")
)
OURS: Changes = _FILE["ours"]  # selects our default scheme and law
GAINS = tuple(  # every gain of the published scheme and law, halved and doubled
    Changed(f"{gain.key.split('.')[0]} {gain.name} {how}", {gain.key: share * gain.default})
    for gain in gains()
    for how, share in (("halved", 0.5), ("doubled", 2.0))
)
CASES = {case.name: case for case in PUBLISHED}
HEALTHY = Changed("fault-free", {})
AIRSPEEDS_MPS = (32.0, 36.0, 40.0, 43.0, 47.0, 54.0)
SIZES = (0.1, 0.2, 0.6, 0.8, 1.0)  # share of the effectiveness that a published loss takes
INSTANTS_S = (10.75, 13.0, 14.5)  # begins of the fault, at different phases of the references
SIZE, AT = "published loss", "instant of the fault"  # keys of a setting that change the faults of a case
EDGES = tuple(  # every combination of the ends and the centre of the published range on the axes
    Changed("theta " + ", ".join(f"{theta:+g}" for theta in corner),
            {"uncertainty.inertia_coupling": dict(zip(AXES, corner, strict=True))})
    for corner in product((-0.25, 0.0, 0.25), repeat=3)
)  # fmt: skip
CORNERS = tuple(  # all axes at an end of the range, or all at 0
    edge
    for edge in EDGES
    if set(map(abs, edge.changes["uncertainty.inertia_coupling"].values())) in ({0.25}, {0.0})
)
BEYOND = (
    *CORNERS,
    *(Changed(f"airspeed {v:g} m/s", {"initial.airspeed_mps": v}) for v in AIRSPEEDS_MPS),
    *(Changed(f"losses of {size:.0%}".replace("%", " %"), {SIZE: size}) for size in SIZES),
    *(Changed(f"fault at {at_s:g} s", {AT: at_s}) for at_s in INSTANTS_S),
)
AS_PUBLISHED = Changed("as published", {})
ELSEWHERE = (*BEYOND, *VARIANTS, *GAINS)  # settings that the paper did not fly


def fly_case(case: Changed, changes: Changes | None = None) -> Flown:
    """Fly a case in a setting. changes: of the setting."""
    return _fly(case.name, keys_of(case, changes or {}))


def keys_of(case: Changed, changes: Changes) -> Document:
    """The keys of the scenario of a case in a setting. Cases with the same keys are the same flight.

    A setting may change the size of the published loss, and the begin of the fault. AFTER_S are flown after
    it.
    """
    keys = _without_unused({**case.changes, **changes})
    size = keys.pop(SIZE, PUBLISHED_LOSS)
    at_s = keys.pop(AT, FAULT_AT_S)
    keys["duration_s"] = AFTER_S + at_s
    if "faults" in keys:
        keys["faults"] = [_struck(fault, size, at_s) for fault in keys["faults"]]
    return keys


def _struck(fault: Changes, size: float, at_s: float) -> Document:
    """A fault that begins at `at_s`; the published loss has this size."""
    changed = {"magnitude": size} if fault.get("magnitude") == PUBLISHED_LOSS else {}
    return {**fault, **changed, "at_s": at_s}


def _fly(name: str, keys: Changes) -> Flown:
    """Fly the published setting with these keys."""
    log = Columns()
    flight = fly(scenario(name, keys), log)
    return Flown(measure(flight), log, flight.scenario)


class LazyFlights(dict[str, Flown]):
    """The published cases in a setting, by name. A case is flown when it is first used.

    flown: flights of all settings by their keys, so that a flight that two settings share is flown once.
    """

    def __init__(self, changes: Changes, flown: dict[str, Flown]) -> None:
        super().__init__()
        self._changes = changes
        self._flown = flown

    def __missing__(self, name: str) -> Flown:
        keys = keys_of(CASES[name], self._changes)
        key = repr(sorted(keys.items()))
        if key not in self._flown:
            self._flown[key] = _fly(name, keys)
        return self._flown[key]


def _without_unused(changes: Changes) -> Document:
    """The changes, without options of the published scheme or law if the changes select another one."""
    unused = tuple(
        f"{options}."
        for chosen, options in (("fdi.scheme", "fdi.options"), ("control.law", "control.options"))
        if changes.get(chosen, GIVEN[chosen]) != GIVEN[chosen]
    )
    return {key: value for key, value in changes.items() if not key.startswith(unused)}
