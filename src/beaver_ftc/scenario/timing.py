"""Instants of a scenario and the frames of a flight: whether something has happened by then."""

from math import ceil

# Frame times are k / rate_hz in floating point: what happens at t is in force in the first frame whose time
# is not before t - TIME_TOLERANCE_S.
TIME_TOLERANCE_S = 1e-9


def frame_of(time_s: float, rate_hz: float) -> int:
    """The first frame k whose time k / rate_hz is not before time_s."""
    return ceil((time_s - TIME_TOLERANCE_S) * rate_hz)


def first_frame_s(time_s: float, rate_hz: float) -> float:
    """Time, s, of that frame."""
    return frame_of(time_s, rate_hz) / rate_hz
