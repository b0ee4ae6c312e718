"""The verdict of a flight in words, for the terminal and the head of the report.

All words are computed from the metrics, so that they cannot disagree with metrics.json. A line of the verdict
is a pair (name, text); without a text, it is left out.
"""

import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.expectations import (
    MOTION_OF_AXIS,
    expectations_in_words,
    value_text,
    without_underscores,
)
from beaver_ftc.results.model import (
    Authority,
    CertificateCounts,
    ChangeInFlight,
    DeclaredFault,
    Fault,
    FlightCondition,
    Link,
    Metrics,
    Named,
    Part,
    ProfileDeviations,
    ProtectionLimit,
    Statistical,
    Window,
    Withdrawn,
)
from beaver_ftc.scenario.faults import TYPES, acting_at, masking, size_at
from beaver_ftc.scenario.measured_range import in_words
from beaver_ftc.scenario.sensors import QUANTITIES
from beaver_ftc.scenario.warnings import wider

if TYPE_CHECKING:
    from rich.table import Table

MIN_SHOWN_BEYOND_S = 0.1  # a shorter time without sufficient authority is not printed
MAX_SHOWN_AUTHORITY_SHARE = 0.995  # an axis with a larger share has lost nothing worth saying
MAX_LISTED_CANDIDATES = 4  # more surfaces are counted, not listed
_TIME = re.compile("(?<!_deg|_rad)_s$")  # names of fields in seconds, without rates
_ASSUMPTION_TEXT = {"sensors-sound": "sensors are sound (A11)"}
Lines = Iterable[tuple[str, str]]  # name and text
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


def title(metrics: Metrics) -> str:
    """The name of the scenario, whether its expectations are met or the flight was interrupted, and whether
    the aircraft was lost."""
    lost = ", the aircraft was LOST" if metrics.departure else ""
    if metrics.interrupted_s is not None:
        return f"{metrics.scenario}: INTERRUPTED at {metrics.interrupted_s:.2f} s, not passed{lost}"
    if not metrics.expectations:
        return f"{metrics.scenario}: flown{lost}, nothing was expected"
    return f"{metrics.scenario}: {'PASSED' if metrics.passed else 'FAILED'}{lost}"


def outcome_class(metrics: Metrics) -> str:
    """`good`, `bad`, or `lost` if the aircraft was lost although all expectations are met."""
    return "bad" if not metrics.passed else "lost" if metrics.departure else "good"


def verdict_lines(metrics: Metrics) -> list[tuple[str, str]]:
    """(name, text) of each line of the verdict, from top to bottom."""
    declared = metrics.faults or (metrics.fault,)
    isolation = metrics.isolation
    lines = (
        ("flight", _if_there(_condition_text, metrics.flight)),
        *headed("fault", [_fault_text(fault, metrics.faults) for fault in declared]),
        ("assumed", ", ".join(_ASSUMPTION_TEXT.get(name, name) for name in metrics.assumes)),
        ("outside", _outside_class_text(metrics)),
        ("detection", _detection_text(metrics)),
        (
            "inconclusive",
            _if_there(lambda section: in_words(section.document()), metrics.detection.inconclusive),
        ),
        ("statistical", _if_there(_statistical_text, metrics.detection.statistical)),
        ("isolation", _isolation_text(metrics)),
        *(
            ("", _found_text(fault, metrics, _candidates_text(fault.candidates)))
            for fault in (isolation.faults[1:] if isolation.isolated else ())
        ),
        *headed("windows", [_window_text(window, metrics) for window in metrics.windows or ()]),
        (
            "probing",
            f"flap and elevator moved from {_span_text(*isolation.probing_s)}" if isolation.probing_s else "",
        ),
        ("supervisor", _supervisor_text(metrics)),
        *(("changed", _change_text(change)) for change in metrics.changes),
        (
            "engine power",
            _filled(
                "took over pitch at {from_s}, for {in_charge_s} in all, {lowest_inhg:.1f} to "
                "{highest_inhg:.1f} inHg",
                metrics.engine_power,
            ),
        ),
        ("profile", _if_there(_profile_text, metrics.profile)),
        *(("limited", _protection_limit_text(limit)) for limit in metrics.limits),
        ("authority", _if_there(_insufficient_authority_text, metrics.authority)),
        ("remaining", _if_there(_remaining_authority_text, metrics.authority)),
        ("envelope", _envelope_text(metrics)),
        ("departure", _filled("LOST at {time_s}: {signal}", metrics.departure)),
        ("link", _if_there(_link_text, metrics.link)),
        ("saturation", ", ".join(f"{s} {_seconds_text(t)}" for s, t in metrics.saturation_s.items() if t)),
        *(("note", hint) for hint in metrics.hints),
    )
    return [(name, text) for name, text in lines if text]


def headed(name: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    """A line for each text; only the first has the name."""
    return [("" if i else name, text) for i, text in enumerate(texts)]


def _if_there(text_of: Callable[[Any], str], section: Any) -> str:
    """The text of a section; empty if the flight has no such section."""
    return text_of(section) if section else ""


def _filled(form: str, section: Part | None, **more: str) -> str:
    """A form filled with the fields of a section and of `more`; a field in seconds is written as a time.
    Empty if the flight has no such section."""
    if section is None:
        return ""
    values = {
        name: _seconds_text(value) if _TIME.search(name) else value for name, value in vars(section).items()
    }
    return form.format(**values, **more)


def _window_text(window: Window, metrics: Metrics) -> str:
    """The alarm and the names in one window."""
    alarm = f"alarm after {_seconds_text(window.delay_s)}" if window.detected else "no alarm"
    names = [_found_text(name, metrics, "not isolated") for name in window.isolation]
    return _filled("{from_s} to {to_s}: {found}", window, found="; ".join([alarm, *names]))


def _found_text(named: Named, metrics: Metrics, otherwise: str) -> str:
    """A named fault, or else the candidates; `otherwise` if there are no candidates."""
    if named.fault:
        return _named_fault_text(named, metrics)
    return _candidates_text(named.candidates) if named.candidates else otherwise


def _candidates_text(candidates: Sequence[str]) -> str:
    return f"not isolated, {candidates_in_words(candidates)}"


def candidates_in_words(candidates: Sequence[str]) -> str:
    """The candidates, each `place` or `place:type`, in words: first the surfaces, then other places, then the
    types. More than MAX_LISTED_CANDIDATES surfaces are counted; the metrics document lists all."""
    places: dict[str, list[str]] = {}
    for candidate in candidates:
        place, _, kind = candidate.partition(":")
        places.setdefault(place, []).extend([kind] if kind else [])
    surfaces = [place for place, kinds in places.items() if place not in _TEXT_OF_OTHER_CANDIDATE]
    words = [_surfaces_text(surfaces)] if surfaces else []
    words += [_TEXT_OF_OTHER_CANDIDATE[place] for place in places if place in _TEXT_OF_OTHER_CANDIDATE]
    open_types = list(dict.fromkeys(kind for kinds in places.values() for kind in kinds))
    types = f"; {_open_types_text(open_types)}" if open_types else ""
    return f"still possible: {' or '.join(words) or 'nothing'}{types}"


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


def _count_and_noun(n: int, noun: str) -> str:
    """A number with its noun, such as `1 time` and `2 times`."""
    return f"{n} {noun}{'' if n == 1 else 's'}"


def tracking_rms_in_words(metrics: Metrics) -> list[tuple[str, str, str, str]]:
    """(`before` or `after`, p, q, r): the RMS tracking errors before and after the fault, deg/s."""
    tracking = metrics.tracking
    tracked = ("before", tracking.pre_fault_rms_deg_s), ("after", tracking.post_fault_rms_deg_s)
    return [(when, value_text(rms.p), value_text(rms.q), value_text(rms.r)) for when, rms in tracked if rms]


def verdict_text(metrics: Metrics, folder: str, colour: bool = False) -> str:
    """The verdict of one flight as a table for the terminal."""
    style = {"good": "bold green", "lost": "bold yellow", "bad": "bold red"}[outcome_class(metrics)]
    lines = verdict_lines(metrics)
    errors = [
        f"p {p}  q {q}  r {r} deg/s {when} the fault" for when, p, q, r in tracking_rms_in_words(metrics)
    ]
    lines += headed("tracking RMS", errors)
    expectations = [
        (expectation.passed, expectation.sentence) for expectation in expectations_in_words(metrics)
    ]
    written = metrics.certificate
    last_lines = [("certificate", _certificate_text(folder, written))] if written else []
    table = verdict_table((title(metrics), style), lines, expectations, [*last_lines, ("results", folder)])
    return f"{printed([table], colour=colour)}\n"


def verdict_table(
    headline: tuple[str, str], lines: Lines, expectations: Iterable[tuple[bool, str]], last: Lines
) -> "Table":
    """The table of a verdict: headline (text, style), lines, expectations (met, sentence), and the last
    lines."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(*headline), title_justify="left", show_header=False, box=None)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in lines:
        table.add_row(name, text)
    for passed, sentence in expectations:
        mark = Text("met   " if passed else "MISSED", "green" if passed else "bold red")
        table.add_row("expected", Text.assemble(mark, f" {sentence}"))
    for name, text in last:
        table.add_row(name, text)
    return table


def printed(tables: Iterable["Table"], width: int | None = None, colour: bool = False) -> str:
    """Tables of rich as text."""
    from rich.console import Console

    console = Console(
        file=io.StringIO(), force_terminal=colour, highlight=False, emoji=False, markup=False, width=width
    )
    with console.capture() as captured:
        for table in tables:
            console.print(table)
    return "\n".join(line.rstrip() for line in captured.get().splitlines())


def _certificate_text(folder: str, written: CertificateCounts) -> str:
    """How many alarms and exclusions are certified, and the command that checks them."""
    if not written.statements and not written.without:
        return "nothing to certify: no alarm"
    without = f", {written.without} not certified" if written.without else ""
    return f"{_count_and_noun(written.statements, 'statement')}{without}; check: beaver-ftc check {folder}"


def _change_text(change: ChangeInFlight) -> str:
    """A change in flight, and the result of the diagnosis that was replaced."""
    changed = [f"{key} {name}" for key in ("law", "scheme") if (name := getattr(change, key))]
    if change.sensors:
        changed.append("sensors")
    form = "{what} at {time_s}"
    alarm = "FALSE ALARM" if change.false_alarm else "alarm"
    if change.detection_time_s is not None:
        form += "; the diagnosis before: {alarm} at {detection_time_s}, {named}"
    changes = ", ".join(changed) or "declared sensors"
    named = change.isolated or "not isolated"
    return _filled(form, change, what=changes, alarm=alarm, named=named)


def _condition_text(condition: FlightCondition) -> str:
    """Airspeed, altitude, time, scheme and law."""
    of_every_type = ", every fault type" if condition.fault_class == "all" else ""
    return _filled(
        "{airspeed_mps:g} m/s at {altitude_m:g} m, {flown_s}; diagnosis {scheme}{of_every_type}; law {law}",
        condition,
        of_every_type=of_every_type,
    )


def _outside_class_text(metrics: Metrics) -> str:
    """The faults that the diagnosis cannot name, because its class does not contain them."""
    if not metrics.outside_class:
        return ""
    outside = " and ".join(metrics.outside_class)
    cure = wider(metrics.flight.fault_class)
    return f"{outside}: outside the declared class, so that it cannot be named; {cure}"


def _fault_text(fault: Fault | None, faults: Sequence[DeclaredFault]) -> str:
    """A fault with its size and times, and the times at which other faults mask it. A `Fault`, of documents
    of earlier versions, has neither size nor end."""
    if fault is None:
        return "none"
    place = f"sensor {fault.sensor}" if fault.sensor else fault.actuator or ""
    text = f"{place} {without_underscores(fault.type)}".strip()
    if not isinstance(fault, DeclaredFault):
        return f"{text} at {_seconds_text(fault.at_s)}"
    if size := ", ".join(_fault_size_texts(fault)):
        text += f" ({size})"
    return f"{text} at {_span_text(fault.at_s, fault.end_s)}{_masked_text(fault, faults)}"


def _masked_text(fault: DeclaredFault, faults: Sequence[DeclaredFault]) -> str:
    """The times at which a later fault masks a fault, so that it has no effect."""
    masks = [
        other for other in faults if other.at_s > fault.at_s and masking(fault, faults, other.at_s) is other
    ]
    spans = [
        f"from {_span_text(other.at_s, other.end_s)} ({without_underscores(other.type)})" for other in masks
    ]
    return f", without effect {' and '.join(spans)}" if spans else ""


_FORM_OF_SENSOR_FAULT = {"bias": "{:+g} {}", "noise": "{:g} {}", "scale": "{:+.0%}"}


def _fault_size_texts(fault: DeclaredFault) -> list[str]:
    """The size of an injected fault in words. The fault of an instrument has the unit of the instrument."""
    if fault.sensor:
        unit = QUANTITIES[fault.sensor].unit
        size = fault.size.get("magnitude")
        return [] if size is None else [_FORM_OF_SENSOR_FAULT[fault.type].format(size, unit)]
    words_of = TYPES[fault.type].in_words if fault.type in TYPES else {}
    return [words_of[key](value) for key, value in fault.size.items() if key in words_of]


_DEVIATION_FORMAT_OF_CHANNEL = {
    "altitude_m": "altitude {} m",
    "airspeed_mps": "airspeed {} m/s (10 s mean; largest at one instant {})", "heading_deg": "heading {} deg",
    "bank_deg": "bank {} deg",
}  # fmt: skip


def _profile_text(profile: ProfileDeviations) -> str:
    """Largest deviations from the commanded profile."""
    instant = value_text(profile.airspeed_at_one_instant_mps)
    deviations = [
        form.format(value_text(deviation), instant)
        for name, form in _DEVIATION_FORMAT_OF_CHANNEL.items()
        if (deviation := getattr(profile, name)) is not None
    ]
    return f"largest deviation: {', '.join(deviations)}" if deviations else ""


_LIMIT_FORM_OF_QUANTITY = {
    "airspeed_mps": "airspeed to {side} {value:.1f} m/s from {time_s}{until}: {because}",
    "bank_deg": "bank to {side} {value:.0f} deg from {time_s}{until}: {because}",
}


def _protection_limit_text(limit: ProtectionLimit) -> str:
    """A limit of the envelope protection: value, time and reason."""
    until = "" if limit.in_force else ", no longer at the end"
    return _filled(_LIMIT_FORM_OF_QUANTITY[limit.limits], limit, until=until)


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
    when = "" if lasts and isolation.estimate_at_s is None else f" at {_seconds_text(at_s)}"
    size = size_at(kind, faults, at_s)
    if size is None:
        is_over = kind not in [fault.type for fault in acting_at(faults, at_s)]
        return f"{when} (the fault is over then)" if is_over else when
    if isolation.estimate_deg is None:
        return f"{when} (true {TYPES[str(kind)].size_in_words(size)})"
    return f"{when} (true {value_text(math.degrees(size))} deg)"


def _detection_text(metrics: Metrics) -> str:
    """When an alarm was raised, and by which test: the residual of an axis, or the sensor monitor."""
    detection = metrics.detection
    if not detection.detected:
        return "no alarm"
    source = f"on {detection.axis}" if detection.axis else "by the sensor monitor"
    form = "after {delay_s} {source}"
    if metrics.false_alarm and detection.delay_s is None:
        form = "FALSE ALARM at {time_s} {source}"
    elif detection.guaranteed_delay_s is not None:
        form += " (certain within {guaranteed_delay_s})"
    return _filled(form, detection, source=source)


def _statistical_text(statistical: Statistical) -> str:
    """When the statistical detector alone would have raised the alarm."""
    alarm = "no alarm" if statistical.time_s is None else f"alarm at {_seconds_text(statistical.time_s)}"
    return _filled(
        "{alarm}; threshold {alarm_level:.2f} σ, peak in healthy flight {closest_approach:.2f} of it",
        statistical,
        alarm=alarm,
    )


def _isolation_text(metrics: Metrics) -> str:
    """The name, the candidates or `none`; then the names and types that were withdrawn."""
    isolation = metrics.isolation
    text = "none"
    if isolation.isolated:
        text = _named_fault_text(isolation, metrics)
    elif metrics.detection.detected and isolation.candidates:
        text = _candidates_text(isolation.candidates)
    withdrawn = _withdrawn_texts("named before", isolation.withdrawn)
    return "; ".join(
        [text, *withdrawn, *_withdrawn_texts("type named before", isolation.types_withdrawn or ())]
    )


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
        total = _seconds_text(sum(entry.to_s - entry.from_s for entry in entries))
        often = f" {len(entries)} times, for {total} in all," if len(entries) > 1 else ""
        when = f"from {_span_text(entries[0].from_s, entries[-1].to_s)}"
        why = f", withdrawn because {entries[-1].because}" if entries[-1].because else ""
        texts.append(f"{name}{often} {when}{why}")
    return [f"{heading}: {'; '.join(texts)}"] if texts else []


def _named_fault_text(isolation: Named, metrics: Metrics) -> str:
    """One named fault: its name, the delay, whether it is right or premature, type, estimated and true
    size."""
    remaining = " (only remaining candidate)" if isolation.so_far else ""  # later data may exclude it, too
    when = "" if isolation.delay_s is None else f" after {_seconds_text(isolation.delay_s)}"
    right = "correct" if isolation.correct and isolation.type_correct is not False else "WRONG"
    if isolation.premature:
        right = f"PREMATURE at {_seconds_text(isolation.time_s)}"
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


def _supervisor_text(metrics: Metrics) -> str:
    """The modes with their times; before the last one, how many are left out."""
    changes = [f"{change.mode} {_seconds_text(change.time_s)}" for change in metrics.supervisor]
    if metrics.mode_changes_left_out:
        changes.insert(-1, f"({metrics.mode_changes_left_out} more)")
    return " → ".join(changes)


def _insufficient_authority_text(authority: Authority) -> str:
    """For how long no deflection could hold the rate of each axis; times below MIN_SHOWN_BEYOND_S are left
    out."""
    beyond = ", ".join(
        f"{axis} for {_seconds_text(entry.beyond_s)}"
        for axis, entry in vars(authority).items()
        if entry.beyond_s >= MIN_SHOWN_BEYOND_S
    )
    return f"no deflection could hold the rate: {beyond}" if beyond else ""


def _remaining_authority_text(authority: Authority) -> str:
    """Remaining control authority of each axis that has lost some: range of acceleration at the end over that
    of the healthy aircraft, (greatest - least) / (greatest - least, healthy). An axis with power of the
    engines is always shown."""
    texts = []
    for axis, entry in vars(authority).items():
        if entry.least_rad_s2 is None:
            continue
        remaining = entry.greatest_rad_s2 - entry.least_rad_s2
        power = entry.engines_greatest_rad_s2
        healthy = entry.healthy_greatest_rad_s2 - entry.healthy_least_rad_s2
        share = remaining / healthy if healthy else 1.0  # 0: no surface acts about this axis
        if share < MAX_SHOWN_AUTHORITY_SHARE or power:
            engines = f", engines {entry.engines_least_rad_s2:.2g} to {power:.2g}" if power else ""
            span = f"{entry.least_rad_s2:.2g} to {entry.greatest_rad_s2:.2g} rad/s2{engines}"
            texts.append(f"{MOTION_OF_AXIS[axis]} authority {100 * share:.0f} % ({span})")
    return "; ".join(texts)


def _envelope_text(metrics: Metrics) -> str:
    """How often, how long and when first the flight left the validated envelope."""
    if not metrics.envelope_exits:
        return ""
    return _filled(
        "left {times}, {outside_s} in all, first at {first}",
        metrics.envelope,
        times=_count_and_noun(metrics.envelope.exits, "time"),
        first=_seconds_text(metrics.envelope_exits[0].start_s),
    )


# The counts of a link that are printed where they are not 0.
_LINK_COUNT_WORDS = {
    "repeated": "repeated", "late": "late", "missed": "missing", "malformed": "malformed",
    "strangers": "from other senders", "off_rate": "at another rate", "resets": "restarts",
}  # fmt: skip


def _link_text(link: Link) -> str:
    """Latency and losses of the link to an autopilot."""
    odd = "".join(
        f", {getattr(link, name)} {words}" for name, words in _LINK_COUNT_WORDS.items() if getattr(link, name)
    )
    return _filled(
        "{protocol}, {frames} frames at {packets_hz:g} Hz{odd}; latency {latency_ms.median:.2f} ms (99th "
        "percentile {latency_ms.p99:.2f}), interval {interval_ms.mean:.2f} ms, jitter "
        "{interval_ms.jitter_rms:.2f} ms RMS",
        link,
        odd=odd,
    )


def _span_text(begin_s: float, end_s: float | None) -> str:
    """A span of time, s; only the begin if it has no end."""
    begin = _seconds_text(begin_s)
    return begin if end_s is None else f"{begin} to {_seconds_text(end_s)}"


def _seconds_text(seconds: float | None) -> str:
    """A time as text, with one digit less from 1000 s on."""
    if seconds is None:
        return "none"
    return f"{seconds:.2f} s" if seconds < 1000 else f"{seconds:.1f} s"
