"""The informed test, which is given the fault and its onset: no test detects the fault more often.

All declared errors are taken as Gaussian. A Kalman filter turns the measurements that plug-ins are given into
independent innovations of covariance S. A fault phi, rad/s2, adds a known signature s to them. The likelihood
ratio of "this fault since its onset" against "no fault" has the deflection

    d^2 = sum s' S^-1 s,        s = H delta,  delta[k+1] = F (1 - K H) delta[k] + dt phi[k]

At a false-alarm probability alpha it detects the fault with probability Phi(d - Phi^-1(1 - alpha)), and no
test of these measurements detects it more often [Kay1998, sec. 4.4]. If the test is made once every T seconds
with r false alarms per hour, alpha = r T / 3600.

Errors that are constant but unknown, c normal of standard deviation sigma, times known regressors, pass
through the same filter as R c. The part of the fault that they can explain is no evidence [Kay1998, sec.
10.5]:

    d^2 = s' s - s' R (R' R + diag(1 / sigma^2))^-1 R' s,

with s and R scaled by S^-1/2 and the frames stacked.

If sensors are in doubt, a gyro may have any error. The evidence that no gyro explains the flight is the least
deflection of three tests, which each do without one gyro and use the attitude instead; this file makes one
of them at a time.

The unexplained acceleration of the published bound is a sinusoid of unknown frequency. Here it is a
first-order process of the same power, with the time constant UNEXPLAINED_MEMORY_S.
"""

from dataclasses import replace
from statistics import NormalDist

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.gusts import MIN_UNMEASURED_SHARES

UNEXPLAINED_MEMORY_S = 0.1
MIN_GYRO_STD_RAD_S, MIN_ATTITUDE_STD_RAD = 1e-5, 1e-5  # added to the noise of each, so that none is perfect
# Frames until the covariance S of the innovations has settled. At 50, 100 and 200 Hz, with tactical-grade
# sensors in light turbulence, S changes after frame 400 by less than 1e-8 of itself, without a gyro, too.
_SETTLING_FRAMES = 400


# Places in the state: rates, rad/s; attitude, rad; rotation of the air, rad/s; unexplained acceleration,
# rad/s2.
RATES, ATTITUDE, AIR, UNEXPLAINED = np.arange(12).reshape(4, 3)


class WhiteningFilter:
    """The settled Kalman filter of rates x, attitude, rotation w of the air, and unexplained acceleration v:

        x <- x + dt (L w + v + model noise)      attitude <- attitude + dt x
        w <- a w + noise                         v <- a v + noise,      a = exp(-dt / tau)

    F (12, 12): matrix of these equations; L (3, 3) 1/s: effect of the rotation; tau s. H (m, 12): the filter
    measures the rates; if gyro `broken` may have any error, it measures the two other rates and the attitude,
    which moves with the rates as in level flight. K (12, m), S (m, m): gain, and covariance of the
    innovations, as settled.
    """

    def __init__(self, context: Context, broken: int | None = None) -> None:
        declared = context.declared
        dt = context.dt_s
        tau = np.concatenate((declared.gust_time_s, np.full(3, UNEXPLAINED_MEMORY_S)))
        sigma = np.concatenate((declared.gust_rad_s, context.constant_rad_s2 / np.sqrt(2.0)))
        a = np.exp(-dt / tau)
        self.F = np.diag(np.concatenate((np.ones(6), a)))
        self.dt = dt
        self.F[ATTITUDE, RATES] = self.F[RATES, UNEXPLAINED] = dt  # axis by axis
        self.F[np.ix_(RATES, AIR)] = dt * declared.gust_effect
        measured = [i for i in range(3 if broken is None else 6) if i != broken]
        attitude = np.hypot(declared.further_noise, declared.further_resolution / np.sqrt(12.0))[:3]
        variance = np.concatenate(
            (declared.rate_variance(MIN_GYRO_STD_RAD_S), attitude**2 + MIN_ATTITUDE_STD_RAD**2)
        )
        self.H = np.eye(12)[measured]
        R = np.diag(variance[measured])
        Q = np.diag(np.concatenate(((dt * declared.model_rad_s2) ** 2, np.zeros(3), (1.0 - a**2) * sigma**2)))
        P = np.diag(np.concatenate((variance, sigma**2)))
        for _ in range(_SETTLING_FRAMES):
            self.S = self.H @ P @ self.H.T + R
            self.K = np.linalg.solve(self.S, self.H @ P).T
            P = self.F @ (P - self.K @ self.H @ P) @ self.F.T + Q
            P = 0.5 * (P + P.T)  # symmetric, or rounding errors would grow if a gyro is left out

    def whitened_response(self, phi: np.ndarray) -> np.ndarray:
        """The effect g (n, m, ...) of phi (n, 3, ...) rad/s2 on the innovations, scaled to variance one.

        g = W H delta,  W' W = S^-1      delta <- A delta + dt phi,  A = F (1 - K H)

        WH: the product of W and H.
        """
        A = self.F @ (np.eye(12) - self.K @ self.H)
        WH = np.linalg.cholesky(np.linalg.inv(self.S)).T @ self.H
        delta = np.zeros((12, *phi.shape[2:]))
        g = np.empty((len(phi), len(WH), *phi.shape[2:]))
        for k, phi_k in enumerate(phi):
            delta = np.tensordot(A, delta, 1)
            delta[RATES] += self.dt * phi_k
            g[k] = np.tensordot(WH, delta, 1)
        return g

    def deflection_by_frame(self, phi: np.ndarray) -> np.ndarray:
        """d after each frame, (n,), of phi (n, 3) rad/s2: a fault from its first frame on."""
        return np.sqrt(np.cumsum(np.square(self.whitened_response(phi)).sum(axis=1)))

    def deflection_with_unknowns(self, phi: np.ndarray, Z: np.ndarray, sigma: np.ndarray) -> float:
        """d of phi (n, 3) rad/s2 with unknown constants in all frames.

            d^2 = g' g - N' (R' R + 1)^-1 N,  N = R' g

        The constants, of standard deviation sigma (m,) > 0, multiply Z (n, 3, m); R: response to Z sigma.
        """
        g = self.whitened_response(phi).ravel()
        R = self.whitened_response(Z).reshape(g.size, sigma.size) * sigma
        N = R.T @ g
        d2 = g @ g - N @ np.linalg.solve(R.T @ R + np.eye(sigma.size), N)
        return float(np.sqrt(max(d2, 0.0)))


def with_measured_gust(context: Context, gust_noise: np.ndarray) -> Context:
    """The context of an informed test that is given the gusts which the vanes measure, with an error of
    gust_noise (3,) rad/s2 in their effect; in still air the context itself."""
    declared = context.declared
    if not declared.air:
        return context
    return replace(
        context,
        declared=replace(
            declared,
            gust_rad_s=declared.gust_rad_s * np.sqrt(MIN_UNMEASURED_SHARES),
            model_rad_s2=np.hypot(declared.model_rad_s2, gust_noise),
        ),
    )


def detection_probability(d: float, interval_s: float, alarms_per_h: float) -> float:
    """Probability that the informed test detects a fault of deflection d:

        Phi(d - Phi^-1(1 - alpha)),      alpha = alarms_per_h interval_s / 3600, at most a half

    The test is made once every interval_s and raises alarms_per_h false alarms per hour.
    """
    normal = NormalDist()
    if alarms_per_h <= 0.0:
        return 0.0  # noise has no bound, so a test without false alarms detects no fault
    return normal.cdf(d - normal.inv_cdf(1.0 - min(alarms_per_h * interval_s / 3600.0, 0.5)))
