"""A small autopilot: cascaded gains hold attitude, altitude, speed and heading of an aircraft like the
Beaver.

Its inputs are the quantities that the protocols transmit. Its outputs are roll, pitch and yaw from -1 to 1
and throttle from 0 to 1; a larger output rolls right, pitches up, yaws right or adds power.
"""

from dataclasses import dataclass
from math import radians, sin, tan

G_MPS2 = 9.80665
LEG_S = 25.0
# A circuit that is flown over and over: climb m/s, bank deg, speed above the first one m/s.
CIRCUIT = (
    (1.0, 0.0, 0.0),
    (0.0, 12.0, 0.0),
    (-1.0, 0.0, 1.0),
    (0.0, -12.0, 0.0),
    (0.5, 8.0, -1.0),
    (-0.5, -8.0, 0.0),
)
STEEPEST_MPS = 3.0


@dataclass(frozen=True)
class Told:
    """The inputs of an autopilot, in SI units and radians. side_mps2: specific force to the right."""

    t_s: float
    rates: tuple[float, float, float]
    attitude: tuple[float, float, float]
    altitude_m: float
    climb_mps: float
    airspeed_mps: float
    side_mps2: float


def clipped(value: float, most: float) -> float:
    """A value, limited to -most and most."""
    return min(max(value, -most), most)


@dataclass
class Small:
    """Flies a circuit from its first position."""

    _from: Told | None = None
    _t_s: float = 0.0

    def _begin(self, told: Told) -> None:
        self._from, self._t_s = told, told.t_s
        self._altitude_m = told.altitude_m
        self._power, self._roll, self._pitch, self._yaw = 0.4, 0.0, 0.0, 0.0  # integrals
        self._level = 0.0  # pitch attitude of level flight, beyond the first one

    def outputs(self, told: Told) -> tuple[float, float, float, float]:
        """Roll, pitch, throttle and yaw, in the order of the usual channels 1 to 4."""
        if self._from is None or told.t_s < self._t_s:
            self._begin(told)
        assert self._from is not None
        dt, self._t_s = told.t_s - self._t_s, told.t_s
        climb, bank_deg, faster = CIRCUIT[int((told.t_s - self._from.t_s) / LEG_S) % len(CIRCUIT)]
        self._altitude_m += climb * dt
        power = self._to_speed(told, self._from.airspeed_mps + faster, climb, dt)
        return (
            self._to_bank(told, radians(bank_deg), dt),
            self._to_path(told, climb, dt),
            power,
            self._to_slip(told, dt),
        )

    def _to_bank(self, told: Told, bank: float, dt: float) -> float:
        off = bank - told.attitude[0]
        self._roll = clipped(self._roll + 0.3 * off * dt, 0.4)
        return clipped(self._roll + 0.8 * off - 0.2 * told.rates[0], 0.6)

    def _to_path(self, told: Told, climb: float, dt: float) -> float:
        """The pitch output. The altitude error sets the climb, the climb error sets the attitude, and the
        attitude error sets the elevator."""
        assert self._from is not None
        wanted = climb + clipped(0.1 * (self._altitude_m - told.altitude_m), STEEPEST_MPS)
        off = (wanted - told.climb_mps) / told.airspeed_mps
        self._level = clipped(self._level + clipped(0.1 * off, 0.01) * dt, 0.06)
        off = (
            self._from.attitude[1]
            + self._level
            + clipped(0.4 * wanted / told.airspeed_mps, 0.1)
            - told.attitude[1]
        )
        self._pitch = clipped(self._pitch + 0.4 * off * dt, 0.5)
        turning = G_MPS2 / told.airspeed_mps * tan(told.attitude[0]) * sin(told.attitude[0])
        return clipped(self._pitch + 1.0 * off - 0.5 * (told.rates[1] - turning), 0.6)

    def _to_slip(self, told: Told, dt: float) -> float:
        """The yaw output: it reduces the side force, and yaws as in a coordinated turn."""
        turning = G_MPS2 / told.airspeed_mps * sin(told.attitude[0])
        self._yaw = clipped(self._yaw - 0.06 * told.side_mps2 * dt, 0.4)
        return clipped(self._yaw - 0.15 * told.side_mps2 + 0.8 * (turning - told.rates[2]), 0.9)

    def _to_speed(self, told: Told, speed: float, climb: float, dt: float) -> float:
        off = speed - told.airspeed_mps
        self._power = min(max(self._power + 0.01 * off * dt, 0.0), 1.0)
        return min(max(self._power + 0.05 * off + 0.08 * climb, 0.0), 1.0)
