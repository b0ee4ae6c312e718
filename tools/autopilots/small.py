"""A small autopilot: cascaded gains hold attitude, altitude, speed and heading of an aircraft like the
Beaver.

Its inputs are the quantities that the protocols transmit. Its outputs are roll, pitch and yaw from -1 to 1
and throttle from 0 to 1; a larger output rolls right, pitches up, yaws right or adds power.
"""

from dataclasses import dataclass, replace
from math import pi, radians, sin, tan

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


TAKE_OFF, LOWEST_M = 0.6, 8.0
CRUISE_MPS, APPROACH_MPS = 45.0, 37.0
TAIL_UP_MPS = 30.0
FLARE_M = 5.0


@dataclass
class Circuit(Small):
    """Takes off, climbs, turns, lands and rolls out. Heights are above its first position.

    top_m: height to which it climbs. turn_deg: angle by which it turns. phase: its present phase.
    """

    top_m: float = 40.0
    turn_deg: float = 180.0
    phase: str = "roll"
    _stood: Told | None = None

    def outputs(self, told: Told) -> tuple[float, float, float, float]:
        """The outputs, as of `Small`."""
        if self._stood is None or told.t_s < self._t_s:
            self._stood, self.phase, self._heading = told, "roll", told.attitude[2]
            self._begin(told)
            self._power = 0.0
        dt, self._t_s = told.t_s - self._t_s, told.t_s
        height = told.altitude_m - self._stood.altitude_m
        self._turn_page(told, height)
        if self.phase in ("roll", "stop"):
            return self._on_wheels(told, dt)
        return self._in_flight(told, dt)

    def _turn_page(self, told: Told, height: float) -> None:
        """Begin the next phase where this one has arrived."""
        turned = abs(_wrapped(told.attitude[2] - self._heading))
        if self.phase == "roll" and height > LOWEST_M:
            self.phase, self._from = "climb", replace(told, airspeed_mps=CRUISE_MPS)
            self._altitude_m, self._power = told.altitude_m, TAKE_OFF
        elif self.phase == "climb" and height > self.top_m:
            self.phase = "turn"
        elif self.phase == "turn" and turned > radians(self.turn_deg - 10.0):
            self.phase, self._heading = "descend", self._heading + radians(self.turn_deg)
        elif self.phase == "descend" and height < FLARE_M:
            self.phase = "flare"
        elif self.phase == "flare" and height < 0.3:
            self.phase, self._pitch = "stop", 0.0

    def _on_wheels(self, told: Told, dt: float) -> tuple[float, float, float, float]:
        """Outputs on the ground: along the first heading, with full power or none."""
        off = _wrapped(self._heading - told.attitude[2])
        yaw = clipped(6.0 * off - 3.0 * told.rates[2], 1.0)
        roll = clipped(-1.0 * told.attitude[0] - 0.3 * told.rates[0], 0.5)
        speed, lands = told.airspeed_mps, self.phase == "stop"
        pitch = radians(9.0 if lands else 13.0)
        lift = clipped(6.0 * (pitch - told.attitude[1]) - 1.0 * told.rates[1], 0.6)
        self._power = 0.0 if lands else min(TAKE_OFF, self._power + 0.4 * dt)
        return roll, lift if speed > TAIL_UP_MPS else 0.25, self._power, yaw

    def _in_flight(self, told: Told, dt: float) -> tuple[float, float, float, float]:
        """Outputs in the air: path, bank and speed of the phase."""
        climb, bank, speed = {
            "climb": (3.0, 0.0, CRUISE_MPS),
            "turn": (0.0, radians(20.0), CRUISE_MPS),
            "descend": (-2.5, 0.0, APPROACH_MPS),
            "flare": (-0.7, 0.0, APPROACH_MPS),
        }[self.phase]
        if self.phase != "turn":
            bank = clipped(0.6 * _wrapped(self._heading - told.attitude[2]), radians(15.0))
        if self.phase == "flare":
            self._altitude_m = told.altitude_m
        self._altitude_m += climb * dt
        power = 0.0 if self.phase == "flare" else self._to_speed(told, speed, climb, dt)
        return self._to_bank(told, bank, dt), self._to_path(told, climb, dt), power, self._to_slip(told, dt)


def _wrapped(angle: float) -> float:
    """An angle, rad, between -pi and pi."""
    return (angle + pi) % (2.0 * pi) - pi
