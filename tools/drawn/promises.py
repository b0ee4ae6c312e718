"""The promises that every flight must keep, and those that a flight breaks.

`broken` reads the metrics alone; `flown_again` flies the scenario again from its text. The module
`beaver_ftc.results.judgement` decides whether an alarm is false, a detection late or a name right.
"""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import beaver_ftc as bf
from beaver_ftc.results.judgement import Truth, is_late
from beaver_ftc.results.model import DeclaredFault
from beaver_ftc.scenario.dump import to_yaml
from beaver_ftc.scenario.faults import UNANTICIPATED
from beaver_ftc.scenario.schema import load_text

Document = dict[str, Any]

OURS, NONE = "adaptive-estimators", "none"
LOSS = "loss_of_effectiveness"
PLANES = ({"elevator", "flap"}, {"aileron", "rudder"})
DUST_S = 1e-6
DEFAULT_LIMIT_DEG_S = 60.0


def broken(scenario: bf.Scenario, metrics: Document, declared: bool) -> Iterator[str]:
    """Yield a line for each promise that the flight breaks. declared: whether every error is declared."""
    yield from _sane(scenario, metrics)
    if declared:
        yield from _false_alarms(scenario, metrics)
        yield from _late(scenario, metrics)
        yield from _misnamed(scenario, metrics)


def _sane(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """Contradictions inside of the metrics."""
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
    """Yield the time of the alarm, or None, and the scheme of each diagnosis of a flight, the last one
    last."""
    scheme = scenario.fdi.scheme
    for change in metrics["changes"]:
        yield change.get("detection_time_s"), scheme
        scheme = change["scheme"] or scheme
    yield metrics["detection"]["time_s"], scheme


def _began_s(metrics: Document) -> float:
    """When the last diagnosis began, s: at the last change that reports the result of the one before it."""
    return max(
        (change["time_s"] for change in metrics["changes"] if "detection_time_s" in change), default=0.0
    )


def _false_alarms(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """Alarms before the fault."""
    onset = Truth.of(scenario).onset
    for time_s, scheme in _alarms(scenario, metrics):
        if time_s is not None and onset.is_false(time_s) and scheme == OURS:
            yield f"false alarm: at {time_s:g} s"


def _late(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """An alarm later than the instant from which it is certain. A broken instrument is an undeclared error,
    and makes nothing certain."""
    certain_s = metrics["detection"]["guaranteed_delay_s"]
    instrument = any(fault.sensor for fault in Truth.of(scenario).faults)
    if certain_s is None or instrument or metrics["false_alarm"] or scenario.fdi.scheme != OURS:
        return
    delay_s = metrics["detection"]["delay_s"]
    if delay_s is None:
        yield f"late: certain after {certain_s:g} s, and no alarm"
    elif is_late(delay_s, certain_s, 1.0 / scenario.rate_hz):
        yield f"late: certain after {certain_s:g} s, alarm after {delay_s:g} s"


def _misnamed(scenario: bf.Scenario, metrics: Document) -> Iterator[str]:
    """A wrong name, or an exclusion of the true fault, in flights for which the theory promises neither."""
    if not metrics["detection"]["detected"] or metrics["false_alarm"]:
        return
    if list(_alarms(scenario, metrics))[-1][1] != OURS:
        return
    faults = Truth.of(scenario).faults
    if any(fault.sensor for fault in faults):
        yield from _instrument(scenario, metrics, faults)
    elif faults and all(_in_class(scenario, fault) for fault in faults):
        yield from _surfaces(scenario, metrics, faults)


def _in_class(scenario: bf.Scenario, fault: DeclaredFault) -> bool:
    """Whether a fault is one of those that the diagnosis is to tell from one another."""
    if scenario.fdi.fault_class == "all":
        return fault.actuator is not None
    return fault.type == LOSS and fault.actuator in scenario.airframe.primary


def _instrument(scenario: bf.Scenario, metrics: Document, faults: Sequence[DeclaredFault]) -> Iterator[str]:
    """One broken instrument that was monitored before it broke: no surface and no other instrument is
    named."""
    fault, named = faults[0], metrics["isolation"]["fault"]
    watched = scenario.fdi.monitors_sensors and _began_s(metrics) < fault.at_s
    if len(faults) == 1 and watched and named is not None and not fault.is_named_by(named):
        yield f"wrong name: {named}, broken is sensor {fault.sensor}"


def _surfaces(scenario: bf.Scenario, metrics: Document, faults: Sequence[DeclaredFault]) -> Iterator[str]:
    """Faults of the declared class: names, types and candidates must be right.

    true: types by broken surface. one_name: the diagnosis has to name one surface, else a pair of them.
    """
    isolation = metrics["isolation"]
    true = {one.actuator: _kinds([of for of in faults if of.actuator == one.actuator]) for one in faults}
    if not _is_name_promised(scenario.fdi, faults, len(true)):
        return
    one_name = len(true) == 1 and (isolation["fault"] or not scenario.fdi.pairs)
    found = [isolation] if one_name else isolation["faults"]
    named = {one["fault"]: one for one in found if one["fault"]}
    for name in named.keys() - true.keys():
        yield f"{'excluded' if name == UNANTICIPATED else 'wrong name'}: {name}, broken are {sorted(true)}"
    may_be_hardover = any(_runs_away(scenario, fault) for fault in faults)
    for surface in named.keys() & true.keys():
        kind, left, kinds = named[surface]["type"], named[surface]["candidates"], true[surface]
        says = {kind} if kind is not None else {*left} if left or one_name else kinds
        if len(kinds) == 1 and not kinds & says and not (may_be_hardover and kind == "hardover"):
            yield f"wrong type: {kind or left}, broken is {kinds} of {surface}"
    if one_name:
        if not named:
            yield from _left_out(scenario, isolation["candidates"], *next(iter(true.items())))
    elif isolation["fault"] == UNANTICIPATED:
        for hit in (true.keys() & plane for plane in PLANES if not named.keys() & plane):
            if hit:
                yield f"excluded: {sorted(hit)}"


def _is_name_promised(fdi: Any, faults: Sequence[DeclaredFault], n_surfaces: int) -> bool:
    """Whether faults on so many surfaces are among those whose names the theory promises: on one surface, or
    with `pairs` one on each of two."""
    changing = any(fault.profile != "abrupt" or fault.end_s is not None for fault in faults)
    if changing and fdi.thresholds == "published":  # that test supposes a constant parameter
        return False
    if n_surfaces == 1:
        return len(faults) == 1 or fdi.fault_profile != "abrupt"
    return len(faults) == 2 and fdi.pairs


def _left_out(scenario: bf.Scenario, left: list[str], surface: str, kinds: set[Any]) -> Iterator[str]:
    """The candidates lack the true surface, or its type."""
    mine = [one for one in left if one.split(":")[0] == surface]
    open_type = surface in mine or scenario.fdi.fault_class != "all" or len(kinds) > 1
    if not mine or not (open_type or f"{surface}:{next(iter(kinds))}" in mine):
        yield f"excluded: {surface} {kinds}, left {left}"


def _kinds(faults: Sequence[DeclaredFault]) -> set[Any]:
    """The types of the faults of a surface; hardovers to both stops count as two more."""
    stops = {fault.size["direction"] for fault in faults if fault.type == "hardover"}
    return {fault.type for fault in faults} | (stops if len(stops) > 1 else set())


def _runs_away(scenario: bf.Scenario, fault: DeclaredFault) -> bool:
    """Whether a bias grows so fast that the diagnosis takes it for a runaway at the stop (fault-types.md)."""
    if fault.type != "bias" or fault.profile == "abrupt":
        return False
    limit_deg_s = getattr(scenario.known_actuators, fault.actuator).rate_limit_deg_s or DEFAULT_LIMIT_DEG_S
    return abs(fault.size["bias_deg"]) * fault.size["kappa_per_s"] > 0.9 * limit_deg_s


def flown_again(flight: bf.Flight) -> Iterator[str]:
    """Differences to the flight of the text that a result folder has, flown with a log."""
    return differences(flight.metrics, bf.fly(load_text(to_yaml(flight.scenario))).metrics)


def differences(one: Any, other: Any, path: str = "again") -> Iterator[str]:
    """Yield a line for each place at which two documents differ."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        for key in one:
            yield from differences(one[key], other[key], f"{path}.{key}")
    elif json.dumps(one) != json.dumps(other):
        yield f"{path}: {one!r:.80}, then {other!r:.80}"
