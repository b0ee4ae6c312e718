"""The flight envelope of the damaged aircraft: level turns at a speed, a bank and a sideslip.

All elevators move alike, the ailerons in opposite directions, all rudders alike, all throttles alike. If the
rudders are lost, the sideslip is free. Newton's method makes JSBSim's six accelerations of a steady turn
zero, and begins at a neighbour that was found before. A point belongs to the envelope if all accelerations
vanish within the travels.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import cos, degrees, radians, sin, sqrt

import numpy as np

from beaver_ftc_aircraft.gtm.parameters import cases, parameters, surfaces
from beaver_ftc_aircraft.gtm.steady import (
    ALTITUDE_FT,
    FT_S_PER_KNOT,
    HEADING_DEG,
    SEA_LEVEL_SLUG_FT3,
    Bench,
    Steady,
    pitch_angle,
)
from tools.gtm.specification import axes_of

SPEEDS_KT = tuple(range(60, 131, 10))
BANKS_DEG = (-45, -30, -15, 0, 15, 30, 45)
SIDESLIPS_DEG = (-8, -4, 0, 4, 8)
MOST_ALPHA_RAD = radians(20.0)
_SMALL, _STEPS = 1e-7, 25
_DIFFERENCES = np.array([1e-5, 1e-4, 1e-4, 1e-4, 1e-3, 1e-4])
_LARGEST = np.array([0.05, 0.15, 0.15, 0.15, 0.3, 0.2])


@dataclass(frozen=True)
class Turn:
    """A point of the envelope. x: alpha, elevator, right aileron, rudder (sideslip without one), rad,
    throttle, share of 1, and turn rate, rad/s, that hold it; held: whether all are within their ranges."""

    speed_kt: float
    bank_deg: float
    sideslip_deg: float
    x: np.ndarray
    held: bool


class Envelope:
    """The turns with one case of damage; case 0 is the undamaged aircraft."""

    def __init__(self, bench: Bench, case: int) -> None:
        taken = list(cases().values())[case - 1]["takes"] if case else ()
        self.bench = bench
        self.known: dict[float, np.ndarray] = {}  # level flight by speed
        self.near: dict[tuple[float, float, float], np.ndarray] = {}  # all that was found
        self.no_rudder = all(name in taken for name in surfaces("rudder"))
        self.thin = sqrt(bench.density / SEA_LEVEL_SLUG_FT3)
        bench.damage(case)

    def turns(
        self, speeds: Sequence[float] = SPEEDS_KT, banks: Sequence[float] = BANKS_DEG,
        sideslips: Sequence[float] = SIDESLIPS_DEG,
    ) -> Iterator[Turn]:  # fmt: skip
        """Yield every point of the grid, from the middle outwards, so that each has a neighbour to begin
        at."""
        for speed in sorted(speeds, key=lambda v: abs(v - 90.0)):
            level = min(self.known, key=lambda of: abs(of - speed), default=None)
            at = self._start(speed) if level is None else self.known[level]
            for bank in sorted(banks, key=abs):
                for sideslip in sorted((0,) if self.no_rudder else sideslips, key=abs):
                    guess = self.near.get((speed, bank, 0), self.near.get((speed, 0, 0), at))
                    turn = self._turn(speed, bank, sideslip, guess)
                    if np.isfinite(turn.x).all():
                        self.near[speed, bank, sideslip] = turn.x
                        if bank == sideslip == 0:
                            self.known[speed] = turn.x
                    yield turn

    def _start(self, speed: float) -> np.ndarray:
        return np.array([radians(min(12.0, 3.5 * (90.0 / speed) ** 2)), 0.03, 0.0, 0.0, 0.4, 0.0])

    def _turn(self, speed: float, bank: float, sideslip: float, guess: np.ndarray) -> Turn:
        """The turn by Newton steps from a guess, not a number where these do not arrive."""
        x = guess.copy()
        for _ in range(_STEPS):
            off = self._off(speed, bank, sideslip, x)
            if not np.isfinite(off).all() or np.abs(off).max() < _SMALL:
                break
            steps = np.diag(_DIFFERENCES)
            J = np.column_stack([(self._off(speed, bank, sideslip, x + s) - off) / s.sum() for s in steps])
            step = np.linalg.lstsq(J, -off, rcond=None)[0]
            x = x + step * min(1.0, float((_LARGEST / np.maximum(np.abs(step), 1e-12)).min()))
            if abs(x[0]) > 0.6 or abs(x[4]) > 5.0 or np.abs(x[1:4]).max() > 1.5:
                break
        found = float(np.abs(self._off(speed, bank, sideslip, x)).max()) < 1e-5
        return Turn(speed, bank, sideslip, x if found else np.full(6, np.nan), found and self._within(x))

    def _within(self, x: np.ndarray) -> bool:
        """Whether surfaces, throttle and angle of attack are within their ranges."""
        travel = parameters()["surfaces"]
        angles = {"left_inboard_elevator": x[1], "right_aileron": x[2], "left_aileron": -x[2]}
        angles |= {} if self.no_rudder else {"upper_rudder": x[3]}
        low_high = {name: [radians(end) for end in travel[name]["travel_deg"]] for name in angles}
        inside = all(low_high[name][0] <= rad <= low_high[name][1] for name, rad in angles.items())
        return inside and 0.0 <= x[4] <= 1.0 and abs(x[0]) <= MOST_ALPHA_RAD

    def _off(self, speed: float, bank: float, sideslip: float, x: np.ndarray) -> np.ndarray:
        """Accelerations of the bench at the unknowns x of a turn."""
        alpha, elevator, aileron, side, throttle, turning = map(float, x)
        beta, rudder = (side, 0.0) if self.no_rudder else (radians(sideslip), side)
        phi, V = radians(bank), speed * FT_S_PER_KNOT / self.thin
        theta = pitch_angle(alpha, beta, phi)
        angles = map(degrees, (alpha, beta, phi, theta, elevator, aileron, rudder))
        for name, number in Steady(V, speed, *angles, 100.0 * throttle, 0.0).commands().items():
            self.bench.fdm[name] = number
        rates = turning * np.array([-sin(theta), cos(theta) * sin(phi), cos(theta) * cos(phi)])
        self.bench.place(ALTITUDE_FT, V * axes_of(alpha, beta), (phi, theta, radians(HEADING_DEG)), rates)
        return self.bench.accelerations()
