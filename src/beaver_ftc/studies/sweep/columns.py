"""The columns with results in the table of a sweep: paths of the metrics of a flight, and derived columns.

The type of a path follows from the records of the metrics.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from beaver_ftc.results.model import Metrics, Window
from beaver_ftc.results.part import without_none

WORST_RATIO = "worst_residual_ratio"
Getter = Callable[[Metrics], Any]
_KINDS = {float: "float", int: "int", bool: "flag", str: "text"}  # type of a column by that of its values


class Derived(NamedTuple):
    """A column whose name is no path of the metrics: its name, its type, and the function that reads it."""

    name: str
    kind: str
    read: Getter


def _pair(path: str, *ends: str) -> Iterator[Derived]:
    """A column for each of the two values of a pair in the metrics, None if there is no pair. ends: their
    names."""
    for end, name in enumerate(ends):
        yield Derived(f"{path}.{name}", "float", partial(_value_of_pair, path, end))


def _value_of_pair(path: str, end: int, metrics: Metrics) -> float | None:
    pair = metrics.at(path)
    return None if pair is None else pair[end]


def _faults(metrics: Metrics) -> str:
    """`surface:type` of each named fault, if several are named at once; `surface:open` without a type."""
    named = (fault for fault in metrics.isolation.faults if fault.fault)
    return " ".join(f"{fault.fault}:{fault.type or 'open'}" for fault in named)


def _withdrawn(metrics: Metrics) -> str:
    return " ".join(withdrawn.fault for withdrawn in metrics.isolation.withdrawn)


def _missed(metrics: Metrics) -> str:
    return " ".join(expectation.name for expectation in metrics.expectations if not expectation.passed)


def _in_each_window(holds: Callable[[Window], bool], metrics: Metrics) -> str:
    """`yes` or `no` for each window, in the order of time; empty without windows."""
    return " ".join("yes" if holds(window) else "no" for window in metrics.windows or ())


def _is_named(window: Window) -> bool:
    """Whether every name in a window is correct, and every named type."""
    return all(named.correct and named.type_correct is not False for named in window.isolation)


def _first_entry(mode: str, metrics: Metrics) -> float | None:
    """Time at which the supervisor first entered a mode, s; None if it did not."""
    return next((change.time_s for change in metrics.supervisor if change.mode == mode), None)


# The columns in order: paths of the metrics, in which * stands for each surface, and derived columns.
COLUMNS: tuple[str | Derived, ...] = (
    "frames", Derived("flown_s", "float", lambda metrics: metrics.frames / metrics.flight.rate_hz),
    "fault_free_s", "fault.actuator", "fault.type", "fault.at_s",

    "detection.detected", "detection.time_s", "detection.delay_s", "detection.guaranteed_delay_s",
    "detection.axis", "detection.inconclusive.share", "detection.statistical.time_s",
    "detection.statistical.alarm_level", "detection.statistical.closest_approach",

    "isolation.isolated", "isolation.correct", "isolation.fault", "isolation.type", "isolation.time_s",
    "isolation.delay_s", "isolation.estimate", "isolation.type_correct", "isolation.type_delay_s",
    "isolation.estimate_deg", "isolation.frequency_rad_s",
    *_pair("isolation.estimate_interval", "low", "high"), *_pair("isolation.probing_s", "from", "to"),
    "isolation.so_far", "isolation.premature", Derived("isolation.withdrawn", "text", _withdrawn),
    Derived("isolation.candidates", "text", lambda metrics: " ".join(metrics.isolation.candidates)),
    Derived("isolation.faults", "text", _faults),
    Derived("windows.detected", "text", partial(_in_each_window, lambda window: window.detected)),
    Derived("windows.correct", "text", partial(_in_each_window, _is_named)),

    "false_alarm", Derived(WORST_RATIO, "float", lambda metrics: None),  # `row_of` takes it from the landing
    "tracking.pre_fault_rms_deg_s.p", "tracking.pre_fault_rms_deg_s.q", "tracking.pre_fault_rms_deg_s.r",
    "tracking.post_fault_rms_deg_s.p", "tracking.post_fault_rms_deg_s.q", "tracking.post_fault_rms_deg_s.r",
    "tracking.surface_travel_deg.*", "tracking.surface_energy_deg2_s.*",

    Derived("supervisor.mode", "text", lambda metrics: metrics.supervisor[-1].mode),
    Derived("supervisor.adaptive_at_s", "float", partial(_first_entry, "adaptive")),
    Derived("supervisor.reallocated_at_s", "float", partial(_first_entry, "reallocated")),
    Derived("supervisor.unanticipated_at_s", "float", partial(_first_entry, "unanticipated")),

    Derived("envelope_exits.count", "int", lambda metrics: metrics.envelope.exits),
    Derived("envelope_exits.total_s", "float", lambda metrics: metrics.envelope.outside_s),
    "departure.time_s", "departure.signal", "authority.p.given_share", "authority.p.beyond_s",
    "authority.q.given_share", "authority.q.beyond_s", "authority.r.given_share", "authority.r.beyond_s",

    "profile.altitude_m", "profile.airspeed_mps", "profile.airspeed_limited_mps",
    "profile.airspeed_at_one_instant_mps", "profile.heading_deg", "profile.bank_deg",
    "arrival.altitude_m", "arrival.airspeed_mps", "arrival.heading_deg", "arrival.bank_deg",
    "arrival.in_envelope", "engine_power.from_s", "engine_power.in_charge_s", "engine_power.lowest_inhg",
    "engine_power.highest_inhg", "saturation_s.*",

    Derived("expectations.missed", "text", _missed), "passed",
)  # fmt: skip
_GETTERS = {column.name: column.read for column in COLUMNS if isinstance(column, Derived)}


@cache
def columns_of(surfaces: tuple[str, ...]) -> dict[str, str]:
    """Name and type of each column, for an aircraft with these surfaces."""
    kinds = {}
    for column in COLUMNS:
        if isinstance(column, Derived):
            kinds[column.name] = column.kind
        else:
            kind = _kind(column)
            kinds |= {
                column.replace("*", surface): kind for surface in (surfaces if "*" in column else ("",))
            }
    return kinds


def _kind(path: str) -> str:
    """The type of the column at a path of the metrics."""
    hint: Any = Metrics
    for part in path.split("."):  # the values of a mapping have one type
        hint = get_args(hint)[1] if get_origin(hint) is dict else get_type_hints(hint)[part]
        hint = without_none(hint)
    return _KINDS[hint]


def getter_of(name: str) -> Getter:
    """The function that reads a column from the metrics. That of a path returns None if a section on the way
    is None."""
    return _GETTERS.get(name) or (lambda metrics: metrics.at(name))
