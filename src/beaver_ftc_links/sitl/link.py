"""Packets of an autopilot, and times of the answers: counts, and two histograms of fixed size."""

from bisect import bisect_left
from collections import Counter
from math import sqrt
from typing import Any

# Key of each count -> words in the verdict.
COUNTED = {
    "frames": "frames flown",
    "repeated": "repeated, answered again and not flown",
    "late": "late, of a frame long flown",
    "missed": "never came",
    "resets": "restarted",
    "malformed": "malformed",
    "strangers": "of another peer",
    "off_rate": "of a rate that is no whole number of JSBSim frames",
    "silences": "silences of more than a second",
}
# Bins of 4 % from 1 us to 10 s.
_LEAST_S = 1e-6
_PER_DECADE = 60
_DECADES = 7


class Times:
    """Statistics of durations, s: quantiles to 4 %, mean, standard deviation, largest."""

    def __init__(self) -> None:
        self._ends = [_LEAST_S * 10.0 ** (i / _PER_DECADE) for i in range(_PER_DECADE * _DECADES)]
        self._counts = [0] * (len(self._ends) + 1)
        self.count = 0
        self.largest = 0.0
        self._sum = 0.0
        self._squares = 0.0

    def add(self, time_s: float) -> None:
        """Add a duration."""
        self._counts[bisect_left(self._ends, time_s)] += 1
        self.count += 1
        self.largest = max(self.largest, time_s)
        self._sum += time_s
        self._squares += time_s * time_s

    def quantile(self, share: float) -> float:
        """The quantile for this share, s: the end of its bin, or the largest duration if that is shorter."""
        due = share * self.count
        seen = 0
        for end, count in zip(self._ends, self._counts, strict=False):
            seen += count
            if count and seen >= due:
                return min(end, self.largest)
        return self.largest

    @property
    def mean(self) -> float:
        """The mean, s."""
        return self._sum / self.count if self.count else 0.0

    @property
    def spread(self) -> float:
        """The standard deviation, s."""
        if not self.count:
            return 0.0
        return sqrt(max(self._squares / self.count - self.mean**2, 0.0))


class Link:
    """The counts of an endpoint, also over restarts of the flight. LONG_S: a longer gap is a silence."""

    LONG_S = 1.0

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter(dict.fromkeys(COUNTED, 0))
        self.latency = Times()
        self.interval = Times()
        self._received_s: float | None = None
        self.longest_s = 0.0

    def hear(self, now_s: float) -> None:
        """Count a new frame at this time."""
        if self._received_s is not None:
            gap_s = now_s - self._received_s
            self.longest_s = max(self.longest_s, gap_s)
            if gap_s > self.LONG_S:
                self.counts["silences"] += 1
            else:
                self.interval.add(gap_s)
        self._received_s = now_s

    def silent_s(self, now_s: float) -> float:
        """Time since the last new frame, s; 0 before the first."""
        return 0.0 if self._received_s is None else now_s - self._received_s

    def document(self) -> dict[str, Any]:
        """The counts, and times in ms, for the metrics."""
        latency = self.latency
        interval = self.interval
        return {
            **self.counts,
            "latency_ms": {
                "median": _ms(latency.quantile(0.5)), "p99": _ms(latency.quantile(0.99)),
                "largest": _ms(latency.largest),
            },
            "interval_ms": {
                "mean": _ms(interval.mean), "jitter_rms": _ms(interval.spread),
                "largest": _ms(interval.largest),
            },
            "longest_silence_s": round(self.longest_s, 3),
        }  # fmt: skip


def _ms(time_s: float) -> float:
    return round(1e3 * time_s, 4)
