"""Two logs to follow the first steps with: a small flying wing, healthy, and with a weak left elevon.

The wing is no real one: its rates follow the elevons with one lag, a law holds roll and pitch angles that
change every few seconds, and the attitude follows the rates by Euler's kinematics [SL03, eq. 1.4-4].
"""

from collections.abc import Callable, Iterator

import numpy as np

from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.vehicle import further_keys

Left = Callable[[float], float]
"""How much of the left elevon is there at a time, s."""

RATE_HZ, HEALTHY_S, SUSPECT_S = 20.0, 600.0, 180.0
WEAK_FROM_S, WEAK = 90.0, 0.4
_DAMPING = np.array([[-6.0, 0.0, 0.8], [0.0, -4.0, 0.0], [-0.4, 0.0, -1.5]])
_ELEVONS = np.array([[22.0, 9.0, -1.2], [22.0, -9.0, -1.2]])
"""Angular acceleration by full right and left elevon, rad/s2: the right one rolls right and pitches up."""
_AIR_RAD_S2, _GYRO_RAD_S = np.array([1.2, 0.8, 0.4]), 0.004
_HOLD_S, _ROLL_RAD, _PITCH_RAD = 4.0, 0.5, 0.15
VEHICLE = """\
# The vehicle file of two sample logs: which column is what, and in which unit.
name: sample-wing
time: {column: time_ms, unit: ms}
rates:
  p: {column: gyro_x, unit: deg/s}
  q: {column: gyro_y, unit: deg/s}
  r: {column: gyro_z, unit: deg/s}
commands: [roll_cmd, pitch_cmd]                 # upstream of what can fail, shares of travel
surfaces:                                       # what each elevon makes of them while healthy
  right: {roll_cmd: 0.5, pitch_cmd: 0.5}
  left: {roll_cmd: 0.5, pitch_cmd: -0.5}
attitude: {roll: roll_rad, pitch: pitch_rad}    # what the rates are checked against
"""

_GIVEN = ("name", "time", "rates", "commands", "surfaces", "attitude")


def files() -> dict[str, str]:
    """Names and texts of the sample files."""
    return {
        "vehicle.yaml": VEHICLE + further_keys(_GIVEN),
        "healthy.csv": _table(HEALTHY_S, seed=1, left=lambda t_s: 1.0),
        "suspect.csv": _table(SUSPECT_S, seed=2, left=lambda t_s: WEAK if t_s >= WEAK_FROM_S else 1.0),
    }


def _table(duration_s: float, seed: int, left: Left) -> str:
    head = "time_ms,gyro_x,gyro_y,gyro_z,roll_cmd,pitch_cmd,roll_rad,pitch_rad"
    rows = _flown(duration_s, np.random.default_rng(seed), left)
    return "\n".join([head, *(",".join(f"{cell:.7g}" for cell in row) for row in rows)]) + "\n"


def _flown(duration_s: float, rng: np.random.Generator, left: Left) -> Iterator[list[float]]:
    """Row by row: time, rates in deg/s, commands, attitude."""
    dt = 1.0 / RATE_HZ
    rates, air, attitude, wanted = np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2)
    for k in range(round(duration_s * RATE_HZ)):
        t_s = k * dt
        if k % round(_HOLD_S * RATE_HZ) == 0:
            wanted = rng.uniform(-1.0, 1.0, 2) * [_ROLL_RAD, _PITCH_RAD]
        command = _law(attitude, rates, wanted)
        measured = np.rad2deg(rates + _GYRO_RAD_S * rng.standard_normal(3))
        yield [1000.0 * t_s, *measured, *command, *attitude]
        elevons = np.array([command.sum(), command[0] - command[1]]) / 2.0 * [1.0, left(t_s)]
        air += dt * (-2.0 * air) + np.sqrt(dt) * _AIR_RAD_S2 * rng.standard_normal(3)
        rates = rates + dt * (_DAMPING @ rates + elevons @ _ELEVONS + air)
        attitude = attitude + dt * _euler(rates, attitude)


def _law(attitude: Floats, rates: Floats, wanted: Floats) -> Floats:
    """Roll and pitch command."""
    return np.clip(1.2 * (wanted - attitude) - 0.15 * rates[:2], -1.0, 1.0)


def _euler(rates: Floats, attitude: Floats) -> Floats:
    """Rates of the roll and the pitch angle."""
    p, q, r = rates
    phi, theta = attitude
    return np.array([
        p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)),
        q * np.cos(phi) - r * np.sin(phi),
    ])  # fmt: skip
