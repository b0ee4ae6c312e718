"""The reference model: what a pilot would call the wanted response, and its derivative for the feedback
linearisation.

    xm'' = wn^2 (ref - xm) - 2 zeta wn xm'

Second order, so that xm' needs no differentiation; discretised exactly for a reference held over the frame.
"""

import numpy as np

from beaver_ftc.compiled import kernel


def discretise(wn: float, zeta: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """State transition A (2, 2) and input B (2,) of (xm, xm') over dt (s) under a held reference; wn in
    rad/s.

    Cayley-Hamilton for a 2 x 2 matrix: exp(F dt) = e^{-s dt} (c I + d (F + s I)) with s = zeta wn, and c, d
    the (hyperbolic) cosine and sine of m dt, m^2 = s^2 - wn^2. The input follows from the equilibrium (ref,
    0).
    """
    s = zeta * wn
    m = np.sqrt(complex(s * s - wn * wn))
    c = np.cosh(m * dt).real
    d = (np.sinh(m * dt) / m).real if abs(m) * dt > 1e-8 else dt
    A = np.exp(-s * dt) * np.array([[c + s * d, d], [-wn * wn * d, c - s * d]])
    return A, np.array([1.0 - A[0, 0], -A[1, 0]])


@kernel
def advance(control, rate, acceleration, reference):
    """Rate (rad/s) and acceleration (rad/s2) of the model a frame on, `reference` (rad/s) held."""
    A, B = control.model_A, control.model_B
    return (
        A[0, 0] * rate + A[0, 1] * acceleration + B[0] * reference,
        A[1, 0] * rate + A[1, 1] * acceleration + B[1] * reference,
    )


@kernel
def follow(control, reference):
    """Advance the reference model by one frame towards `reference` (3,) rad/s."""
    control.commanded_rate[:] = reference
    for i in range(3):
        rate, acceleration = control.model_rate[i], control.model_acceleration[i]
        rate, acceleration = advance(control, rate, acceleration, reference[i])
        control.model_rate[i], control.model_acceleration[i] = rate, acceleration
