"""A scenario that is changed while it is flown: as if it had said so from the start."""

from collections.abc import Mapping
from typing import Any

from beaver_ftc.errors import BadInput, suggestion
from beaver_ftc.scenario.autopilot import Autopilot
from beaver_ftc.scenario.given import gust_of
from beaver_ftc.scenario.schema import Scenario


def blown(scenario: Scenario, gust: Mapping[str, Any], now_s: float) -> Scenario:
    """With a gust from now_s on. Raises BadInput that names the key, and for a second one."""
    if scenario.environment.gust is not None:
        raise BadInput("gust: this flight has one already, allowed: one a flight")
    environment = scenario.environment.model_copy(update={"gust": gust_of(gust, now_s)})
    return scenario.model_copy(update={"environment": environment})


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
