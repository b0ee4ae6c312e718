"""Two logs for the first steps: a small flying wing, healthy, and with a weak left elevon.

The wing is invented: its rates follow the elevons with one lag, a law holds roll and pitch angles that
change every few seconds, and the attitude follows the rates by Euler's kinematics [SL03, eq. 1.4-4].
"""

from collections.abc import Iterator
from math import inf

import numpy as np

from beaver_ftc.documents import parse_yaml
from beaver_ftc_logs.vehicle import unused_keys_as_comments

SAMPLE_RATE_HZ = 20.0
HEALTHY_FLIGHT_S = 600.0
FAULTY_FLIGHT_S = 180.0
WEAK_ELEVON_FROM_S = 90.0
WEAK_ELEVON_EFFECTIVENESS = 0.4
_RATE_STATE_MATRIX_PER_S = np.array([[-6.0, 0.0, 0.8], [0.0, -4.0, 0.0], [-0.4, 0.0, -1.5]])
# Angular acceleration by full right and left elevon, rad/s2: the right one rolls right and pitches up.
_ACCELERATION_BY_FULL_ELEVON_RAD_S2 = np.array([[22.0, 9.0, -1.2], [22.0, -9.0, -1.2]])
_TURBULENCE_DRIVING_NOISE = np.array([1.2, 0.8, 0.4])  # rad/s2 per root of a second
_TURBULENCE_DECAY_PER_S = 2.0
_GYRO_NOISE_RAD_S = 0.004
_ATTITUDE_GAIN_PER_RAD = 1.2  # gain of the law, share of travel for 1 rad
_RATE_GAIN_S_PER_RAD = 0.15
_DEMANDED_ATTITUDE_HOLD_S = 4.0  # the law holds each demanded attitude for this time
_ROLL_AMPLITUDE_RAD = 0.5
_PITCH_AMPLITUDE_RAD = 0.15
VEHICLE_FILE_TEXT = """\
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


def files() -> dict[str, str]:
    """Names and texts of the sample files."""
    return {
        "vehicle.yaml": VEHICLE_FILE_TEXT + unused_keys_as_comments(parse_yaml(VEHICLE_FILE_TEXT).data),
        "healthy.csv": _table_text(HEALTHY_FLIGHT_S, seed=1),
        "suspect.csv": _table_text(FAULTY_FLIGHT_S, seed=2, weak_from_s=WEAK_ELEVON_FROM_S),
    }


def _table_text(duration_s: float, seed: int, weak_from_s: float = inf) -> str:
    """A log as a CSV table with a header. weak_from_s: time from which the left elevon is weak, s."""
    header = "time_ms,gyro_x,gyro_y,gyro_z,roll_cmd,pitch_cmd,roll_rad,pitch_rad"
    rows = _simulate_rows(duration_s, np.random.default_rng(seed), weak_from_s)
    return "\n".join([header, *(",".join(f"{cell:.7g}" for cell in row) for row in rows)]) + "\n"


def _simulate_rows(duration_s: float, rng: np.random.Generator, weak_from_s: float) -> Iterator[list[float]]:
    """Row by row: time, rates in deg/s, commands, attitude. The left elevon is weak from weak_from_s on.

        w' = A w + B e + d,     d' = -D d + noise
        phi' = p + tan(theta) (q sin(phi) + r cos(phi)),     theta' = q cos(phi) - r sin(phi)

    w (3,) rad/s: rates p, q, r; e (2,): right and left elevon times their effectiveness, shares of travel; d
    (3,) rad/s2: turbulence; phi, theta rad: roll and pitch angle.
    """
    dt_s = 1.0 / SAMPLE_RATE_HZ
    rates = np.zeros(3)
    turbulence_rad_s2 = np.zeros(3)
    attitude_rad = np.zeros(2)  # roll and pitch
    for k in range(round(duration_s * SAMPLE_RATE_HZ)):
        t_s = k * dt_s
        if k % round(_DEMANDED_ATTITUDE_HOLD_S * SAMPLE_RATE_HZ) == 0:
            demanded_rad = rng.uniform(-1.0, 1.0, 2) * [_ROLL_AMPLITUDE_RAD, _PITCH_AMPLITUDE_RAD]
        by_attitude = _ATTITUDE_GAIN_PER_RAD * (demanded_rad - attitude_rad)
        commands = np.clip(by_attitude - _RATE_GAIN_S_PER_RAD * rates[:2], -1.0, 1.0)
        measured_rates_deg_s = np.rad2deg(rates + _GYRO_NOISE_RAD_S * rng.standard_normal(3))
        yield [1000.0 * t_s, *measured_rates_deg_s, *commands, *attitude_rad]
        right_and_left = np.array([commands.sum(), commands[0] - commands[1]]) / 2.0
        left_effectiveness = WEAK_ELEVON_EFFECTIVENESS if t_s >= weak_from_s else 1.0
        effective = right_and_left * [1.0, left_effectiveness]
        gust_rad_s2 = np.sqrt(dt_s) * _TURBULENCE_DRIVING_NOISE * rng.standard_normal(3)
        turbulence_rad_s2 += dt_s * (-_TURBULENCE_DECAY_PER_S * turbulence_rad_s2) + gust_rad_s2
        by_elevons_rad_s2 = effective @ _ACCELERATION_BY_FULL_ELEVON_RAD_S2
        rates = rates + dt_s * (_RATE_STATE_MATRIX_PER_S @ rates + by_elevons_rad_s2 + turbulence_rad_s2)
        p, q, r = rates
        phi, theta = attitude_rad
        roll_rate = p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi))
        attitude_rad = attitude_rad + dt_s * np.array([roll_rate, q * np.cos(phi) - r * np.sin(phi)])
