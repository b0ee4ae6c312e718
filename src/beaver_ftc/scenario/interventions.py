"""What is done to a flight while it is flown: as if its scenario had said so from the start."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.document import Document, Problem, Section, plain
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import validate
from beaver_ftc.scenario.air import Gust
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.autopilot import Autopilot
from beaver_ftc.scenario.expect import OF_A_FAULT
from beaver_ftc.scenario.faults import Fault
from beaver_ftc.scenario.schema import Change, Scenario, validate_scenario
from beaver_ftc.scenario.signals import MAX_ROWS

STICKS = "sticks.csv"  # what such a table is said to come from; its values are in the scenario itself


class _OneFault(Section):
    fault: Fault


class _OneGust(Section):
    gust: Gust


class _OneChange(Section):
    change: Change


OneThing = TypeVar("OneThing", bound=Section)


def _begun(model: type[OneThing], given: Mapping[str, Any], at_s: float, keys: str) -> OneThing:
    """What the mapping describes, as the only field of a model; mistakes are named without that field."""
    (what,) = model.model_fields
    data = plain(given)
    if not isinstance(data, dict):
        raise BadInput(f"{given!r:.60} is no {what}, allowed: a mapping of {keys}")
    if "at_s" in data:
        raise BadInput(f"at_s: has no meaning here, allowed: a {what} that begins now, at {at_s:g} s")
    try:
        return validate(model, Document({what: {**data, "at_s": at_s}}), "")
    except ScenarioError as error:
        problems = [Problem(one.line, one.location[1:], one.says) for one in error.problems]
        raise ScenarioError("", problems) from None


def fault_of(given: Mapping[str, Any], at_s: float) -> Fault:
    """The fault that a mapping without `at_s` describes, from at_s on. Raises BadInput with the key."""
    return _begun(_OneFault, given, at_s, "`type`, `actuator` and its size").fault


def is_same_again(new: Fault, known: Fault) -> bool:
    """Whether a fault that does not add to its like is there already, to stay."""
    begun = known.type == new.type and known.at_s <= new.at_s
    alike = known == new.model_copy(update={"at_s": known.at_s})
    return bool(begun and not getattr(new, "adds", True) and alike)


def in_force(faults: Sequence[Fault], end_s: float) -> tuple[Fault, ...]:
    """Those that were there in a flight up to end_s."""
    return tuple(
        fault for fault in faults if fault.at_s < end_s and (fault.end_s is None or fault.end_s > fault.at_s)
    )


def with_gust(scenario: Scenario, gust: Mapping[str, Any], now_s: float) -> Scenario:
    """With a gust from now_s on. Raises BadInput that names the key, and while another one blows."""
    new = _begun(_OneGust, gust, now_s, "`velocity_mps` and its times").gust
    known = scenario.environment.gusts
    for other in known:
        if other.at_s < new.end_s and now_s < other.end_s:
            says = f"another one blows from {other.at_s:g} to {other.end_s:g} s, allowed: one at a time"
            raise BadInput(f"gust: {says}")
    gusts = sorted((*known, new), key=lambda each: each.at_s)
    return scenario.with_({"environment.gust": gusts if known else new})


def with_change(scenario: Scenario, change: Mapping[str, Any], now_s: float) -> Scenario:
    """With a change of law, diagnosis or sensors from now_s on; what was changed at that very instant and is
    not named again stays. Raises BadInput that names the key."""
    new = _begun(_OneChange, change, now_s, "law, scheme, sensors or declared_sensors").change
    given = {key: value for key, value in new if value is not None}
    by_time = {each.at_s: each for each in scenario.changes}
    by_time[now_s] = by_time.get(now_s, new).model_copy(update=given)
    return scenario.with_({"changes": [by_time[at_s] for at_s in sorted(by_time)]})


def with_targets(scenario: Scenario, targets: Mapping[str, float], now_s: float) -> Scenario:
    """With a leg from now_s on for each channel of the autopilot that is named; its later legs are dropped.

    Raises BadInput that names the key, and for a flight that has begun without an autopilot.
    """
    if scenario.autopilot is None or not scenario.autopilot.channels:
        raise BadInput("autopilot: this flight has none, allowed: a scenario with `autopilot`")
    known = tuple(Autopilot.model_fields)
    changes = {}
    for channel, value in targets.items():
        if channel not in known:
            raise BadInput(f"autopilot: {channel!r:.60} is not known{suggestion(str(channel), known)}")
        flown = [leg for leg in getattr(scenario.autopilot, channel) if leg.at_s < now_s]
        changes[f"autopilot.{channel}"] = [*flown, {"at_s": now_s, "value": value}]
    return scenario.with_(changes)


class StickTrack:
    """What was added to the reference, frame by frame; only changes are kept."""

    def __init__(self) -> None:
        self._changes: list[tuple[int, tuple[float, float, float]]] = [(0, (0.0, 0.0, 0.0))]

    def move(self, k: int, rate_deg_s: NDArray[np.float64] | None) -> None:
        """From frame k on, (3,) deg/s; None is none."""
        p, q, r = (0.0, 0.0, 0.0) if rate_deg_s is None else map(float, rate_deg_s)
        if self._changes[-1][1] != (p, q, r):
            if self._changes[-1][0] == k:
                self._changes.pop()
            self._changes.append((k, (p, q, r)))

    @property
    def moved(self) -> bool:
        """Whether anything was ever added."""
        return len(self._changes) > 1 or any(self._changes[0][1])

    def tables(self, rate_hz: float) -> Iterator[tuple[str, list[float], list[float]]]:
        """(axis, times s, rates deg/s) of each axis that was moved: flat between changes, so that straight
        lines give every frame its value to the bit."""
        for i, axis in enumerate(AXES):
            knots: dict[int, float] = {}
            value = 0.0
            for k, rates in self._changes:
                if k > 0 and rates[i] != value:
                    knots[k - 1] = value
                if k == 0 or rates[i] != value:
                    knots[k] = rates[i]
                value = rates[i]
            if any(knots.values()):
                yield axis, [k / rate_hz for k in knots], list(knots.values())


def scenario_flown(scenario: Scenario, faults: Sequence[Fault], stick: StickTrack, frames: int) -> Scenario:
    """The scenario that flies so many frames again, with these faults and what the stick added.

    Raises BadInput where the stick moved too often for a table.
    """
    end_s = frames / scenario.rate_hz
    data = scenario.model_dump(mode="json", by_alias=True, exclude_unset=True)
    data["duration_s"] = end_s
    data["faults"] = [_dump(fault) for fault in in_force(faults, end_s)]
    if scenario.changes:
        data["changes"] = [_dump(change) for change in scenario.changes if change.at_s < end_s]
    if not data["faults"]:
        expect = data.get("expect", {})
        data["expect"] = {key: value for key, value in expect.items() if key not in OF_A_FAULT}
    for axis, times_s, rates_deg_s in stick.tables(scenario.rate_hz):
        if len(times_s) > MAX_ROWS:
            raise BadInput(
                f"the stick moved too often on {axis}, allowed: {MAX_ROWS // 2} times in a scenario"
            )
        table = {"file": STICKS, "column": axis, "time_s": times_s, "values_deg_s": rates_deg_s}
        reference = data.setdefault("reference", {})
        reference[axis] = [*reference.get(axis, []), {"csv": table}]
    with checked_against(scenario.airframe, scenario.aircraft):
        return validate_scenario(Document(data))


def _dump(entry: Section) -> dict[str, Any]:
    return entry.model_dump(mode="json", exclude_unset=True)
