"""From the turbulence that a scenario declares, and its instruments, to what the air does unseen (air.py)."""

from math import hypot, pi, sqrt

import numpy as np

from beaver_ftc.aircraft import Aircraft, MassProperties
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.design.terms import AIRSPEED, fill_table
from beaver_ftc.design.variants import jacobian
from beaver_ftc.diagnosis.admitted import GUST_FT_S, SCALE_FT
from beaver_ftc.scenario.sensors import Sensors

# Share of the intensity of the rolling, pitching and yawing gust that the vanes leave; on exact vanes and
# over a filter's memory it is less (`tests/diagnosis/test_air.py`).
UNSEEN = (1.0, 0.003, 0.03)
BY_FORCE = 0.01  # share of the intensity that errors of a tenth leave of the gusts that forces show
TWO_STEPS = 1.6  # times its noise does an acceleration scatter by Adams and Bashforth: sqrt(1.5^2 + 0.5^2)


def set_up_air(air: np.void, turbulence: str, mass: MassProperties, aircraft: Aircraft) -> None:
    span_m = aircraft.geometry.span_m
    air["moving"] = turbulence != "none"
    fill_table(air["forces"], aircraft, aircraft.measurable_forces, FORCES)
    air["area_per_mass"] = aircraft.geometry.wing_area_m2 / mass.mass_kg
    air["gravity"] = 9.80665  # m/s2, standard; what is constant has no part in a change of the gust
    air["span"] = span_m
    air["per_metre"], air["unseen"] = drift(turbulence, span_m), UNSEEN
    air["scale"] = 0.3048 * SCALE_FT
    air["rolling"] = sqrt(air["scale"] * span_m) / 2.6  # [Yeager1998, eq. 10]


def drift(turbulence: str, span_m: float) -> np.ndarray:
    """Intensity of the random walk that each rotating gust is over times short beside its own, over V.

    (3,) rad2/s3 per m/s, for roll, pitch and yaw. The rolling gust is a first-order process with
    sigma = 1.9 sigma_w / sqrt(L b) and a lag of sqrt(L b) / 2.6 V [Yeager1998, eq. 8]: 2 sigma^2 / lag. The
    others are lagged slopes of a velocity of intensity 3 sigma_w^2 V / L [MIL-F-8785C, 3.7], over (V lag)^2.
    """
    sigma_w, L, b = 0.3048 * GUST_FT_S[turbulence], 0.3048 * SCALE_FT, span_m
    rolling = 2.0 * 1.9**2 * 2.6 * sigma_w**2 / (L * b) ** 1.5
    velocity = 3.0 * sigma_w**2 / L
    return np.array([rolling, velocity * (pi / (4 * b)) ** 2, velocity * (pi / (3 * b)) ** 2])


def set_up_jitter(
    statistical: np.void,
    sensors: Sensors,
    design: np.void,
    y: np.ndarray,
    u: np.ndarray,
    span_m: float,
    dt_s: float,
) -> None:
    """What noise adds to the gust that is followed: that of the vanes, and of the force that moves the air's
    velocity on from frame to frame; where the flow follows from the forces, that of the forces too."""
    flow = flow_noise(sensors, y[AIRSPEED])
    if statistical["forces"]["known"]:
        forces = statistical["forces"]["component"][::-1]  # normal to the body, and across
        felt = np.array([sensors.az.random_error, sensors.ay.random_error])
        flow += TWO_STEPS * felt * dt_s / y[AIRSPEED]
        by_force = np.sqrt(forces["felt"]) / np.abs(forces["vane"][:, 1])
        statistical["forces"]["blurred"] = jitter(by_force, design, y, u, span_m)
    for name in ("own_jitter", "jitter"):
        statistical["noise"][name] += jitter(flow, design, y, u, span_m) ** 2


def flow_noise(sensors: Sensors, airspeed_mps: float) -> np.ndarray:
    """Of the flow's angles (2,) against the level axes, as vanes, airspeed and attitude have them, standard
    deviation in rad: what pitch attitude and heading are off turns the flow as much as what a vane is off."""
    through = 0.3  # attitudes and incidences of up to 17 deg
    vanes = (
        hypot(sensors.alpha.random_error, sensors.theta.random_error),
        hypot(sensors.beta.random_error, sensors.psi.random_error),
    )
    return np.array(vanes) + through * (sensors.V.random_error / airspeed_mps + sensors.phi.random_error)


def jitter(flow: np.ndarray, design: np.void, y: np.ndarray, u: np.ndarray, span_m: float) -> np.ndarray:
    """Standard deviation, rad/s2 on each axis, of what noise of the flow's angles (2,) rad adds to a gust."""
    V, b = y[AIRSPEED], span_m
    pitching, yawing = flow * pi * V / (np.array([4.0, 3.0]) * b)
    damping = jacobian(design, np.zeros(3), y, u)[2]  # without rates all of it is aerodynamic
    return np.sqrt((damping[:, 1] * pitching) ** 2 + (damping[:, 2] * yawing) ** 2)
