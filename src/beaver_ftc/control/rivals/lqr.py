"""Fixed-gain linear quadratic regulator about the trim, with integral action [Anderson1990, ch. 3].

    minimise sum e' Qe e + i' Qi i + du' R du,    e = xm - x,  i = int e,  du = u - u_trim - u_feedforward

    e    (3,) rad/s      error of the body rates
    i    (3,) rad        its integral
    du   (3,) rad        surfaces that lead roll, pitch and yaw

Weights by Bryson's rule: one over the square of an acceptable value (the options). The gains never change,
which makes this law a reference for the others. The kernels are in control/laws/compiled_rivals.py.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.compiled import fill
from beaver_ftc.control.rivals.kernel_law import KernelLaw
from beaver_ftc.design.context import Context

_STEP = 1e-6  # rad/s, of a central difference; f is quadratic in x, so it is exact to rounding


def gains(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """K (m, n) of u = -K z for z[k+1] = A z + B u that minimises sum z' Q z + u' R u:

    K = (R + B' P B)^-1 B' P A,    P: solution of the discrete algebraic Riccati equation
    """
    from scipy.linalg import solve_discrete_are

    P = solve_discrete_are(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


class FixedGainLqr(KernelLaw):
    """Fixed-gain linear quadratic regulator about the trim, with integral action [Anderson1990]."""

    name: ClassVar[str] = "lqr"
    defaults: ClassVar[Mapping[str, float]] = {"error_deg_s": 0.5, "integral_deg": 0.5, "deflection_deg": 3.0}

    def compile_into(self, law: np.void) -> None:
        """Fill gains and linear model, by linearisation about the trim. The state z = (x - xm, int x - xm):

        z[k+1] = ((I + dt A) z_1 + dt B du, z_2 + dt z_1)
        """
        option = self.option
        dt = self.context.dt_s
        A, B = linearised(self.context)
        z_A = np.block([[np.eye(3) + dt * A, np.zeros((3, 3))], [dt * np.eye(3), np.eye(3)]])
        z_B = np.vstack((dt * B, np.zeros((3, 3))))
        acceptable = [option["error_deg_s"]] * 3 + [option["integral_deg"]] * 3
        Q = np.diag(1.0 / np.radians(acceptable) ** 2)
        R = np.eye(3) / np.radians(option["deflection_deg"]) ** 2
        K = gains(z_A, z_B, Q, R)
        fill(law["config"], K=K, A=A, B_inverse=np.linalg.inv(B), trim_x=self.context.trim_x)


def linearised(context: Context) -> tuple[np.ndarray, np.ndarray]:
    """A (3, 3) 1/s and B (3, 3) rad/s2 per rad of the design model about the trim, with the air data
    constant; the columns of B are the surfaces that lead the axes."""
    model = context.model
    x = context.trim_x
    y = context.trim_y
    steps = np.eye(3) * _STEP
    A = np.column_stack([(model.f(x + s, y) - model.f(x - s, y)) / (2.0 * _STEP) for s in steps])
    return A, model.G(y)[:, context.leading]
