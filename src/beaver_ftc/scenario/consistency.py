"""What the sections of a scenario must not say against each other.

Checked on an outline that a finished scenario and a half-wrong file both have, so that a contradiction is
reported along with the mistakes of the sections and not only after they are mended.
"""

from math import isfinite
from typing import Any, NamedTuple

from beaver_ftc.scenario.base import Conflict

DURATION_S = 30.0
RATE_HZ = 100.0
OF_A_FAULT = (
    "detected_within_s", "isolated_as", "isolated_type", "candidate_type", "isolated_within_s",
    "post_fault_rms_deg_s",
)  # fmt: skip


_OF_A_PROFILE = {
    "altitude_within_m": "altitude_m",
    "airspeed_within_mps": "airspeed_mps",
    "heading_within_deg": "heading_deg",
}


class Outline(NamedTuple):
    """The values that must fit together; None is unknown, for instance because it is itself a mistake."""

    duration_s: float | None
    rate_hz: float | None
    starts_s: tuple[float | None, ...] | None
    expected: tuple[str, ...]
    flown: tuple[str, ...] | None = ()  # channels of the autopilot


def outline_of_data(data: dict[str, Any]) -> Outline:
    """The outline of a file's raw data, whatever it is."""
    faults, expect = data.get("faults", []), data.get("expect")
    starts_s = [fault.get("at_s") if isinstance(fault, dict) else None for fault in _as_list(faults)]
    return Outline(
        duration_s=_positive(data.get("duration_s", DURATION_S)),
        rate_hz=_positive(data.get("rate_hz", RATE_HZ)),
        starts_s=tuple(map(_positive, starts_s)) if isinstance(faults, list) else None,
        expected=tuple(key for key, value in expect.items() if value is not None)
        if isinstance(expect, dict)
        else (),
        flown=_flown(data.get("autopilot")),
    )


def conflicts_in_data(data: dict[str, Any]) -> list[Conflict]:
    """Every contradiction in a file's raw data, whatever else is wrong with it."""
    return conflicts(outline_of_data(data))


def conflicts(outline: Outline) -> list[Conflict]:
    """Every contradiction, at the key to change."""
    return [
        *_too_short(outline),
        *_too_late(outline),
        *_expected_of_no_fault(outline),
        *_expected_of_no_profile(outline),
    ]


def _flown(autopilot: Any) -> tuple[str, ...] | None:
    if not isinstance(autopilot, dict | None):
        return None
    return tuple(key for key, legs in (autopilot or {}).items() if legs)


def _too_short(outline: Outline) -> list[Conflict]:
    duration_s, rate_hz = outline.duration_s, outline.rate_hz
    if duration_s is None or rate_hz is None or duration_s * rate_hz >= 1:
        return []
    return [(("duration_s",), f"{duration_s:g} is less than one frame, allowed: at least {1 / rate_hz:g} s")]


def _too_late(outline: Outline) -> list[Conflict]:
    end_s = outline.duration_s
    if end_s is None:
        return []
    allowed = f"allowed: earlier than duration_s, {end_s:g} s"
    starts_s = enumerate(outline.starts_s or ())
    return [
        (("faults", i, "at_s"), f"{at_s:g} is after the end, {allowed}")
        for i, at_s in starts_s
        if at_s is not None and at_s >= end_s
    ]


def _expected_of_no_fault(outline: Outline) -> list[Conflict]:
    if outline.starts_s is None or outline.starts_s:
        return []
    says = "there is no fault to expect it of, allowed: only with faults"
    return [(("expect", key), says) for key in outline.expected if key in OF_A_FAULT]


def _expected_of_no_profile(outline: Outline) -> list[Conflict]:
    if outline.flown is None:
        return []
    return [
        (("expect", key), f"there is no profile to expect it of, allowed: only with autopilot.{channel}")
        for key, channel in _OF_A_PROFILE.items()
        if key in outline.expected and channel not in outline.flown
    ]


def _as_list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _positive(value: Any) -> float | None:
    """The value if it is a positive finite number."""
    usable = (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and 0 < value <= 1e9
        and isfinite(value)
    )
    return float(value) if usable else None
