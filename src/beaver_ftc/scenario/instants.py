"""Instants as frames: what happens at a time is in force in the first frame whose time is not before it."""

from math import ceil, exp, inf
from typing import Any

# Frame times are k / rate_hz in floating point: what happens at t is in force in the first frame whose time
# is not before t - TIME_TOLERANCE_S.
TIME_TOLERANCE_S = 1e-9
LATEST_S = 360_000.0  # the latest instant that a scenario may name


def is_before(t_s: Any, at_s: float) -> Any:
    """Whether a time (or each of several) is before that instant, by more than rounding."""
    return t_s < at_s - TIME_TOLERANCE_S


def is_in_force(fault: Any, t_s: Any) -> Any:
    """Whether a fault is there at a time, or at each of several: begun, and neither repaired nor over."""
    ends_s = inf if fault.end_s is None else fault.end_s
    return (t_s >= fault.at_s - TIME_TOLERANCE_S) & is_before(t_s, ends_s)


def grown_share(fault: Any, t_s: float) -> float:
    """B(t - T0), 0 to 1: how far a fault that has begun has grown [Zhang2005]."""
    if fault.profile != "incipient":
        return 1.0
    return 1.0 - exp(-fault.kappa_per_s * max(0.0, t_s - fault.at_s))


def frame_of(time_s: float, rate_hz: float) -> int:
    """The first frame k whose time k / rate_hz is not before time_s."""
    return ceil((time_s - TIME_TOLERANCE_S) * rate_hz)


def first_frame_s(time_s: float, rate_hz: float) -> float:
    """Time, s, of that frame."""
    return frame_of(time_s, rate_hz) / rate_hz
