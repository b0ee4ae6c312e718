"""The faults of a flight in words: the injected faults, and those that the diagnosis named."""

import math
from collections import Counter
from collections.abc import Sequence

from beaver_ftc.results.model import DeclaredFault, Fault, Metrics, Named, Window, Withdrawn
from beaver_ftc.results.words import seconds_text, span_text, value_text, without_underscores
from beaver_ftc.scenario.faults import TYPES, acting_at, masking, size_at
from beaver_ftc.scenario.sensors import QUANTITIES

MAX_LISTED_CANDIDATES = 4  # more surfaces are counted, not listed
# Candidates that are no surface, in words.
_TEXT_OF_OTHER_CANDIDATE = {
    "damage": "damage", "unanticipated": "a fault outside the class", "unknown": "a fault outside the class",
}  # fmt: skip
# Words in the names of surfaces, and the part of the aircraft where such a surface is.
_AIRCRAFT_PART_OF_SURFACE_WORD = {
    "aileron": "wing", "flap": "wing", "spoiler": "wing", "slat": "wing", "elevon": "wing",
    "elevator": "tail", "rudder": "tail", "stabilator": "tail", "stabilizer": "tail", "canard": "canard",
    "throttle": "engines", "engine": "engines",
}  # fmt: skip
_FORM_OF_SENSOR_FAULT = {"bias": "{:+g} {}", "noise": "{:g} {}", "scale": "{:+.0%}"}


def fault_text(fault: Fault | None, faults: Sequence[DeclaredFault]) -> str:
    """A fault with its size and times, and the times at which other faults mask it. A `Fault`, of documents
    of earlier versions, has neither size nor end."""
    if fault is None:
        return "none"
    place = f"sensor {fault.sensor}" if fault.sensor else fault.actuator or ""
    text = f"{place} {without_underscores(fault.type)}".strip()
    if not isinstance(fault, DeclaredFault):
        return f"{text} at {seconds_text(fault.at_s)}"
    if size := ", ".join(_fault_size_texts(fault)):
        text += f" ({size})"
    return f"{text} at {span_text(fault.at_s, fault.end_s)}{_masked_text(fault, faults)}"


def _masked_text(fault: DeclaredFault, faults: Sequence[DeclaredFault]) -> str:
    """The times at which a later fault masks a fault, so that it has no effect."""
    spans = [
        f"from {span_text(other.at_s, other.end_s)} ({without_underscores(other.type)})"
        for other in faults
        if other.at_s > fault.at_s and masking(fault, faults, other.at_s) is other
    ]
    return f", without effect {' and '.join(spans)}" if spans else ""


def _fault_size_texts(fault: DeclaredFault) -> list[str]:
    """The size of an injected fault in words. The fault of an instrument has the unit of the instrument."""
    if fault.sensor:
        unit = QUANTITIES[fault.sensor].unit
        size = fault.size.get("magnitude")
        return [] if size is None else [_FORM_OF_SENSOR_FAULT[fault.type].format(size, unit)]
    words_of = TYPES[fault.type].in_words if fault.type in TYPES else {}
    return [words_of[key](value) for key, value in fault.size.items() if key in words_of]


def window_text(window: Window, metrics: Metrics) -> str:
    """The alarm and the names in one window."""
    alarm = f"alarm after {seconds_text(window.delay_s)}" if window.detected else "no alarm"
    names = [_found_text(name, metrics, "not isolated") for name in window.isolation]
    return f"{span_text(window.from_s, window.to_s)}: {'; '.join([alarm, *names])}"


def isolation_texts(metrics: Metrics) -> list[str]:
    """The name, the candidates or `none`, and the names and types that were withdrawn; then a text for each
    further fault."""
    isolation = metrics.isolation
    text = "none"
    further: Sequence[Named] = ()
    if isolation.isolated:
        text = _named_fault_text(isolation, metrics)
        further = isolation.faults[1:]
    elif metrics.detection.detected and isolation.candidates:
        text = _candidates_text(isolation.candidates)
    withdrawn = _withdrawn_texts("named before", isolation.withdrawn)
    types = _withdrawn_texts("type named before", isolation.types_withdrawn or ())
    return [
        "; ".join([text, *withdrawn, *types]),
        *(_found_text(fault, metrics, _candidates_text(fault.candidates)) for fault in further),
    ]


def _withdrawn_texts(heading: str, withdrawn: Sequence[Withdrawn]) -> list[str]:
    """The withdrawn names, each once, in a text below the heading: how often it was given if several times,
    and for how long in all, from when to when, and the reason of the last withdrawal. No text without a
    name."""
    entries_of_name: dict[str, list[Withdrawn]] = {}
    for entry in withdrawn:
        kind = f" ({without_underscores(entry.type)})" if entry.type else ""
        entries_of_name.setdefault(f"{entry.fault}{kind}", []).append(entry)
    texts = []
    for name, entries in entries_of_name.items():
        total = seconds_text(sum(entry.to_s - entry.from_s for entry in entries))
        often = f" {len(entries)} times, for {total} in all," if len(entries) > 1 else ""
        when = f"from {span_text(entries[0].from_s, entries[-1].to_s)}"
        why = f", withdrawn because {entries[-1].because}" if entries[-1].because else ""
        texts.append(f"{name}{often} {when}{why}")
    return [f"{heading}: {'; '.join(texts)}"] if texts else []


def _found_text(named: Named, metrics: Metrics, otherwise: str) -> str:
    """A named fault, or else the candidates; `otherwise` if there are no candidates."""
    if named.fault:
        return _named_fault_text(named, metrics)
    return _candidates_text(named.candidates) if named.candidates else otherwise


def _named_fault_text(isolation: Named, metrics: Metrics) -> str:
    """One named fault: its name, the delay, whether it is right or premature, type, estimated and true
    size."""
    remaining = " (only remaining candidate)" if isolation.so_far else ""  # later data may exclude it, too
    when = "" if isolation.delay_s is None else f" after {seconds_text(isolation.delay_s)}"
    right = "correct" if isolation.correct and isolation.type_correct is not False else "WRONG"
    if isolation.premature:
        right = f"PREMATURE at {seconds_text(isolation.time_s)}"
    size = _estimate_text(isolation) + _true_size_text(isolation, metrics)
    return f"{isolation.fault}{remaining}{when}; {right}{_type_text(isolation)}{size}"


def _type_text(isolation: Named) -> str:
    """The type, or the types that remain. No text for an instrument, and for the type `unanticipated`."""
    if str(isolation.fault).startswith("sensor "):
        return ""
    if isolation.type is None:
        return ", " + (_open_types_text(isolation.candidates) if isolation.candidates else "of no known type")
    return "" if isolation.type == "unanticipated" else f", {without_underscores(isolation.type)}"


def _estimate_text(isolation: Named) -> str:
    """The estimated size: an angle in deg, any other size in the words of its fault type."""
    if isolation.estimate is None:
        return ""
    if isolation.estimate_deg is None:
        return f", estimated {TYPES[str(isolation.type)].estimate_in_words(isolation.estimate)}"
    return f", estimated {value_text(isolation.estimate_deg)} deg"


def _true_size_text(isolation: Named, metrics: Metrics) -> str:
    """The true size at the time of the estimate, if a fault of the named type was injected on this surface
    and has a size.

    The time of the estimate is `estimate_at_s`, or else the last frame. This time is written unless the only
    fault of the surface is abrupt and lasts to the end, and the estimate belongs to the last frame. No text
    if the size may change and the time is unknown.
    """
    faults = [fault for fault in metrics.faults if fault.actuator == isolation.fault]
    kind = isolation.type
    if isolation.estimate is None or kind not in [fault.type for fault in faults]:
        return ""
    condition = metrics.flight
    at_s = isolation.estimate_at_s
    if at_s is None:
        at_s = condition.flown_s - 1.0 / condition.rate_hz if condition and condition.rate_hz else math.inf
    lasts = faults[0].end_s is None and faults[0].profile == "abrupt" and len(faults) == 1
    if math.isinf(at_s) and not lasts:
        return ""
    when = "" if lasts and isolation.estimate_at_s is None else f" at {seconds_text(at_s)}"
    size = size_at(kind, faults, at_s)
    if size is None:
        is_over = kind not in [fault.type for fault in acting_at(faults, at_s)]
        return f"{when} (the fault is over then)" if is_over else when
    if isolation.estimate_deg is None:
        return f"{when} (true {TYPES[str(kind)].size_in_words(size)})"
    return f"{when} (true {value_text(math.degrees(size))} deg)"


def _candidates_text(candidates: Sequence[str]) -> str:
    """The candidates, each `place` or `place:type`, in words: first the surfaces, then other places, then the
    types. More than MAX_LISTED_CANDIDATES surfaces are counted; the metrics document lists all."""
    places: dict[str, list[str]] = {}
    for candidate in candidates:
        place, _, kind = candidate.partition(":")
        places.setdefault(place, []).extend([kind] if kind else [])
    surfaces = [place for place in places if place not in _TEXT_OF_OTHER_CANDIDATE]
    words = [_surfaces_text(surfaces)] if surfaces else []
    words += [_TEXT_OF_OTHER_CANDIDATE[place] for place in places if place in _TEXT_OF_OTHER_CANDIDATE]
    open_types = list(dict.fromkeys(kind for kinds in places.values() for kind in kinds))
    types = f"; {_open_types_text(open_types)}" if open_types else ""
    return f"not isolated, still possible: {' or '.join(words) or 'nothing'}{types}"


def _surfaces_text(names: Sequence[str]) -> str:
    """The names of a few surfaces, or the number of many on each part of the aircraft."""
    if len(names) <= MAX_LISTED_CANDIDATES:
        return " or ".join(without_underscores(name) for name in names)
    part_of = _AIRCRAFT_PART_OF_SURFACE_WORD.items()
    parts = Counter(next((part for word, part in part_of if word in name), "others") for name in names)
    counted = ", ".join(f"{n} {'' if part == 'others' else 'on the '}{part}" for part, n in parts.items())
    return f"one of {len(names)} surfaces ({counted})"


def _open_types_text(kinds: Sequence[str]) -> str:
    """The types that remain, counted."""
    if len(kinds) == 1:
        return f"type {without_underscores(kinds[0])}"
    return f"type not determined ({len(kinds)} remain: {', '.join(map(without_underscores, kinds))})"
