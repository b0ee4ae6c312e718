"""Values, times and names as all words of a flight write them."""

from typing import Any

MOTION_OF_AXIS = {"p": "roll", "q": "pitch", "r": "yaw"}


def value_text(value: Any) -> str:
    """An expected or actual value of any key of `expect:` as text."""
    if value in (None, (), []):
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple | list):
        return ", ".join(value_text(entry) for entry in value)
    return value if isinstance(value, str) else three_digits(value)


def without_underscores(name: str) -> str:
    """A name of the code in words."""
    return name.replace("_", " ")


def three_digits(value: float) -> str:
    """A number of three significant digits, without an exponent from 0.0001 to a million: 1230, not
    1.23e+03."""
    return f"{float(f'{value:.3g}'):g}"


def span_text(begin_s: float, end_s: float | None) -> str:
    """A span of time, s; only the begin if it has no end."""
    begin = seconds_text(begin_s)
    return begin if end_s is None else f"{begin} to {seconds_text(end_s)}"


def seconds_text(seconds: float | None) -> str:
    """A time as text, with one digit less from 1000 s on."""
    if seconds is None:
        return "none"
    return f"{seconds:.2f} s" if seconds < 1000 else f"{seconds:.1f} s"
