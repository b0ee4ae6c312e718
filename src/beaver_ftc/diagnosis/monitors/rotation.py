"""Rotations of the sensor monitor: quaternions as pairs of complex numbers.

q, p   quaternion z1 + z2 j = (z1, z2), of length 1 if it is a turn; an attitude turns body axes to level axes
v, w   vector: its components x, y, z are (x i, y + z i), so that it is the quaternion x i + y j + z k
y      readings (N_SENSORS,), of which the angles phi, theta, psi count here, rad
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.numbering import PSI, THETA
from beaver_ftc.plant.instruments import PHI


@kernel
def unit(angle):
    """exp(i angle)."""
    return complex(np.cos(angle), np.sin(angle))


@kernel
def times(p, q):
    """p q of two quaternions: (p1 q1 - p2 q2*, p1 q2 + p2 q1*)."""
    return p[0] * q[0] - p[1] * q[1].conjugate(), p[0] * q[1] + p[1] * q[0].conjugate()


@kernel
def inverse(q):
    """q*: the turn back of a q of length 1."""
    return q[0].conjugate(), -q[1]


@kernel
def turned(q, v):
    """q* v q: a constant vector v in axes that have turned by q."""
    return times(times(inverse(q), v), q)


@kernel
def combined(a, v, b, w):
    """a v + b w; v, w: quaternions or vectors; a, b: numbers."""
    return a * v[0] + b * w[0], a * v[1] + b * w[1]


@kernel
def length(q):
    """|q| of a quaternion or vector."""
    return np.hypot(abs(q[0]), abs(q[1]))


@kernel
def vector(x):
    """The vector of the components x, of which the first three count."""
    return complex(0.0, x[0]), complex(x[1], x[2])


@kernel
def components(q):
    """The components (3,) of a vector, or of the vector part of a quaternion."""
    return q[0].imag, q[1].real, q[1].imag


@kernel
def attitude(y):
    """q of the Euler angles, cos + axis sin of half an angle each: psi about the third axis (k = i j), theta
    about the second (j), phi about the first (i)."""
    heading = unit(0.5 * y[PSI])
    pitch = unit(0.5 * y[THETA])
    by_psi = complex(heading.real), 1j * heading.imag
    by_theta = complex(pitch.real), complex(pitch.imag)
    return times(times(by_psi, by_theta), (unit(0.5 * y[PHI]), 0j))


@kernel
def down(y):
    """The vertical unit vector, downwards, in body axes."""
    return complex(0.0, -np.sin(y[THETA])), np.cos(y[THETA]) * complex(np.sin(y[PHI]), np.cos(y[PHI]))
