"""The verdict of a flight in words, for the terminal and the head of the report.

All words are computed from the metrics, so that they cannot disagree with metrics.json. A line of the verdict
is a pair (name, text); without a text, it is left out.
"""

import re
from collections.abc import Callable, Sequence
from typing import Any

from beaver_ftc.results.expectations import expectations_in_words
from beaver_ftc.results.fault_words import fault_text, isolation_texts, window_text
from beaver_ftc.results.model import (
    Authority,
    CertificateCounts,
    ChangeInFlight,
    FlightCondition,
    Link,
    Metrics,
    Part,
    ProfileDeviations,
    ProtectionLimit,
    Statistical,
)
from beaver_ftc.results.terminal import printed, verdict_table
from beaver_ftc.results.words import MOTION_OF_AXIS, seconds_text, span_text, value_text
from beaver_ftc.scenario.measured_range import in_words
from beaver_ftc.scenario.warnings import wider

MIN_SHOWN_BEYOND_S = 0.1  # a shorter time without sufficient authority is not printed
MAX_SHOWN_AUTHORITY_SHARE = 0.995  # an axis with a larger share has lost nothing worth saying
_TIME = re.compile("(?<!_deg|_rad)_s$")  # names of fields in seconds, without rates
_ASSUMPTION_TEXT = {"sensors-sound": "sensors are sound (A11)"}


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
    probing_s = metrics.isolation.probing_s
    lines = (
        ("flight", _if_there(_condition_text, metrics.flight)),
        *headed("fault", [fault_text(fault, metrics.faults) for fault in declared]),
        ("assumed", ", ".join(_ASSUMPTION_TEXT.get(name, name) for name in metrics.assumes)),
        ("outside", _outside_class_text(metrics)),
        ("detection", _detection_text(metrics)),
        (
            "inconclusive",
            _if_there(lambda section: in_words(section.document()), metrics.detection.inconclusive),
        ),
        ("statistical", _if_there(_statistical_text, metrics.detection.statistical)),
        *headed("isolation", isolation_texts(metrics)),
        *headed("windows", [window_text(window, metrics) for window in metrics.windows or ()]),
        ("probing", f"flap and elevator moved from {span_text(*probing_s)}" if probing_s else ""),
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
        ("saturation", ", ".join(f"{s} {seconds_text(t)}" for s, t in metrics.saturation_s.items() if t)),
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
        name: seconds_text(value) if _TIME.search(name) else value for name, value in vars(section).items()
    }
    return form.format(**values, **more)


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
    errors = [
        f"p {p}  q {q}  r {r} deg/s {when} the fault" for when, p, q, r in tracking_rms_in_words(metrics)
    ]
    lines = verdict_lines(metrics) + headed("tracking RMS", errors)
    expectations = [
        (expectation.passed, expectation.sentence) for expectation in expectations_in_words(metrics)
    ]
    written = metrics.certificate
    last_lines = [("certificate", _certificate_text(folder, written))] if written else []
    table = verdict_table((title(metrics), style), lines, expectations, [*last_lines, ("results", folder)])
    return f"{printed([table], colour=colour)}\n"


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
    alarm = "no alarm" if statistical.time_s is None else f"alarm at {seconds_text(statistical.time_s)}"
    return _filled(
        "{alarm}; threshold {alarm_level:.2f} σ, peak in healthy flight {closest_approach:.2f} of it",
        statistical,
        alarm=alarm,
    )


def _supervisor_text(metrics: Metrics) -> str:
    """The modes with their times; before the last one, how many are left out."""
    changes = [f"{change.mode} {seconds_text(change.time_s)}" for change in metrics.supervisor]
    if metrics.mode_changes_left_out:
        changes.insert(-1, f"({metrics.mode_changes_left_out} more)")
    return " → ".join(changes)


def _insufficient_authority_text(authority: Authority) -> str:
    """For how long no deflection could hold the rate of each axis; times below MIN_SHOWN_BEYOND_S are left
    out."""
    beyond = ", ".join(
        f"{axis} for {seconds_text(entry.beyond_s)}"
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
        first=seconds_text(metrics.envelope_exits[0].start_s),
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
