"""A small autopilot that takes off, flies a circuit and lands."""

from dataclasses import dataclass, replace
from math import pi, radians

from tools.autopilots.small import Small, Told, clipped

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
