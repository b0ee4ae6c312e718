"""The air that moves: one-minus-cosine gusts, set off at their frames, and the axes of the turbulence.

Both are JSBSim's own models.
"""

from collections.abc import Sequence
from math import ceil

from beaver_ftc.plant.adapter import FT_PER_M, Plant
from beaver_ftc.scenario.environment import Environment, Gust

NEVER = 2**62
_LOCAL_FRAME = 3  # of atmosphere/cosine-gust/frame: north, east, down


class MovingAir:
    """Turns the turbulence with the aircraft's heading, as its spectra are meant [MIL-F-8785C, 3.7.1].

    JSBSim keeps it in axes along the wind, and without one along whatever direction it met first: a rolling
    gust would pitch an aircraft that flies across. `psiw` turns them the other way round.
    """

    def __init__(self, environment: Environment, plant: Plant) -> None:
        self.turbulent = environment.severity is not None
        self._heading = plant.node("attitude/psi-rad")
        self._axes = plant.input("atmosphere/psiw-rad")

    def turn(self) -> None:
        """Before a JSBSim frame: axes along the present heading."""
        if self.turbulent:
            self._axes.set_double_value(-self._heading.get_double_value())


class GustSchedule:
    """Sets gusts off, one after the other; without any it does nothing."""

    def __init__(self, gusts: Sequence[Gust], plant: Plant, rate_hz: float) -> None:
        self._plant = plant
        self._starts = {ceil(gust.at_s * rate_hz - 1e-9): gust for gust in gusts if any(gust.velocity_mps)}

    def apply(self, k: int) -> None:
        """Set the gust off that starts with frame k."""
        if k in self._starts:
            self._set(self._starts[k])
            self._plant.write("atmosphere/cosine-gust/start", 1.0)

    def _set(self, gust: Gust) -> None:
        height = sum(speed**2 for speed in gust.velocity_mps) ** 0.5
        values = {
            "startup-duration-sec": gust.rise_s, "steady-duration-sec": gust.hold_s,
            "end-duration-sec": gust.fade_s, "magnitude-ft_sec": height * FT_PER_M, "frame": _LOCAL_FRAME,
        }  # fmt: skip
        values |= {f"{axis}-velocity-ft_sec": v for axis, v in zip("XYZ", gust.velocity_mps, strict=True)}
        for name, value in values.items():
            self._plant.write(f"atmosphere/cosine-gust/{name}", value)

    def next_change(self, k: int) -> int:
        """The first frame after k at which `apply` has something to do."""
        return min((start for start in self._starts if start > k), default=NEVER)
