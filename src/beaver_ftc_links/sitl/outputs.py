"""From the outputs of an autopilot to deflections and power, by the equation in `aircraft/schema.py`."""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from beaver_ftc.aircraft import Aircraft, ChannelsSection, OutputSection
from beaver_ftc.documents import BadInput

Vector = np.ndarray
# Channels of roll, pitch and yaw, and of the throttle, of a plain aeroplane in both autopilots [ArduPilot,
# SERVO1 to 4 by default].
USUAL = (1, 2, 4)
USUAL_THROTTLE = 3


def channels_of(aircraft: Aircraft, G: Vector) -> ChannelsSection:
    """The channels in the file of the aircraft, or else the usual ones: that of its dominant axis for each
    primary surface, so that a larger output rolls right, pitches up or yaws right.

    G: effectiveness of each surface about each axis in trim, (3, n) rad/s2 per rad.
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
    """The share of full output of a pulse, -1 to 1, before the factor `share`; None for no pulse, 0 us."""
    if pulse_us <= 0.0:
        return None
    low, high = output.pwm_us
    side = high - trim_us if pulse_us >= trim_us else trim_us - low
    share = (pulse_us - trim_us) / side if side > 0.0 else 0.0
    share = min(max(share, -1.0), 1.0)
    return -share if output.reversed else share


class Outputs:
    """The conversion of outputs for one aircraft.

    trim_rad (n,), travel_rad (2, n): trim and stops of the surfaces. pulses: whether outputs are in us;
    otherwise they are shares, -1 to 1, those of a throttle 0 to 1.
    """

    def __init__(
        self, aircraft: Aircraft, G: Vector, trim_rad: Vector, travel_rad: Vector, pulses: bool
    ) -> None:
        self.channels = channels_of(aircraft, G)
        self._pulses = pulses
        mixes = (self.channels.surfaces.get(name, ()) for name in aircraft.surfaces)
        limits = zip(travel_rad[0], travel_rad[1], strict=True)
        self._surfaces = [
            (mix, float(trim), float(low), float(high))
            for mix, trim, (low, high) in zip(mixes, trim_rad, limits, strict=True)
        ]
        self._throttle = self.channels.throttle
        self._power = power_range(aircraft)

    def check(self, count: int) -> None:
        """Raise BadInput for packets with fewer outputs than the channels of the aircraft."""
        sections = (*self.channels.surfaces.values(), (self._throttle,) if self._throttle else ())
        highest = max((output.channel for mix in sections for output in mix), default=0)
        if highest > count:
            raise BadInput(f"channels: {highest} is asked for, allowed: 1 to {count} of these packets")

    def deflections(self, given: Sequence[float]) -> Vector:
        """Deflections (n,) rad of the surfaces; the trim for a surface without an output."""
        return np.array([self._deflection(*surface, given) for surface in self._surfaces])

    def power(self, given: Sequence[float]) -> float | None:
        """The setting of the engine, in the unit of its property; None without an output for it."""
        if self._throttle is None:
            return None
        trim = self._throttle.pwm_us[0] if self._throttle.trim_us is None else self._throttle.trim_us
        share = self._share(self._throttle, trim, given)
        if share is None:
            return None
        if self._throttle.reversed:  # a full pulse is then the share -1
            share += 1.0
        return self._power[0] + min(max(share, 0.0), 1.0) * (self._power[1] - self._power[0])

    def _deflection(
        self, mix: Sequence[OutputSection], trim: float, low: float, high: float, given: Sequence[float]
    ) -> float:
        total = 0.0
        said = False
        for output in mix:
            middle = 0.5 * sum(output.pwm_us) if output.trim_us is None else output.trim_us
            share = self._share(output, middle, given)
            if share is not None:
                total = total + output.share * share
                said = True
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
    """Lowest and highest setting of the power lever in the file of the aircraft, or 0 and 1."""
    lever = aircraft.trim.throttle
    ranges = (setting.range for setting in aircraft.engine.settings.values() if setting.property == lever)
    return next(ranges, (0.0, 1.0))
