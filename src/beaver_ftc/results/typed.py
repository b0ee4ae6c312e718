"""The document metrics.json, typed: frozen records with the document's own keys.

Times are s since the start, delays s since the first fault, rates deg/s; None is what there is not.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Self


@dataclass(frozen=True)
class _Part:
    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """From a section of the document; lists become tuples, numbers by axis Rates."""
        return cls(**{field.name: _frozen(document.get(field.name)) for field in fields(cls)})


def _frozen(value: Any) -> Any:
    if isinstance(value, dict):
        return Rates.of(value)
    return tuple(_frozen(entry) for entry in value) if isinstance(value, list) else value


@dataclass(frozen=True)
class Fault(_Part):
    """The first fault declared; actuator is None for an unanticipated one."""

    actuator: str | None
    type: str
    at_s: float


@dataclass(frozen=True)
class Detection(_Part):
    """The alarm. guaranteed_delay_s: from the fault to the instant from which it was certain."""

    detected: bool
    time_s: float | None
    delay_s: float | None
    axis: str | None
    guaranteed_delay_s: float | None


@dataclass(frozen=True)
class Isolation(_Part):
    """What was named. estimate: theta in [-1, 0] for a loss of effectiveness, else rad; candidates: the fault
    types (or surfaces) still possible. so_far: a surface named by exclusion, which data may yet exclude.
    premature: named before the fault began. names: all names given, in the order of the faults."""

    isolated: bool
    fault: str | None
    type: str | None
    time_s: float | None
    delay_s: float | None
    correct: bool | None
    type_correct: bool | None
    estimate: float | None
    estimate_deg: float | None
    estimate_interval: tuple[float, float] | None
    candidates: tuple[str, ...]
    so_far: bool | None
    premature: bool | None
    names: tuple[str, ...]


@dataclass(frozen=True)
class Rates(_Part):
    """One number an axis, deg/s."""

    p: float | None
    q: float | None
    r: float | None


@dataclass(frozen=True)
class Tracking(_Part):
    """RMS tracking errors, deg/s; None where there was no such time."""

    pre_fault_rms_deg_s: Rates | None
    post_fault_rms_deg_s: Rates | None


@dataclass(frozen=True)
class ModeChange(_Part):
    """Who is in charge from when on."""

    time_s: float
    mode: str


@dataclass(frozen=True)
class Departure(_Part):
    """When the aircraft was lost, and which signal left its limits."""

    time_s: float
    signal: str


@dataclass(frozen=True)
class Expectation(_Part):
    """One of the scenario's expectations, and what came out; the reason of one that is not met, if it is
    known."""

    name: str
    passed: bool
    expected: Any
    actual: Any
    reason: str | None = None


def every(part: type[Any], documents: Iterable[Mapping[str, Any]]) -> tuple[Any, ...]:
    """One record for each section of a list."""
    return tuple(part.of(document) for document in documents)
