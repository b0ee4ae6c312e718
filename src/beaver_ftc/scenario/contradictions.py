"""Contradictions between the sections of a scenario.

They are looked for in a finished scenario and in a half-wrong file's data alike, so that a contradiction is
reported along with the mistakes of the sections and not only after they are mended. What cannot be read is
unknown, for instance because it is itself a mistake, and contradicts nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import isfinite
from typing import Any

from beaver_ftc.documents.document import Conflict
from beaver_ftc.scenario.expect import OF_A_FAULT
from beaver_ftc.scenario.faults import SensorFault, SurfaceFault, without_effect

DURATION_S = 30.0
RATE_HZ = 100.0
# What can be expected of a profile, below `expect`, and the channel of the autopilot it is of.
_OF_A_PROFILE: dict[tuple[str, ...], str] = {
    ("altitude_within_m",): "altitude_m",
    ("airspeed_within_mps",): "airspeed_mps",
    ("airspeed_within_limits_mps",): "airspeed_mps",
    ("heading_within_deg",): "heading_deg",
    **{("arrives", channel): channel for channel in ("altitude_m", "airspeed_mps", "heading_deg")},
}
Instants = Sequence[float | None]


def conflicts(said: Mapping[str, Any]) -> Iterator[Conflict]:
    """Every contradiction, at the key to change. said: sections by name, faults and changes as they are,
    others as mappings."""
    duration_s = _positive(said.get("duration_s", DURATION_S))
    rate_hz = _positive(said.get("rate_hz", RATE_HZ))
    faults_s, changes_s = (_instants(said.get(section, [])) for section in ("faults", "changes"))
    if duration_s and rate_hz and duration_s * rate_hz < 1:
        yield ("duration_s",), f"{duration_s:g} is less than one frame, allowed: at least {1 / rate_hz:g} s"
    yield from _too_late("faults", faults_s or (), duration_s)
    yield from _too_late("changes", changes_s or (), duration_s)
    yield from _without_effect(said.get("faults", ()))
    yield from _out_of_order(changes_s or ())
    expect = said.get("expect")
    autopilot = said.get("autopilot")
    if faults_s is not None and not faults_s:
        yield from _expected_of_no_fault(expect)
    if isinstance(autopilot, Mapping | None):
        yield from _expected_of_no_profile(expect, autopilot or {})


def _too_late(section: str, starts_s: Instants, end_s: float | None) -> Iterator[Conflict]:
    for i, at_s in enumerate(starts_s):
        if at_s and end_s and at_s >= end_s:
            allowed = f"allowed: earlier than duration_s, {end_s:g} s"
            yield (section, i, "at_s"), f"{at_s:g} is after the end, {allowed}"


def _without_effect(faults: Any) -> Iterator[Conflict]:
    """What a scenario declares is flown: no fault of a surface that another one masks as it begins."""
    if isinstance(faults, list | tuple) and all(
        isinstance(fault, SurfaceFault | SensorFault) for fault in faults
    ):
        yield from ((("faults", i, "at_s"), says) for i, says in without_effect(faults))


def _out_of_order(changes_s: Instants) -> Iterator[Conflict]:
    """Changes stand in the order in which they come, so that a reader need not sort them."""
    for i, (early, late) in enumerate(pairwise(changes_s), start=1):
        if early and late and late <= early:
            allowed = f"allowed: later than {early:g} s"
            yield ("changes", i, "at_s"), f"{late:g} is not after the change before it, {allowed}"


def _expected_of_no_fault(expect: Any) -> Iterator[Conflict]:
    for key in expect if isinstance(expect, Mapping) else ():
        if key in OF_A_FAULT and expect[key] is not None:
            yield ("expect", key), "there is no fault to expect it of, allowed: only with faults"


def _expected_of_no_profile(expect: Any, autopilot: Mapping[str, Any]) -> Iterator[Conflict]:
    for path, channel in _OF_A_PROFILE.items():
        expected = expect
        for key in path:
            expected = expected.get(key) if isinstance(expected, Mapping) else None
        if expected is not None and not autopilot.get(channel):
            says = f"there is no profile to expect it of, allowed: only with autopilot.{channel}"
            yield ("expect", *path), says


def _instants(given: Any) -> Instants | None:
    """`at_s` of each entry of a list, None where it is no positive number."""
    if not isinstance(given, list | tuple):
        return None
    return [_positive(e.get("at_s") if isinstance(e, dict) else getattr(e, "at_s", None)) for e in given]


def _positive(value: Any) -> float | None:
    """The value if it is a positive finite number."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if number and 0 < value <= 1e9 and isfinite(value) else None
