"""From a scenario to the gains of its inner law, before the flight."""

from math import exp, hypot, pi, radians, sqrt

import numpy as np

from beaver_ftc.control.laws import gains
from beaver_ftc.control.laws.state import N_POINTS, REJECTING
from beaver_ftc.design.model import AIRSPEED, QDYN
from beaver_ftc.design.variants import effectiveness, own_damping
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import RateGyro

DEFAULT_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default
AXES = ("p", "q", "r")


def set_up(control: np.void, belief: np.void, scenario: Scenario, y: np.ndarray) -> None:
    """Derive what the inner law needs; y: the measured signals in trim."""
    if control["inner"] == REJECTING:
        _set_up_rejection(control, belief, scenario, y)


def _set_up_rejection(control: np.void, belief: np.void, scenario: Scenario, y: np.ndarray) -> None:
    config, dt = scenario.control, 1.0 / scenario.rate_hz
    speeds_mps = np.linspace(*scenario.airframe.envelope.airspeed_mps, N_POINTS)
    signals = np.tile(y, (N_POINTS, 1))
    signals[:, AIRSPEED], signals[:, QDYN] = speeds_mps, y[QDYN] * (speeds_mps / y[AIRSPEED]) ** 2
    carriers = [(axis, int(s)) for axis, s in enumerate(control["main"])]
    if control["stand_in"] >= 0:
        carriers.append((PITCH, int(control["stand_in"])))
    gains.set_up(
        control["rejection"],
        dt_s=dt,
        substeps=scenario.substeps,
        approach=belief["actuators"]["approach"],
        speed_rad_s=config.noise_share * _shares(belief["design"], y, carriers) * _rate_limits(scenario),
        gyros=[_gyro(getattr(scenario.sensors, axis), dt) for axis in AXES],
        margin=(config.gain_margin_db, config.phase_margin_deg),
        qdyn=signals[:, QDYN],
        G=np.stack([effectiveness(belief["design"], each) for each in signals]),
        carriers=carriers,
    )


def _shares(design: np.void, y: np.ndarray, carriers: list[tuple[int, int]]) -> np.ndarray:
    """What part of the noise that is allowed each surface (n,) may have: gains.py says why a root."""
    a = np.abs(own_damping(design, y))
    shares = np.ones(design["G0"].shape[1])
    for axis, s in carriers:
        shares[s] = sqrt(a[axis] / a.max())
    return shares


def _rate_limits(scenario: Scenario) -> np.ndarray:
    """Declared rate limits (n,) rad/s, the aircraft's default where none is."""
    surfaces = scenario.airframe.surfaces
    limits_deg_s = [getattr(scenario.actuators, surface).rate_limit_deg_s for surface in surfaces]
    return np.array([radians(limit) or DEFAULT_RATE_RAD_S for limit in limits_deg_s])


def _gyro(sensor: RateGyro, dt: float) -> gains.Gyro:
    noise, _, quantum = sensor.noise_bias_quantum
    lag = sensor.bandwidth_rad_s
    return gains.Gyro(hypot(noise, quantum / sqrt(12.0)), sensor.delay_s, exp(-lag * dt) if lag else 0.0)
