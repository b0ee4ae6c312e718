"""What came in over the wire, and how quickly it was answered: counts and two histograms, of fixed size."""

from bisect import bisect_left
from collections import Counter
from math import sqrt
from typing import Any

# What is counted, and what the verdict calls it.
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
_LEAST_S, _PER_DECADE, _DECADES = 1e-6, 60, 7  # bins of 4 % from 1 us to 10 s


class Times:
    """How long something took, s, many times over: quantiles to 4 %, the mean, the spread, the largest."""

    def __init__(self) -> None:
        self._ends = [_LEAST_S * 10.0 ** (i / _PER_DECADE) for i in range(_PER_DECADE * _DECADES)]
        self._counts = [0] * (len(self._ends) + 1)
        self.count, self.largest, self._sum, self._squares = 0, 0.0, 0.0, 0.0

    def add(self, time_s: float) -> None:
        """Once more."""
        self._counts[bisect_left(self._ends, time_s)] += 1
        self.count += 1
        self.largest = max(self.largest, time_s)
        self._sum += time_s
        self._squares += time_s * time_s

    def quantile(self, share: float) -> float:
        """The time that this share of all took at most, s: the end of its bin, or the largest."""
        due, seen = share * self.count, 0
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
    """The counts of one endpoint; they go on when the flight restarts."""

    LONG_S = 1.0  # a silence

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter(dict.fromkeys(COUNTED, 0))
        self.latency, self.interval = Times(), Times()
        self._received_s: float | None = None
        self.longest_s = 0.0

    def hear(self, now_s: float) -> None:
        """A new frame came in."""
        if self._received_s is not None:
            gap_s = now_s - self._received_s
            self.longest_s = max(self.longest_s, gap_s)
            if gap_s > self.LONG_S:
                self.counts["silences"] += 1
            else:
                self.interval.add(gap_s)
        self._received_s = now_s

    def silent_s(self, now_s: float) -> float:
        """For how long nothing new has come."""
        return 0.0 if self._received_s is None else now_s - self._received_s

    def document(self) -> dict[str, Any]:
        """All of it, for the metrics: counts, and times in ms."""
        latency, interval = self.latency, self.interval
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
