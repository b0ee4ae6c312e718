"""What the sections of a scenario must not say against each other.

Checked on an outline that a finished scenario and a half-wrong file both have, so that a contradiction is
reported along with the mistakes of the sections and not only after they are mended.
"""

from collections.abc import Mapping
from itertools import pairwise
from math import isfinite
from typing import Any, NamedTuple

from beaver_ftc.documents.base import Conflict

DURATION_S = 30.0
RATE_HZ = 100.0
OF_A_FAULT = (
    "detected_within_s", "isolated_as", "isolated_type", "candidate_type", "isolated_within_s",
    "post_fault_rms_deg_s",
)  # fmt: skip


_OF_A_PROFILE = {
    "altitude_within_m": "altitude_m",
    "airspeed_within_mps": "airspeed_mps",
    "airspeed_within_limits_mps": "airspeed_mps",
    "heading_within_deg": "heading_deg",
    **{f"arrives.{channel}": channel for channel in ("altitude_m", "airspeed_mps", "heading_deg")},
}


class Outline(NamedTuple):
    """The values that must fit together; None is unknown, for instance because it is itself a mistake."""

    duration_s: float | None
    rate_hz: float | None
    starts_s: tuple[float | None, ...] | None
    expected: tuple[str, ...]
    flown: tuple[str, ...] | None = ()  # channels of the autopilot
    changes_s: tuple[float | None, ...] | None = ()


def outline_of_data(data: dict[str, Any]) -> Outline:
    """The outline of a file's raw data, whatever it is."""
    faults, expect = data.get("faults", []), data.get("expect")
    return Outline(
        duration_s=_positive(data.get("duration_s", DURATION_S)),
        rate_hz=_positive(data.get("rate_hz", RATE_HZ)),
        starts_s=_instants(faults),
        expected=keys_expected(expect) if isinstance(expect, dict) else (),
        flown=_flown(data.get("autopilot")),
        changes_s=_instants(data.get("changes", [])),
    )


def keys_expected(expect: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys of `expect` that are given; those inside another with a dot."""
    given = [(str(key), value) for key, value in expect.items() if value is not None]
    inside = [(key, value) for key, value in given if isinstance(value, Mapping)]
    return (
        *(key for key, _ in given),
        *(f"{key}.{part}" for key, value in inside for part in value if value[part] is not None),
    )


def conflicts_in_data(data: dict[str, Any]) -> list[Conflict]:
    """Every contradiction in a file's raw data, whatever else is wrong with it."""
    return conflicts(outline_of_data(data))


def conflicts(outline: Outline) -> list[Conflict]:
    """Every contradiction, at the key to change."""
    return [
        *_too_short(outline),
        *_too_late(outline),
        *_out_of_order(outline),
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
    return [
        ((section, i, "at_s"), f"{at_s:g} is after the end, {allowed}")
        for section, starts_s in (("faults", outline.starts_s), ("changes", outline.changes_s))
        for i, at_s in enumerate(starts_s or ())
        if at_s is not None and at_s >= end_s
    ]


def _out_of_order(outline: Outline) -> list[Conflict]:
    """Changes stand in the order in which they come, so that a reader need not sort them."""
    changes_s = outline.changes_s or ()
    return [
        (
            ("changes", i, "at_s"),
            f"{late:g} is not after the change before it, allowed: later than {early:g} s",
        )
        for i, (early, late) in enumerate(pairwise(changes_s), start=1)
        if early is not None and late is not None and late <= early
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
        (
            ("expect", *key.split(".")),
            f"there is no profile to expect it of, allowed: only with autopilot.{channel}",
        )
        for key, channel in _OF_A_PROFILE.items()
        if key in outline.expected and channel not in outline.flown
    ]


def _instants(given: Any) -> tuple[float | None, ...] | None:
    """`at_s` of each entry of a list."""
    if not isinstance(given, list):
        return None
    return tuple(_positive(entry.get("at_s")) if isinstance(entry, dict) else None for entry in given)


def _positive(value: Any) -> float | None:
    """The value if it is a positive finite number."""
    usable = (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and 0 < value <= 1e9
        and isfinite(value)
    )
    return float(value) if usable else None
