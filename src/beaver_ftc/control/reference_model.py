"""The reference model: what a pilot would call the wanted response, and its derivative for the feedback linearisation.

    xm'' = wn^2 (ref - xm) - 2 zeta wn xm'

Second order, so that xm' needs no differentiation; discretised exactly for a reference held over the frame.
"""

import numpy as np
from numba import njit


def discretise(wn: float, zeta: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """State transition A (2, 2) and input B (2,) of (xm, xm') over dt (s) under a held reference; wn in rad/s."""
    from scipy.linalg import expm

    continuous = np.array([[0.0, 1.0, 0.0], [-(wn**2), -2 * zeta * wn, wn**2], [0.0, 0.0, 0.0]])
    step = expm(continuous * dt)
    return step[:2, :2], step[:2, 2]


@njit(cache=True)
def follow(control, reference):
    """Advance the reference model by one frame towards `reference` (3,) rad/s."""
    A, B = control.model_A, control.model_B
    for i in range(3):
        rate, acceleration = control.model_rate[i], control.model_acceleration[i]
        control.model_rate[i] = A[0, 0] * rate + A[0, 1] * acceleration + B[0] * reference[i]
        control.model_acceleration[i] = A[1, 0] * rate + A[1, 1] * acceleration + B[1] * reference[i]
