"""What a turning Earth does to the angular acceleration.

Moments turn the body against inertial space; its rates are reported against the Earth. With w the
reported rates, W the Earth's rotation in body axes and w_i = w + W,

    wdot = J^-1 (M - w_i x J w_i) + w_i x W            [SL03, sec. 1.5]

The design model has J^-1 (M - w x J w): the difference is all that the Earth adds, and J enters by itself.
"""

from collections.abc import Callable
from math import radians

import numpy as np

from beaver_ftc.plant.state import START_LATITUDE_DEG

EARTH_RATE_RAD_S = 7.292115e-5  # [WGS84]
MEAN_RADIUS_M = 6371000.0  # what the log's north is measured with

Inertial = Callable[[np.ndarray], np.ndarray]


def earth_in_body(attitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
    """The Earth's rotation in body axes (n, 3) rad/s; attitude (n, 3) phi, theta, psi, latitude (n,), rad."""
    phi, theta, psi = attitude.T
    north, down = EARTH_RATE_RAD_S * np.cos(latitude), -EARTH_RATE_RAD_S * np.sin(latitude)
    ahead, right = north * np.cos(psi), -north * np.sin(psi)  # turned into the heading
    forward = ahead * np.cos(theta) - down * np.sin(theta)
    below = ahead * np.sin(theta) + down * np.cos(theta)
    return np.column_stack([
        forward, right * np.cos(phi) + below * np.sin(phi), below * np.cos(phi) - right * np.sin(phi)
    ])  # fmt: skip


def latitude_rad(north_m: np.ndarray, start_altitude_m: float) -> np.ndarray:
    """Geodetic latitude (n,) of the flight's path, which starts at 45 deg."""
    return radians(START_LATITUDE_DEG) + north_m / (MEAN_RADIUS_M + start_altitude_m)


def earth_rotation(
    inertial: Inertial, x: np.ndarray, attitude: np.ndarray, latitude: np.ndarray
) -> np.ndarray:
    """What the Earth's rotation adds to the angular acceleration, (n, 3) rad/s2.

    inertial: the angular acceleration with no moment, -J^-1 (w x J w), as a function of w (n, 3).
    """
    W = earth_in_body(attitude, latitude)
    inertial_rate = x + W
    return inertial(inertial_rate) - inertial(x) + np.cross(inertial_rate, W)
