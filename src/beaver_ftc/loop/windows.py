"""The windows of a flight: spells in which the same faults are in force, and what was found in each.

A diagnosis latches its alarm, and a name stands until it is contradicted. Of a fault that comes and goes, or
of two after each other, the end of the flight therefore shows little. So what the diagnosis says is read at
the end of each window, in its last frame, and the first frame of it is noted in which a detector was beyond
its threshold.
"""

from typing import Any

from beaver_ftc.loop.findings import found_so_far


class Windows:
    """Those of a flight. Each method is given its `loop.Loop`, which owns the windows."""

    def __init__(self) -> None:
        self._closed: list[dict[str, Any]] = []
        self._from_frame = 0
        self._in_force: tuple[bool, ...] = ()

    def turn_to(self, loop: Any, k: int, in_force: tuple[bool, ...]) -> None:
        """End the window if other faults are in force in frame k, the next to fly; in_force: each of them."""
        if in_force != self._in_force:
            self._closed = self.until_now(loop)
            self._from_frame, self._in_force = k, in_force
            loop.frames["accounts"]["beyond_threshold_at_s"] = -1.0

    def until_now(self, loop: Any) -> list[dict[str, Any]]:
        """Each window so far, the last one as far as it was flown: `from_s`, `to_s`, the first `alarm_s` in
        it, None without one, and `found`, as a Landing has it."""
        frame, rate_hz = loop.frames[0], loop.scenario.rate_hz
        if not any(self._in_force) or frame["k"] <= self._from_frame:
            return self._closed
        alarm_s = float(frame["accounts"]["beyond_threshold_at_s"])
        window = {
            "from_s": self._from_frame / rate_hz,
            "to_s": int(frame["k"]) / rate_hz,
            "alarm_s": alarm_s if alarm_s >= 0.0 else None,
            "found": found_so_far(frame, loop.aircraft.surfaces, loop.plugin_verdict),
        }
        return [*self._closed, window]
