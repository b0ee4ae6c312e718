"""What can be seen at all: the test that is told the fault and the instant it strikes.

With all that is declared taken as Gaussian, a Kalman filter makes of the measurements, as they are shown to
plug-ins, independent innovations of covariance S. A fault phi, rad/s2, adds to them a known signature s, and
the likelihood ratio of "this fault, since then" against "none" has the deflection

    d^2 = sum s' S^-1 s,        s = H delta,  delta[k+1] = F (1 - K H) delta[k] + dt phi[k]

so that at a false-alarm probability of alpha it finds the fault with probability Phi(d - Phi^-1(1 - alpha))
[Kay1998, sec. 4.4], and nothing finds it more often from these measurements. Made once every T seconds, at r
false alarms per hour, alpha = r T / 3600.

The unexplained acceleration of the published bound is a sinusoid of unknown frequency; here it is a
first-order process of the same power and UNEXPLAINED_S of memory.
"""

from statistics import NormalDist

import numpy as np

from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.rivals.air import rate_variance
from beaver_ftc.studies.compare.replay import Recording

UNEXPLAINED_S = 0.1
LEAST_RATE_RAD_S = 1e-5  # what perfect instruments are taken for
_SETTLING_FRAMES = 400


class Whitening:
    """The Kalman filter of rates, air and the unexplained, once it has settled."""

    def __init__(self, context: Context) -> None:
        declared, dt = context.declared, context.dt_s
        time_s = np.concatenate((declared.gust_time_s, np.full(3, UNEXPLAINED_S)))
        size = np.concatenate((declared.gust_rad_s, context.constant_rad_s2 / np.sqrt(2.0)))
        keep = np.exp(-dt / time_s)
        self.F = np.eye(9)
        self.F[:3, 3:6], self.F[:3, 6:] = dt * declared.gust_effect, dt * np.eye(3)
        self.F[range(3, 9), range(3, 9)] = keep
        self.dt = dt
        self.R = np.diag(rate_variance(declared, LEAST_RATE_RAD_S))
        steady = (dt * declared.model_rad_s2) ** 2
        Q = np.diag(np.concatenate((steady, (1.0 - keep**2) * size**2)))
        P = np.diag(np.concatenate((np.diagonal(self.R), size**2)))
        for _ in range(_SETTLING_FRAMES):
            P = self._updated(P)
            P = self.F @ P @ self.F.T + Q
        self.S = P[:3, :3] + self.R
        self.K = np.linalg.solve(self.S, P[:3]).T

    def _updated(self, P: np.ndarray) -> np.ndarray:
        K = np.linalg.solve(P[:3, :3] + self.R, P[:3]).T
        return P - K @ P[:3]

    def deflection(self, phi: np.ndarray) -> np.ndarray:
        """d after each frame, (n,), of a fault phi (n, 3) rad/s2 that begins with the first of them."""
        step = self.F @ (np.eye(9) - self.K @ np.eye(3, 9))
        delta, signature = np.zeros(9), np.empty_like(phi)
        for k, effect in enumerate(phi):
            delta = step @ delta
            delta[:3] += self.dt * effect
            signature[k] = delta[:3]
        squares = np.einsum("ki,ij,kj->k", signature, np.linalg.inv(self.S), signature)
        return np.sqrt(np.cumsum(squares))


def deflections(
    recording: Recording, surface: str, magnitude: float, within_s: tuple[float, ...]
) -> list[float]:
    """d of a loss of effectiveness in a recorded flight, as long after it struck."""
    since = [measured for measured, _ in recording.seen if measured.t_s > recording.fault_at_s + 1e-9]
    if not since:
        return [0.0] * len(within_s)
    moment = np.array([measured.contribution[:, SURFACES.index(surface)] for measured in since])
    d = Whitening(recording.context).deflection(-magnitude * moment)
    frames = [round(s / recording.context.dt_s) for s in within_s]
    return [float(d[min(n, len(d)) - 1]) for n in frames]


def chance(d: float, within_s: float, per_h: float) -> float:
    """Probability of detection by that test, made once every within_s, at so many false alarms per hour."""
    normal = NormalDist()
    if per_h <= 0.0:
        return 0.0  # noise that has no bound leaves nothing certain
    return normal.cdf(d - normal.inv_cdf(1.0 - min(per_h * within_s / 3600.0, 0.5)))
