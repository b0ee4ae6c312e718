"""What every flight must keep, and what of it a flight breaks.

`broken` looks at the metrics alone, `flown_again` at the numbers of the scenario read back from its text.

Whether an alarm is false, a detection late or a name right is asked of `beaver_ftc.results.metrics`, as
everywhere.
"""

import json
from collections.abc import Iterator
from typing import Any

import beaver_ftc as bf
from beaver_ftc.results.metrics import Truth, is_late
from beaver_ftc.results.model import DeclaredFault
from beaver_ftc.scenario.builtin import to_yaml
from beaver_ftc.scenario.faults import UNANTICIPATED
from beaver_ftc.scenario.schema import load_text

Document = dict[str, Any]

OURS, NONE = "adaptive-estimators", "none"
LOSS = "loss_of_effectiveness"
PLANES = (("elevator", "flap"), ("aileron", "rudder"))
DUST_S = 1e-6
DEFAULT_LIMIT_DEG_S = 60.0


def broken(scenario: bf.Scenario, metrics: Document, declared: bool) -> Iterator[str]:
    """A line for each promise that the flight breaks. declared: whether every error of the truth is."""
    yield from _sane(scenario, metrics)
    if declared:
        yield from _false_alarms(scenario, metrics)
        yield from _late(scenario, metrics)
        yield from _misnamed(scenario, metrics)


def _sane(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """What no document may contradict by itself."""
    frames = round(scenario.duration_s * scenario.rate_hz)
    if metrics["departure"] is None and abs(metrics["frames"] - frames) > 1:
        yield f"frames: {metrics['frames']} of {frames}, and no departure"
    detection, isolation = metrics["detection"], metrics["isolation"]
    if detection["detected"] != (detection["time_s"] is not None):
        yield "detection: `detected` and `time_s` disagree"
    if isolation["isolated"] and not detection["detected"]:
        yield f"isolation: {isolation['fault']} without an alarm"
    elif isolation["isolated"] and isolation["time_s"] < detection["time_s"] - DUST_S:
        yield "isolation: before the alarm"
    if metrics["passed"] != all(one["passed"] for one in metrics["expectations"]):
        yield "expectations: `passed` is not all of them"
    times = [change["time_s"] for change in metrics["supervisor"]]
    if times != sorted(times):
        yield "supervisor: modes out of order"


def _alarms(scenario: bf.Scenario, metrics: Document) -> Iterator[tuple[float | None, str]]:
    """(when or None, whose alarm) of each diagnosis of a flight in turn, that of its end last."""
    scheme = scenario.fdi.scheme
    for change in metrics["changes"]:
        yield change.get("detection_time_s"), scheme
        scheme = change["scheme"] or scheme
    yield metrics["detection"]["time_s"], scheme


def _began_s(metrics: Document) -> float:
    """When the diagnosis that is there at the end began: a change that says what came of the one before."""
    return max(
        (change["time_s"] for change in metrics["changes"] if "detection_time_s" in change), default=0.0
    )


def _false_alarms(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """An alarm before there is a fault."""
    onset = Truth.of(scenario).onset
    for time_s, scheme in _alarms(scenario, metrics):
        if time_s is not None and onset.is_false(time_s) and scheme == OURS:
            yield f"false alarm: at {time_s:g} s"


def _late(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """Later than what was said to be certain. A broken instrument is an error that nothing declares."""
    certain_s = metrics["detection"]["guaranteed_delay_s"]
    if certain_s is None or any(map(_sensor, scenario.faults)) or metrics["false_alarm"]:
        return
    if scenario.fdi.scheme != OURS:
        return
    delay_s = metrics["detection"]["delay_s"]
    if delay_s is None:
        yield f"late: certain after {certain_s:g} s, and no alarm"
    elif is_late(delay_s, certain_s, 1.0 / scenario.rate_hz):
        yield f"late: certain after {certain_s:g} s, alarm after {delay_s:g} s"


def _sensor(fault: Any) -> str | None:
    return getattr(fault, "sensor", None)


def _surface(fault: Any) -> str | None:
    return getattr(fault, "actuator", None)


def _misnamed(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """Something else named than what broke, or what broke excluded, where theory promises that it is not."""
    if not metrics["detection"]["detected"] or metrics["false_alarm"]:
        return
    if list(_alarms(scenario, metrics))[-1][1] != OURS:
        return
    broken_sensors = [fault for fault in scenario.faults if _sensor(fault)]
    surfaces = [fault for fault in scenario.faults if not _sensor(fault)]
    if broken_sensors:
        yield from _instrument(scenario, metrics, broken_sensors, surfaces)
    elif surfaces and all(_in_class(scenario, fault) for fault in surfaces):
        yield from _surfaces(scenario, metrics, surfaces)


def _in_class(scenario: bf.Scenario, fault: Any) -> bool:
    if scenario.fdi.fault_class == "all":
        return _surface(fault) is not None
    return fault.type == LOSS and fault.actuator in scenario.airframe.primary


def _instrument(
    scenario: bf.Scenario, metrics: Document, sensors: list[Any], surfaces: list[Any]
) -> Iterator[str]:
    """One broken instrument, watched since before it broke: no surface and no other instrument is named."""
    fault, named = sensors[0], metrics["isolation"]["fault"]
    watched = scenario.fdi.monitors_sensors and _began_s(metrics) < fault.at_s
    if surfaces or len(sensors) > 1 or not watched:
        return
    if named is not None and not DeclaredFault.of_scenario(fault).is_named_by(named):
        yield f"wrong name: {named}, broken is sensor {fault.sensor}"


def _surfaces(scenario: bf.Scenario, metrics: Document, faults: list[Any]) -> Iterator[str]:
    """Faults of the class: of one surface, or with `pairs` of two."""
    struck = {_surface(fault) for fault in faults}
    if _norm_bound(scenario) and any(
        fault.profile != "abrupt" or fault.end_s is not None for fault in faults
    ):
        return
    if len(struck) == 1:
        yield from _one_surface(scenario, metrics, faults)
    elif len(faults) == 2 and scenario.fdi.pairs:
        yield from _pair(metrics, faults)


def _norm_bound(scenario: bf.Scenario) -> bool:
    """The published isolation test supposes a constant parameter."""
    return scenario.fdi.thresholds == "published"


def _one_surface(scenario: bf.Scenario, metrics: Document, faults: list[Any]) -> Iterator[str]:
    isolation, surface = metrics["isolation"], _surface(faults[0])
    named, left = isolation["fault"], isolation["candidates"]
    if scenario.fdi.fault_profile == "abrupt" and len(faults) > 1:
        return
    kinds = _kinds(faults)
    if named is not None and not DeclaredFault.of_scenario(faults[0]).is_named_by(named):
        yield f"{'excluded' if named == UNANTICIPATED else 'wrong name'}: {named}, broken is {surface}"
    elif named is None and scenario.fdi.pairs:
        yield from _left_of_pair(isolation, {surface: kinds})
    elif named is None:
        mine = [one for one in left if one.split(":")[0] == surface]
        if not mine:
            yield f"excluded: {surface}, left {left}"
        elif _type_left_out(scenario, faults, mine):
            yield f"excluded: {surface}:{faults[0].type}, left {mine}"
    elif len(kinds) == 1:
        kind = isolation["type"]
        if kind == "hardover" and _runs_away(scenario, faults[0]):
            return
        if kind not in (None, faults[0].type) or (kind is None and faults[0].type not in left):
            yield f"wrong type: {kind or left}, broken is {faults[0].type} of {surface}"


def _kinds(faults: list[Any]) -> set[Any]:
    """The types of the faults of a surface; to both stops is more than one."""
    stops = {fault.direction for fault in faults if fault.type == "hardover"}
    return {fault.type for fault in faults} | (stops if len(stops) > 1 else set())


def _runs_away(scenario: bf.Scenario, fault: Any) -> bool:
    """Whether a bias grows so fast that at its stop it counts as a runaway (fault-types.md)."""
    if fault.type != "bias" or fault.profile == "abrupt":
        return False
    limit_deg_s = getattr(scenario.known_actuators, fault.actuator).rate_limit_deg_s or DEFAULT_LIMIT_DEG_S
    return abs(fault.bias_deg) * fault.kappa_per_s > 0.9 * limit_deg_s


def _type_left_out(scenario: bf.Scenario, faults: list[Any], mine: list[str]) -> bool:
    """Whether candidates of the true surface lack its true type."""
    surface, kinds = _surface(faults[0]), {fault.type for fault in faults}
    open_type = surface in mine or scenario.fdi.fault_class != "all" or len(kinds) > 1
    return not open_type and f"{surface}:{faults[0].type}" not in mine


def _pair(metrics: Document, faults: list[Any]) -> Iterator[str]:
    """As tests/studies/matrix/test_random_pairs.py: none is named wrongly, no true one is excluded."""
    yield from _left_of_pair(metrics["isolation"], {_surface(fault): {fault.type} for fault in faults})


def _left_of_pair(isolation: Document, true: dict[Any, set[str]]) -> Iterator[str]:
    named = {found["fault"]: found for found in isolation["faults"] if found["fault"]}
    yield from (f"wrong name: {one}, broken are {sorted(true)}" for one in named if one not in true)
    for surface in named.keys() & true.keys():
        kind, left = named[surface]["type"], named[surface]["candidates"]
        if len(true[surface]) > 1:
            continue
        if (kind is not None and kind not in true[surface]) or (left and not true[surface] & set(left)):
            yield f"wrong type: {kind or left}, broken is {true[surface]} of {surface}"
    for plane in PLANES:
        hit = [surface for surface in plane if surface in true]
        if hit and not named.keys() & set(plane) and isolation["fault"] == UNANTICIPATED:
            yield f"excluded: {hit}"


def flown_again(flight: bf.Flight) -> Iterator[str]:
    """What differs in the same flight from the text that a result folder has, with a log."""
    return differences(flight.metrics, bf.fly(load_text(to_yaml(flight.scenario))).metrics)


def differences(one: Any, other: Any, path: str = "again") -> Iterator[str]:
    """Where two documents differ."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        for key in one:
            yield from differences(one[key], other[key], f"{path}.{key}")
    elif json.dumps(one) != json.dumps(other):
        yield f"{path}: {one!r:.80}, then {other!r:.80}"
