"""The clock of a live flight: how many frames are due, and how regular it is."""

from collections import deque
from math import sqrt

TICK_S = 1 / 60  # a page draws as often
BEHIND_S = 0.25  # real time: what cannot be caught up with is let go


class Pace:
    """Real time to flight time. Times of `now_s` are the machine's monotonic clock, s."""

    def __init__(self, rate_hz: float, now_s: float) -> None:
        self.rate_hz, self.times = rate_hz, 1.0
        self._late = deque([0.0], maxlen=60)
        self._flown = deque([(now_s, 0)], maxlen=60)
        self._total = 0
        self.hold(now_s)

    def hold(self, now_s: float) -> None:
        """Begin anew from here: after a pause, or a change of speed."""
        self._from_s, self._frames = now_s, 0
        self.next_s = now_s + TICK_S

    def frames_due(self, now_s: float) -> int:
        """Frames to fly at this tick. What a machine too slow for its speed cannot fly in time is let go."""
        self._late.append(now_s - self.next_s)
        self.next_s += TICK_S
        if now_s - self.next_s > BEHIND_S:
            self.hold(now_s)
            return 0
        due = int((now_s - self._from_s) * self.times * self.rate_hz) - self._frames
        due = min(due, int(BEHIND_S * self.times * self.rate_hz) + 1)
        self._frames += due
        self._total += due
        self._flown.append((now_s, self._total))
        return due

    @property
    def jitter_ms(self) -> float:
        """Root mean square lateness of the last second's ticks, ms."""
        return 1e3 * sqrt(sum(late * late for late in self._late) / len(self._late))

    @property
    def achieved(self) -> float:
        """Times real time of the last second."""
        (from_s, before), (to_s, after) = self._flown[0], self._flown[-1]
        return (after - before) / self.rate_hz / (to_s - from_s) if to_s > from_s else 0.0
