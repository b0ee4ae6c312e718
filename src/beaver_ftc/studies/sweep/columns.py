"""The columns of a sweep's table with the outcome of a flight: its metrics, by path, and a few more.

A path's type follows from the metrics model; `*` is each surface.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, get_args, get_origin, get_type_hints

from beaver_ftc.results.model import Metrics, Window, without_none

WORST_RATIO = "worst_residual_ratio"
Getter = Callable[[Metrics], Any]

NAMES = (
    "frames", "flown_s", "fault_free_s", "fault.actuator", "fault.type", "fault.at_s", "detection.detected",
    "detection.time_s", "detection.delay_s", "detection.guaranteed_delay_s", "detection.axis",
    "detection.inconclusive.share", "detection.statistical.time_s", "detection.statistical.alarm_level",
    "detection.statistical.closest_approach", "isolation.isolated", "isolation.correct", "isolation.fault",
    "isolation.type", "isolation.time_s", "isolation.delay_s", "isolation.estimate",
    "isolation.type_correct", "isolation.type_delay_s", "isolation.estimate_deg",
    "isolation.frequency_rad_s", "isolation.estimate_interval.low", "isolation.estimate_interval.high",
    "isolation.probing_s.from", "isolation.probing_s.to", "isolation.so_far", "isolation.premature",
    "isolation.withdrawn", "isolation.candidates", "isolation.faults", "windows.detected",
    "windows.correct", "false_alarm",
    WORST_RATIO, "tracking.pre_fault_rms_deg_s.p", "tracking.pre_fault_rms_deg_s.q",
    "tracking.pre_fault_rms_deg_s.r", "tracking.post_fault_rms_deg_s.p", "tracking.post_fault_rms_deg_s.q",
    "tracking.post_fault_rms_deg_s.r", "tracking.surface_travel_deg.*", "tracking.surface_energy_deg2_s.*",
    "supervisor.mode", "supervisor.adaptive_at_s", "supervisor.reallocated_at_s",
    "supervisor.unanticipated_at_s", "envelope_exits.count", "envelope_exits.total_s", "departure.time_s",
    "departure.signal", "authority.p.given_share", "authority.p.beyond_s", "authority.q.given_share",
    "authority.q.beyond_s", "authority.r.given_share", "authority.r.beyond_s", "profile.altitude_m",
    "profile.airspeed_mps", "profile.airspeed_limited_mps", "profile.airspeed_at_one_instant_mps",
    "profile.heading_deg", "profile.bank_deg",
    "arrival.altitude_m", "arrival.airspeed_mps", "arrival.heading_deg", "arrival.bank_deg",
    "arrival.in_envelope", "engine_power.from_s", "engine_power.in_charge_s", "engine_power.lowest_inhg",
    "engine_power.highest_inhg", "saturation_s.*", "expectations.missed", "passed",
)  # fmt: skip
_KINDS = {float: "float", int: "int", bool: "flag", str: "text"}


def _faults(metrics: Metrics) -> str:
    """surface:type of each fault that was named, of several at once."""
    named = (one for one in metrics.isolation.faults if one.fault)
    return " ".join(f"{one.fault}:{one.type or 'open'}" for one in named)


def _of_each_window(holds: Callable[[Window], bool]) -> Getter:
    """`yes` or `no` of each window, in the order of time; empty without windows."""
    return lambda metrics: " ".join("yes" if holds(one) else "no" for one in metrics.windows or ())


def _first_entry(mode: str) -> Getter:
    """When the supervisor first entered a mode, s."""
    return lambda metrics: next((change.time_s for change in metrics.supervisor if change.mode == mode), None)


def _end_of_pair(name: str, end: int) -> Getter:
    """The first (0) or second (1) value of a pair in the section `isolation`."""
    return lambda metrics: (getattr(metrics.isolation, name) or (None, None))[end]


# Columns whose names are no paths of the metrics: their types, and the functions that read them.
_ELSEWHERE: dict[str, tuple[str, Getter]] = {
    "flown_s": ("float", lambda metrics: metrics.frames / metrics.flight.rate_hz),
    WORST_RATIO: ("float", lambda metrics: None),  # which `row_of` has of the landing
    "isolation.estimate_interval.low": ("float", _end_of_pair("estimate_interval", 0)),
    "isolation.estimate_interval.high": ("float", _end_of_pair("estimate_interval", 1)),
    "isolation.probing_s.from": ("float", _end_of_pair("probing_s", 0)),
    "isolation.probing_s.to": ("float", _end_of_pair("probing_s", 1)),
    "isolation.candidates": ("text", lambda metrics: " ".join(metrics.isolation.candidates)),
    "isolation.faults": ("text", _faults),
    "isolation.withdrawn": (
        "text", lambda metrics: " ".join(gone.fault for gone in metrics.isolation.withdrawn),
    ),
    "windows.detected": ("text", _of_each_window(lambda window: window.detected)),
    "windows.correct": (
        "text",
        _of_each_window(
            lambda window: all(one.correct and one.type_correct is not False for one in window.isolation)
        ),
    ),
    "supervisor.mode": ("text", lambda metrics: metrics.supervisor[-1].mode),
    "supervisor.adaptive_at_s": ("float", _first_entry("adaptive")),
    "supervisor.reallocated_at_s": ("float", _first_entry("reallocated")),
    "supervisor.unanticipated_at_s": ("float", _first_entry("unanticipated")),
    "envelope_exits.count": ("int", lambda metrics: metrics.envelope.exits),
    "envelope_exits.total_s": ("float", lambda metrics: metrics.envelope.outside_s),
    "expectations.missed": (
        "text", lambda metrics: " ".join(one.name for one in metrics.expectations if not one.passed),
    ),
}  # fmt: skip


@cache
def columns_of(surfaces: tuple[str, ...]) -> dict[str, str]:
    """Name and type of each column, for an aircraft with these surfaces."""
    return {
        name: _kind(pattern)
        for pattern in NAMES
        for name in ([pattern.replace("*", one) for one in surfaces] if "*" in pattern else [pattern])
    }


def _kind(path: str) -> str:
    """The type of the column at a path of the metrics."""
    if path in _ELSEWHERE:
        return _ELSEWHERE[path][0]
    hint: Any = Metrics
    for part in path.split("."):  # a mapping, of surfaces or axes, has values of one type
        hint = get_args(hint)[1] if get_origin(hint) is dict else get_type_hints(hint)[part]
        hint = without_none(hint)
    return _KINDS[hint]


@cache
def getter_of(name: str) -> Getter:
    """The function that reads a column from the metrics; it gives None where a section on the way is None."""
    if name in _ELSEWHERE:
        return _ELSEWHERE[name][1]
    return lambda metrics: metrics.at(name)
