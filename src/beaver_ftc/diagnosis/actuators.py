"""The declared actuators and their errors as arrays."""

from math import pi

import numpy as np

from beaver_ftc.scenario.declared import Declared

DEFAULT_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default


def servo_data(declared: Declared) -> dict[str, np.ndarray]:
    """The declared actuators and their errors, (surfaces,) each, by the names of `DeclaredErrors`: rad,
    rad/s, 1/s; the errors of bandwidth and rate limit are relative. 0 stands for no lag and for no limit."""
    names = declared.aircraft.surfaces
    servos = [getattr(declared.servos, s) for s in names]
    errors = [getattr(declared.servo_errors, s) for s in names]
    return {
        "bandwidth_rad_s": np.array([servo.bandwidth_rad_s for servo in servos]),
        "rate_limit_rad_s": np.radians([servo.rate_limit_deg_s for servo in servos]),
        "bandwidth_error": np.array([error.bandwidth for error in errors]),
        "rate_limit_error": np.array([error.rate_limit for error in errors]),
        "dead_band_rad": np.radians([error.dead_band_deg for error in errors]),
    }
