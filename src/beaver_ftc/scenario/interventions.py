"""Interventions while a scenario is flown: gust, targets, law; as if it had said so from the start."""

from collections.abc import Iterator, Mapping
from typing import Any

from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.scenario.autopilot import Autopilot
from beaver_ftc.scenario.change import Change
from beaver_ftc.scenario.given import change_of, gust_of
from beaver_ftc.scenario.schema import Scenario


def blown(scenario: Scenario, gust: Mapping[str, Any], now_s: float) -> Scenario:
    """With a gust from now_s on. Raises BadInput that names the key, and while another one blows."""
    new, known = gust_of(gust, now_s), scenario.environment.gusts
    for other in known:
        if other.at_s < new.end_s and now_s < other.end_s:
            says = f"another one blows from {other.at_s:g} to {other.end_s:g} s, allowed: one at a time"
            raise BadInput(f"gust: {says}")
    gusts = sorted((*known, new), key=lambda each: each.at_s)
    return scenario.with_({"environment.gust": gusts if known else new})


def changed(scenario: Scenario, change: Mapping[str, Any], now_s: float) -> Scenario:
    """With a change of law, diagnosis or sensors from now_s on; what was changed at that very instant and is
    not named again stays. Raises BadInput that names the key."""
    new = change_of(change, now_s)
    given = {key: value for key, value in new if value is not None}
    by_time = {each.at_s: each for each in scenario.changes}
    by_time[now_s] = by_time.get(now_s, new).model_copy(update=given)
    return scenario.with_({"changes": [by_time[at_s] for at_s in sorted(by_time)]})


def stages(scenario: Scenario) -> Iterator[tuple[Change, Scenario]]:
    """(change, the scenario as it is from then on) for each change, in order.

    Options belong to the law or scheme that the scenario begins with: another one has its defaults.
    """
    now = scenario
    for change in scenario.changes:
        now = _as_changed(now, change, scenario)
        yield change, now


def _as_changed(now: Scenario, change: Change, given: Scenario) -> Scenario:
    changes: dict[str, Any] = {}
    if change.law is not None:
        options = given.control.options if change.law == given.control.law else {}
        changes["control"] = now.control.model_copy(update={"law": change.law, "options": options})
    fdi = now.fdi
    if change.scheme is not None:
        options = given.fdi.options if change.scheme == given.fdi.scheme else {}
        fdi = fdi.model_copy(update={"scheme": change.scheme, "options": options})
    if change.declared_sensors is not None:
        bounds = fdi.bounds.model_copy(update={"sensors": change.declared_sensors})
        fdi = fdi.model_copy(update={"bounds": bounds})
    if change.sensors is not None:
        changes["sensors"] = change.sensors
    return now.model_copy(update={**changes, "fdi": fdi})


def aimed(scenario: Scenario, targets: Mapping[str, float], now_s: float) -> Scenario:
    """With a leg from now_s on for each channel of the autopilot that is named; its later legs are dropped.

    Raises BadInput that names the key, and for a flight that has begun without an autopilot.
    """
    if scenario.autopilot is None or not scenario.autopilot.channels:
        raise BadInput("autopilot: this flight has none, allowed: a scenario with `autopilot`")
    known, changes = tuple(Autopilot.model_fields), {}
    for channel, value in targets.items():
        if channel not in known:
            raise BadInput(f"autopilot: {channel!r:.60} is not known{suggestion(str(channel), known)}")
        flown = [leg for leg in getattr(scenario.autopilot, channel) if leg.at_s < now_s]
        changes[f"autopilot.{channel}"] = [*flown, {"at_s": now_s, "value": value}]
    return scenario.with_(changes)
