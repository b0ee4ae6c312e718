"""What a flight amounts to, in words: the verdict in the terminal and at the head of the report.

Everything is said from the metrics document, so that the words and `metrics.json` cannot disagree.
"""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.model import Document
from beaver_ftc.scenario.measured import in_words

if TYPE_CHECKING:
    from rich.table import Table

LEAST_BEYOND_S = 0.1


def title(metrics: Document) -> str:
    """The scenario's name, whether it did as expected, and whether the aircraft was lost."""
    lost = ", the aircraft was LOST" if metrics["departure"] else ""
    if "interrupted_s" in metrics:
        return f"{metrics['scenario']}: INTERRUPTED at {metrics['interrupted_s']:.2f} s, not passed{lost}"
    if not metrics["expectations"]:
        return f"{metrics['scenario']}: flown{lost}, nothing was expected"
    return f"{metrics['scenario']}: {'PASSED' if metrics['passed'] else 'FAILED'}{lost}"


def mood(metrics: Document) -> str:
    """`good`, `bad`, or `lost` for an aircraft lost in a flight that did as expected: never green."""
    return "bad" if not metrics["passed"] else "lost" if metrics["departure"] else "good"


def facts(metrics: Document) -> list[tuple[str, str]]:
    """(what, how it went) for each thing worth knowing, in the order in which they happen."""
    declared = metrics.get("faults") or [metrics["fault"]]
    said = (
        ("flight", _flight(metrics)),
        *(("" if i else "fault", _fault(fault)) for i, fault in enumerate(declared)),
        ("detection", _detection(metrics)),
        ("inconclusive", _inconclusive(metrics)),
        ("statistical", _statistical(metrics)),
        ("isolation", _isolation(metrics)),
        *(("", said) for said in _others(metrics)),
        ("probing", _probing(metrics)),
        ("supervisor", _supervisor(metrics)),
        *(("changed", _changed(change)) for change in metrics.get("changes", ())),
        ("engine power", _engine_power(metrics)),
        ("profile", _profile(metrics)),
        *(("limited", _limit(limit)) for limit in metrics.get("limits", ())),
        ("authority", _authority(metrics)),
        ("left", _left(metrics)),
        ("envelope", _envelope(metrics)),
        ("departure", _departure(metrics)),
        ("link", _link(metrics)),
        ("saturation", _saturation(metrics)),
        *(("note", hint) for hint in metrics.get("hints", ())),
    )
    return [(what, how) for what, how in said if how]


def _others(metrics: Document) -> list[str]:
    """What else is at fault, of several faults at once, and what is open."""
    isolation = metrics["isolation"]
    rest = isolation.get("faults", [])[1:] if isolation["isolated"] else []
    return [
        _one(fault, metrics) if fault["fault"] else _still_possible(fault["candidates"]) for fault in rest
    ]


MOST_LISTED = 4  # places, or types: more are counted


def _still_possible(candidates: Sequence[str]) -> str:
    return f"not isolated, {candidates_in_words(candidates)}"


def candidates_in_words(candidates: Sequence[str]) -> str:
    """What is still possible, `surface` or `surface:type`, grouped: surfaces by place, types by kind, both
    counted where there are many. The metrics document has the whole list."""
    places: dict[str, list[str]] = {}
    for candidate in candidates:
        place, _, kind = candidate.partition(":")
        places.setdefault(place, []).extend([kind] if kind else [])
    surfaces = [place for place, kinds in places.items() if place not in _NO_SURFACE]
    said = [_surfaces(surfaces)] if surfaces else []
    said += [_NO_SURFACE[place] for place in places if place in _NO_SURFACE]
    open_types = list(dict.fromkeys(kind for kinds in places.values() for kind in kinds))
    types = f"; {_open_types(open_types)}" if open_types else ""
    return f"still possible: {' or '.join(said) or 'nothing'}{types}"


_NO_SURFACE = {
    "damage": "damage", "unanticipated": "a fault outside the class", "unknown": "a fault outside the class",
}  # fmt: skip
# What an aircraft's surfaces are called, and where on it they are.
_PARTS = {
    "aileron": "wing", "flap": "wing", "spoiler": "wing", "slat": "wing", "elevon": "wing",
    "elevator": "tail", "rudder": "tail", "stabilator": "tail", "stabilizer": "tail", "canard": "canard",
    "throttle": "engines", "engine": "engines",
}  # fmt: skip


def _surfaces(names: Sequence[str]) -> str:
    """One surface, a few by their names, or many counted by the part of the aircraft where they are."""
    if len(names) <= MOST_LISTED:
        return " or ".join(_in_words(name) for name in names)
    parts: dict[str, int] = {}
    for name in names:
        part = next((part for word, part in _PARTS.items() if word in name), "others")
        parts[part] = parts.get(part, 0) + 1
    counted = ", ".join(f"{n} {'' if part == 'others' else 'on the '}{part}" for part, n in parts.items())
    return f"one of {len(names)} surfaces ({counted})"


def _open_types(kinds: Sequence[str]) -> str:
    """The types that remain, counted."""
    if len(kinds) == 1:
        return f"type {_in_words(kinds[0])}"
    return f"type not determined ({len(kinds)} remain: {', '.join(map(_in_words, kinds))})"


def _in_words(name: str) -> str:
    return name.replace("_", " ")


def _counted(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def tracking(metrics: Document) -> list[tuple[str, str, str, str]]:
    """(when, p, q, r): the RMS tracking errors in deg/s, before and after the fault."""
    rows = (("before", "pre_fault_rms_deg_s"), ("after", "post_fault_rms_deg_s"))
    tracked = [(when, metrics["tracking"][key]) for when, key in rows]
    return [(when, _value(rms["p"]), _value(rms["q"]), _value(rms["r"])) for when, rms in tracked if rms]


def expectations(metrics: Document) -> list[tuple[str, str, str, bool]]:
    """(name, expected, actual, passed) for each expectation."""
    return [
        (found["name"], _bound(found["expected"]), _actual(found), found["passed"])
        for found in metrics["expectations"]
    ]


def _actual(found: Document) -> str:
    """What came out, and why if the reason is known."""
    reason = found.get("reason")
    return _value(found["actual"]) + (f"; {reason}" if reason else "")


def verdict_text(metrics: Document, folder: str, colour: bool = False) -> str:
    """The verdict of one flight as a table for the terminal."""
    from rich.console import Console

    console = Console(file=io.StringIO(), force_terminal=colour, highlight=False, emoji=False, markup=False)
    with console.capture() as captured:
        console.print(_table(metrics, folder))
    return "\n".join(line.rstrip() for line in captured.get().splitlines()) + "\n"


def _table(metrics: Document, folder: str) -> "Table":
    from rich.table import Table
    from rich.text import Text

    style = {"good": "bold green", "lost": "bold yellow", "bad": "bold red"}[mood(metrics)]
    headline = Text(title(metrics), style)
    table = Table(title=headline, title_justify="left", show_header=False, box=None)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for what, how in facts(metrics):
        table.add_row(what, how)
    for i, (when, p, q, r) in enumerate(tracking(metrics)):
        table.add_row("" if i else "tracking RMS", f"p {p}  q {q}  r {r} deg/s {when} the fault")
    for name, expected, actual, passed in expectations(metrics):
        mark = Text("met   " if passed else "MISSED", "green" if passed else "bold red")
        table.add_row("expected", Text.assemble(mark, f" {name} {expected}, got {actual}"))
    if "certificate" in metrics:
        table.add_row("certificate", _certificate(metrics["certificate"], folder))
    table.add_row("results", folder)
    return table


def _certificate(written: Document, folder: str) -> str:
    """How many alarms and exclusions are certified, and the command that checks them."""
    if not written["statements"] and not written["without"]:
        return "nothing to certify: no alarm"
    without = f", {written['without']} not certified" if written["without"] else ""
    return f"{_counted(written['statements'], 'statement')}{without}; check: beaver-ftc check {folder}"


def _changed(change: Document) -> str:
    """What was changed in flight, and what a diagnosis that ended with it had found."""
    to = [f"{key} {change[key]}" for key in ("law", "scheme") if change[key]]
    said = f"{', '.join([*to, *(['sensors'] if change['sensors'] else [])]) or 'declared sensors'}"
    if change.get("detection_time_s") is None:
        return f"{said} at {_time(change['time_s'])}"
    found = change["isolated"] or "nothing named"
    alarm = "FALSE ALARM" if change["false_alarm"] else "alarm"
    before = f"{alarm} at {_time(change['detection_time_s'])}, {found}"
    return f"{said} at {_time(change['time_s'])}; the diagnosis before: {before}"


def _flight(metrics: Document) -> str:
    flown = metrics.get("flight")
    if not flown:
        return ""
    condition = f"{flown['airspeed_mps']:g} m/s at {flown['altitude_m']:g} m, {_time(flown['flown_s'])}"
    kind = ", every fault type" if flown["fault_class"] == "all" else ""
    return f"{condition}; diagnosis {flown['scheme']}{kind}; law {flown['law']}"


def _fault(fault: Document | None) -> str:
    if fault is None:
        return "none"
    until = f" to {_time(fault['end_s'])}" if fault.get("end_s") else ""
    place = f"sensor {fault['sensor']}" if "sensor" in fault else fault["actuator"] or ""
    what = f"{place} {fault['type'].replace('_', ' ')}".strip()
    size = ", ".join(_sizes(fault))
    return f"{what}{' (' + size + ')' if size else ''} at {_time(fault['at_s'])}{until}"


_CHANNELS = {
    "altitude_m": "altitude {} m", "airspeed_mps": "airspeed {} m/s", "heading_deg": "heading {} deg",
    "bank_deg": "bank {} deg",
}  # fmt: skip


def _profile(metrics: Document) -> str:
    """Largest deviations from the commanded profile; nothing where none was flown."""
    flown = [(name, worst) for name, worst in (metrics.get("profile") or {}).items() if worst is not None]
    off = ", ".join(_CHANNELS[name].format(_value(worst)) for name, worst in flown if name in _CHANNELS)
    return f"at most off by: {off}" if off else ""


_LIMITED = {"airspeed_mps": "airspeed to {} {:.1f} m/s", "bank_deg": "bank to {} {:.0f} deg"}


def _limit(limit: Document) -> str:
    """What envelope protection has limited, since when and why."""
    what = _LIMITED[limit["limits"]].format(limit["side"], limit["value"])
    until = "" if limit["in_force"] else ", no longer at the end"
    return f"{what} from {_time(limit['time_s'])}{until}: {limit['because']}"


def _sizes(fault: Document) -> list[str]:
    """How large a declared fault is, in words."""
    if "sensor" in fault:
        return _sensor_sizes(fault)
    from beaver_ftc.scenario.faults import TYPES

    row = TYPES.get(fault["type"])
    in_words = row.in_words if row else {}
    return [in_words[key](value) for key, value in fault.get("size", {}).items() if key in in_words]


def _sensor_sizes(fault: Document) -> list[str]:
    """The same of an instrument's fault, in the unit of the instrument."""
    from beaver_ftc.scenario.sensors import QUANTITIES

    size = fault["size"].get("magnitude")
    unit = QUANTITIES[fault["sensor"]].unit
    words = {"bias": "{:+g} {}", "noise": "{:g} {}", "scale": "{:+.0%}"}
    return [] if size is None else [words[fault["type"]].format(size, unit)]


def _true(isolation: Document, metrics: Document) -> str:
    """What the estimate ought to be, where the fault named is one that was declared."""
    from beaver_ftc.scenario.faults import TYPES

    if isolation["estimate"] is None:
        return ""
    row = TYPES.get(isolation["type"])
    key, sign = (row and row.truth) or ("", 1.0)
    sizes = [
        fault["size"][key]
        for fault in metrics.get("faults", ())
        if (fault["actuator"], fault["type"]) == (isolation["fault"], isolation["type"])
        and key in fault["size"]
    ]
    return f" (true {_value(sign * sizes[0])})" if sizes else ""


def _detection(metrics: Document) -> str:
    detection = metrics["detection"]
    if not detection["detected"]:
        return "no alarm"
    if metrics["false_alarm"] and detection["delay_s"] is None:
        return f"FALSE ALARM at {_time(detection['time_s'])} {_seen(detection)}"
    guaranteed = detection["guaranteed_delay_s"]
    within = "" if guaranteed is None else f" (certain within {_time(guaranteed)})"
    return f"after {_time(detection['delay_s'])} {_seen(detection)}{within}"


def _inconclusive(metrics: Document) -> str:
    """Where the diagnosis could conclude nothing; nothing if it could all the time."""
    found = metrics["detection"].get("inconclusive")
    return in_words(found) if found else ""


def _seen(detection: Document) -> str:
    """Where an alarm showed: on an axis, or between the instruments."""
    return f"on {detection['axis']}" if detection["axis"] else "between the instruments"


def _statistical(metrics: Document) -> str:
    """What the statistical detector would have said by itself; nothing if there was none."""
    said = metrics["detection"].get("statistical")
    if said is None:
        return ""
    when = "no alarm" if said["time_s"] is None else f"alarm at {_time(said['time_s'])}"
    level = f"level {said['alarm_level']:.2f} standard deviations"
    return f"{when}; {level}, in healthy flight at most {said['closest_approach']:.2f} of it"


def _isolation(metrics: Document) -> str:
    isolation = metrics["isolation"]
    return "; ".join([_found(isolation, metrics), *_withdrawn(isolation.get("withdrawn", ()))])


def _found(isolation: Document, metrics: Document) -> str:
    if isolation["isolated"]:
        return _one(isolation, metrics)
    left = isolation["candidates"]
    return _still_possible(left) if metrics["detection"]["detected"] and left else "none"


def _withdrawn(gone: Sequence[Document]) -> list[str]:
    """What was named before, for how long, each surface once."""
    spans: dict[str, list[float]] = {}
    for one in gone:
        spans.setdefault(one["fault"], []).append(one["to_s"] - one["from_s"])
    said = [
        f"{name} for {_time(times[0])}"
        if len(times) == 1
        else f"{name} {len(times)} times for {_time(sum(times))} in all"
        for name, times in spans.items()
    ]
    return [f"named before: {', '.join(said)}"] if said else []


def _one(isolation: Document, metrics: Document) -> str:
    """One named fault: `so far` of a surface that data may yet exclude, as they have every other."""
    far = " so far" if isolation.get("so_far") else ""
    when = "" if isolation["delay_s"] is None else f"{',' if far else ''} after {_time(isolation['delay_s'])}"
    right = "correct" if isolation["correct"] and isolation["type_correct"] is not False else "WRONG"
    if isolation.get("premature"):
        right = f"PREMATURE at {_time(isolation['time_s'])}"
    size = _estimate(isolation) + _true(isolation, metrics)
    return f"{isolation['fault']}{far}{when}, {right}{_type(isolation)}{size}"


def _probing(metrics: Document) -> str:
    instants = metrics["isolation"].get("probing_s")
    return f"flap and elevator moved from {_time(instants[0])} to {_time(instants[1])}" if instants else ""


def _type(isolation: Document) -> str:
    """The type, or those still possible; nothing where the class knows no other."""
    if str(isolation["fault"]).startswith("sensor "):
        return ""
    if isolation["type"] is None:
        left = isolation["candidates"]
        few = len(left) < MOST_LISTED
        return f", {' or '.join(map(_in_words, left)) or 'of no known type' if few else _open_types(left)}"
    return "" if isolation["type"] == "unanticipated" else f", {isolation['type'].replace('_', ' ')}"


def _estimate(isolation: Document) -> str:
    if isolation["estimate"] is None:
        return ""
    if isolation["estimate_deg"] is None:
        from beaver_ftc.scenario.faults import TYPES

        said = f"{TYPES[isolation['type']].symbol} {_value(isolation['estimate'])}"
        return f", estimated {said.strip()}"
    return f", estimated {_value(isolation['estimate_deg'])} deg"


def _supervisor(metrics: Document) -> str:
    changes = [f"{change['mode']} {_time(change['time_s'])}" for change in metrics["supervisor"]]
    left_out = metrics.get("mode_changes_left_out", 0)
    if left_out:
        changes.insert(-1, f"({left_out} more)")
    return " → ".join(changes)


def _engine_power(metrics: Document) -> str:
    power = metrics.get("engine_power")
    if not power:
        return ""
    span = f"{power['lowest_inhg']:.1f} to {power['highest_inhg']:.1f} inHg"
    return f"took over pitch at {_time(power['from_s'])}, for {_time(power['in_charge_s'])} in all, {span}"


MUCH_LEFT = 0.995  # of an axis: nothing to be said


def _authority(metrics: Document) -> str:
    """For how long no law could have held a rate, if long enough to matter."""
    axes = metrics.get("authority") or {}
    beyond_s = {
        axis: given["beyond_s"] for axis, given in axes.items() if given["beyond_s"] >= LEAST_BEYOND_S
    }
    if not beyond_s:
        return ""
    said = ", ".join(f"{axis} for {_time(time)}" for axis, time in beyond_s.items())
    return f"no deflection at all could hold the rate: {said}"


def _left(metrics: Document) -> str:
    """What the surfaces can still do about each axis, where it is less than if all were healthy."""
    said = []
    for axis, of in (metrics.get("authority") or {}).items():
        if "least_rad_s2" in of:
            whole = of["healthy_greatest_rad_s2"] - of["healthy_least_rad_s2"]
            share = (of["greatest_rad_s2"] - of["least_rad_s2"]) / whole
            most = of.get("engines_greatest_rad_s2", 0.0)
            if share < MUCH_LEFT or most:
                span = f"{of['least_rad_s2']:.2g} to {of['greatest_rad_s2']:.2g} rad/s2"
                engines = f", and engines {of['engines_least_rad_s2']:.2g} to {most:.2g}" if most else ""
                said.append(f"{axis} {share:.0%}, {span}{engines}")
    return f"of what all surfaces together give: {'; '.join(said)}" if said else ""


def _envelope(metrics: Document) -> str:
    exits = metrics["envelope_exits"]
    if not exits:
        return ""
    count, total_s = metrics["envelope"]["exits"], metrics["envelope"]["outside_s"]
    return f"left {count} time(s), {_time(total_s)} in all, first at {_time(exits[0]['start_s'])}"


def _departure(metrics: Document) -> str:
    departure = metrics["departure"]
    return f"LOST at {_time(departure['time_s'])}: {departure['signal']}" if departure else ""


# What of a link's counts is worth a word, if there was any.
_COUNTED = {
    "repeated": "sent again", "late": "late", "missed": "never came", "malformed": "malformed",
    "strangers": "of others", "off_rate": "at another rate", "resets": "times begun anew",
}  # fmt: skip


def _link(metrics: Document) -> str:
    """How an autopilot was served; nothing where a law of ours flew."""
    link = metrics.get("link")
    if not link:
        return ""
    latency, interval = link["latency_ms"], link["interval_ms"]
    odd = "".join(f", {link[name]} {words}" for name, words in _COUNTED.items() if link[name])
    times = (
        f"answered in {latency['median']:.2f} ms (99 %: {latency['p99']:.2f}), asked every "
        f"{interval['mean']:.2f} ms, jitter {interval['jitter_rms']:.2f} ms RMS"
    )
    return f"{link['protocol']}, {link['frames']} frames at {link['packets_hz']:g} Hz{odd}; {times}"


def _saturation(metrics: Document) -> str:
    return ", ".join(f"{surface} {_time(time)}" for surface, time in metrics["saturation_s"].items() if time)


def _bound(expected: Any) -> str:
    at_most = isinstance(expected, int | float) and not isinstance(expected, bool)
    return f"≤ {_value(expected)}" if at_most else _value(expected)


def _time(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds < 1000 else f"{seconds:.1f} s"


def _value(value: Any) -> str:
    """A value of the metrics for people: what is expected, and what came out, of any key of `expect:`."""
    if value is None or value == []:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(_value(entry) for entry in value)
    return value if isinstance(value, str) else f"{value:.3g}"
