"""Times as text: a number with a unit, a time of day, or a date with a time of day (ISO 8601)."""

import re
from datetime import UTC, datetime
from math import nan

_UNIT_PATTERN = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(s|secs?|seconds?|ms|msecs?|milliseconds?|us|usecs?|"
    r"microseconds?|ns|min|minutes?)\.?"
)
_UNIT_SECONDS = {
    "ms": 1e-3, "mil": 1e-3, "us": 1e-6, "mic": 1e-6, "ns": 1e-9, "min": 60.0, "s": 1.0,
}  # fmt: skip
_CLOCK_PATTERN = re.compile(r"(?:(\d{1,2}):(?=[0-5]?\d:))?(\d{1,2}):((?:[0-5]\d|60)(?:[.,]\d+)?)")
_DATE_PATTERN = re.compile(
    r"\d{4}([-/]?)\d{2}\1\d{2}[T ]\d{2}:?\d{2}(:?\d{2}([.,]\d+)?)?\s*(Z|[+-]\d{2}(:?\d{2})?)?"
)
_S_PER_DAY = 86400.0


def seconds_of_text(text: str) -> float:
    """The time in a cell, s; nan if there is none.

    0.05 sec                 the number in s
    12:30:01.5, 59:59.5      since midnight, or since the full hour
    2026-11-30T12:30:01      since 1970, in UTC if no zone is given
    """
    text = text.strip()
    if match := _UNIT_PATTERN.fullmatch(text):
        factors = (factor for unit, factor in _UNIT_SECONDS.items() if match[2].startswith(unit))
        return float(match[1]) * next(factors)
    if match := _CLOCK_PATTERN.fullmatch(text):
        hours = int(match[1] or 0)
        minutes = int(match[2])
        seconds = float(match[3].replace(",", "."))
        return 3600.0 * hours + 60.0 * minutes + seconds
    if _DATE_PATTERN.fullmatch(text):
        try:
            moment = datetime.fromisoformat(text.replace("/", "-").replace(",", ".").replace(" Z", "Z"))
        except ValueError:
            return nan
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    return nan


class DayCount:
    """Counter of the midnights in a column of times of day: a step back by more than half a day is a
    midnight.

    A column of only minutes and seconds (59:59.5, 00:00.0) returns to 0 each hour, and is not continued.
    """

    def __init__(self) -> None:
        self._days = 0
        self._last = 0.0

    def seconds_of_text(self, text: str) -> float:
        """The time in a cell, s; a time of day counts from the first midnight."""
        seconds = seconds_of_text(text)
        if not _CLOCK_PATTERN.fullmatch(text.strip()):
            return seconds
        self._days += seconds < self._last - 0.5 * _S_PER_DAY
        self._last = seconds
        return seconds + _S_PER_DAY * self._days
