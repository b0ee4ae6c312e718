"""From an autopilot's outputs to deflections and power: see `aircraft/schema.py` for the equation."""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from beaver_ftc.aircraft import Aircraft, ChannelsSection, OutputSection
from beaver_ftc.documents import BadInput

Vector = np.ndarray
# Where both autopilots have them for a plain aeroplane: roll, pitch, yaw [ArduPilot SERVO1, 2 and 4 by
# default].
USUAL, USUAL_THROTTLE = (1, 2, 4), 3


def channels_of(aircraft: Aircraft, G: Vector) -> ChannelsSection:
    """What the aircraft's file says, or else the usual channels: the surface that leads each axis, so that
    more output rolls right, pitches up, yaws right.

    G: (3, n) rad/s2 per rad, what each surface does about each axis in trim.
    """
    if aircraft.file.channels is not None:
        return aircraft.file.channels
    surfaces: dict[str, tuple[OutputSection, ...]] = {}
    for name in aircraft.primary:
        s = aircraft.surfaces.index(name)
        axis = aircraft.dominant_axis[s]
        surfaces[name] = (OutputSection(channel=USUAL[axis], reversed=bool(G[axis, s] < 0.0)),)
    return ChannelsSection(surfaces=surfaces, throttle=OutputSection(channel=USUAL_THROTTLE))


def share_of_pulse(output: OutputSection, pulse_us: float, trim_us: float) -> float | None:
    """How much of full output a pulse is, -1 to 1, before `share`; None of no pulse: 0 us."""
    if pulse_us <= 0.0:
        return None
    low, high = output.pwm_us
    side = high - trim_us if pulse_us >= trim_us else trim_us - low
    share = (pulse_us - trim_us) / side if side > 0.0 else 0.0
    share = min(max(share, -1.0), 1.0)
    return -share if output.reversed else share


class Outputs:
    """The map of one aircraft.

    trim_rad: (n,), travel_rad: (2, n). power: the lowest and highest setting of the engine. pulses: outputs
    are in us; otherwise they are shares, -1 to 1, of a throttle 0 to 1.
    """

    def __init__(
        self, aircraft: Aircraft, G: Vector, trim_rad: Vector, travel_rad: Vector, pulses: bool
    ) -> None:
        self.channels, self._pulses = channels_of(aircraft, G), pulses
        mixes = (self.channels.surfaces.get(name, ()) for name in aircraft.surfaces)
        limits = zip(travel_rad[0], travel_rad[1], strict=True)
        self._surfaces = [
            (mix, float(trim), float(low), float(high))
            for mix, trim, (low, high) in zip(mixes, trim_rad, limits, strict=True)
        ]
        self._throttle = self.channels.throttle
        self._power = power_range(aircraft)

    def check(self, count: int) -> None:
        """Refuse packets with fewer outputs than the aircraft's file names."""
        sections = (*self.channels.surfaces.values(), (self._throttle,) if self._throttle else ())
        highest = max((output.channel for mix in sections for output in mix), default=0)
        if highest > count:
            raise BadInput(f"channels: {highest} is asked for, allowed: 1 to {count} of these packets")

    def deflections(self, given: Sequence[float]) -> Vector:
        """Deflections (n,) rad of the surfaces; where no output says anything, the trim."""
        return np.array([self._deflection(*surface, given) for surface in self._surfaces])

    def power(self, given: Sequence[float]) -> float | None:
        """The engine's setting, in the unit of its property; None where nothing is said of it."""
        if self._throttle is None:
            return None
        trim = self._throttle.pwm_us[0] if self._throttle.trim_us is None else self._throttle.trim_us
        share = self._share(self._throttle, trim, given)
        if share is None:
            return None
        if self._throttle.reversed:  # its share is -1 of a full pulse
            share += 1.0
        return self._power[0] + min(max(share, 0.0), 1.0) * (self._power[1] - self._power[0])

    def _deflection(
        self, mix: Sequence[OutputSection], trim: float, low: float, high: float, given: Sequence[float]
    ) -> float:
        total, said = 0.0, False
        for output in mix:
            middle = 0.5 * sum(output.pwm_us) if output.trim_us is None else output.trim_us
            share = self._share(output, middle, given)
            if share is not None:
                total, said = total + output.share * share, True
        if not said:
            return trim
        total = min(max(total, -1.0), 1.0)
        return min(max(total * high if total >= 0.0 else -total * low, low), high)

    def _share(self, output: OutputSection, trim_us: float, given: Sequence[float]) -> float | None:
        if output.channel > len(given):
            return None
        value = float(given[output.channel - 1])
        if self._pulses:
            return share_of_pulse(output, value, trim_us)
        value = min(max(value, -1.0), 1.0) if isfinite(value) else 0.0
        return -value if output.reversed else value


def power_range(aircraft: Aircraft) -> tuple[float, float]:
    """Lowest and highest setting of the aircraft's power lever, as its file has them, or 0 and 1."""
    lever = aircraft.trim.throttle
    ranges = (setting.range for setting in aircraft.engine.settings.values() if setting.property == lever)
    return next(ranges, (0.0, 1.0))
