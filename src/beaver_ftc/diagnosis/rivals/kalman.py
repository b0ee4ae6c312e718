"""Kalman filter steps, one or many filters at a time: leading axes are filters.

    predict    z- = F z + (dt xdot, 0),  P- = F P F' + Q
    update     S = H P H' + R,  K = P H' S^-1,  z+ = z- + K nu,  P+ = P- - K S K'

[Simon2006, ch. 5], sigma points [Julier2004]. H selects the first states, because the body rates are
measured.

    z = (p, q, r, theta, g)   (n,)   p, q, r: rad/s; theta: parameters, a random walk; g: rotation of the air,
                                     rad/s, if declared
    P                         (n, n) covariance of z
    nu, S                     rad/s  innovation (3,) and its covariance (3, 3), (rad/s)2
    xdot                      rad/s2 (3,) acceleration of the design model

Turbulence is the rotation of the air as three more states, a first-order process for each axis, as declared
(design/context.py):

    g[k+1] = a g[k] + sqrt(1 - a^2) sigma w[k],   a = exp(-dt / tau);      F adds dt B g to the rates

B (3, 3), 1/s: `gust_effect`.
"""

import numpy as np

from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.rivals.rival import RivalDetector


class KalmanRival(RivalDetector):
    """Base of the rivals by Kalman filters: each has `predict` and `update_statistic`.

    F (n, n): transition without the dynamics of the aircraft. q (n,): diagonal of Q, without that of the
    rates. R (3, 3): covariance of the measurement, (rad/s)2. z, P: state and covariance of the filter, or of
    each one. before: the measurements of the frame before; None in the first frame.
    """

    before: Measured | None

    def fill_model(self, n_theta: int = 0, theta_variance: float = 0.0, walk: float = 0.0) -> None:
        """Fill the model, and start healthy. theta_variance: at the start; walk: variance of a frame."""
        declared = self.context.declared
        n_air = 3 if self.context.declared.air else 0
        a = np.exp(-self.dt / declared.gust_time_s[:n_air])
        gust_variance = declared.gust_rad_s[:n_air] ** 2
        rate_variance = declared.rate_variance(self.options["measurement_rad_s"])
        self.n_air = n_air
        self.n = 3 + n_theta + n_air
        self.F = np.eye(self.n)
        air = slice(3 + n_theta, None)
        self.F[:3, air] = self.dt * declared.gust_effect[:, :n_air]
        self.F[air, air] = np.diag(a)
        self.q = np.concatenate((np.zeros(3), np.full(n_theta, walk), (1.0 - a**2) * gust_variance))
        self.R = np.diag(rate_variance)
        self.before = None
        self.own_bound = np.hypot(self.context.constant_rad_s2, declared.model_rad_s2)
        self.P = np.diag(np.concatenate((rate_variance, np.full(n_theta, theta_variance), gust_variance)))
        self.z = np.zeros(self.n)

    def advance(self, measured: Measured, command: np.ndarray) -> float:
        """Predict over the elapsed frame, update with the measured rates, and judge the innovation."""
        statistic = 0.0
        if self.before is None:
            self.z[..., :3] = measured.x
        else:
            self.predict(measured, self.before)
            nu = measured.x - self.z[..., :3]
            self.z, self.P, S = update_state_and_covariance(self.z, self.P, nu, self.R)
            statistic = self.update_statistic(nu, S)
        self.before = measured
        return statistic

    def predict(self, measured: Measured, before: Measured) -> None:
        """Predict z and P over the elapsed frame, which began at the measurements of `before`."""
        raise NotImplementedError

    def update_statistic(self, nu: np.ndarray, S: np.ndarray) -> float:
        """The decision statistic, 1 at the alarm, by the innovation nu and its covariance S."""
        raise NotImplementedError

    def move(self, z: np.ndarray, F: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """F z + (dt acceleration, 0), of each state z (..., n); acceleration (..., 3) rad/s2."""
        z = z @ F.T
        z[..., :3] += self.dt * acceleration
        return z

    def add_noise(self, P: np.ndarray, measured: Measured, noise: float | np.ndarray) -> np.ndarray:
        """Add Q to P (..., n, n) in place, and return P.

        Q = diag(q), and for the rates (dt noise size)^2; noise (...): one for each filter. size (3,) rad/s2:
        eta_bar while only the published bound is declared. With further declared errors, eta_bar is the sum
        of all worst cases. Instruments and air have a variance or states of their own here, so that size is
        the constant bound with the declared model error, the root of the sum of their squares.
        """
        size = self.own_bound if self.context.declared.errors else measured.eta_bar
        diagonal = np.einsum("...ii->...i", P)  # a view
        diagonal += self.q
        diagonal[..., :3] += (self.dt * np.multiply.outer(noise, size)) ** 2
        return P


def update_state_and_covariance(
    z: np.ndarray, P: np.ndarray, nu: np.ndarray, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Condition (z, P) on the innovation nu (..., m) of the first m states; returns z, P, S (..., m, m):

        S = H P H' + R,    K = P H' S^-1,    z <- z + K nu,    P <- P - K H P        H: the first m rows of I

    z (..., n), P (..., n, n), R (..., m, m).
    """
    m = nu.shape[-1]
    S = P[..., :m, :m] + R
    K = np.linalg.solve(S, P[..., :m, :]).swapaxes(-1, -2)
    P = P - K @ P[..., :m, :]
    return z + (K @ nu[..., None])[..., 0], 0.5 * (P + P.swapaxes(-1, -2)), S


def normalised_innovation_square(nu: np.ndarray, S: np.ndarray) -> np.ndarray:
    """nu' S^-1 nu: chi-square with as many degrees of freedom as nu has entries, if the filter is right."""
    return np.einsum("...i,...i->...", nu, np.linalg.solve(S, nu[..., None])[..., 0])


def log_likelihood(nu: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Logarithm of the Gaussian density of the innovation nu (..., m):

    -(nu' S^-1 nu + log det S + m log(2 pi)) / 2
    """
    constant = nu.shape[-1] * np.log(2.0 * np.pi)
    return -0.5 * (normalised_innovation_square(nu, S) + np.linalg.slogdet(S)[1] + constant)


def sigma_points(z: np.ndarray, P: np.ndarray, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """2 n + 1 points (2 n + 1, n) and their weights (2 n + 1,) with the mean z and the covariance P:

        z, z + L_j, z - L_j,    weights 1 - n / spread, then 1 / (2 spread)        L L' = spread P

    L_j: column j of L. spread is n + kappa [Julier2004, eq. 12]; 3 matches the fourth moment of a Gaussian
    in one dimension.
    """
    offsets = _matrix_root(spread * P).T
    weights = np.full(2 * z.size + 1, 0.5 / spread)
    weights[0] = 1.0 - z.size / spread
    return np.concatenate((z[None], z + offsets, z - offsets)), weights


def _matrix_root(P: np.ndarray) -> np.ndarray:
    """L with L L' = P. Where rounding has cost P its definiteness, as after a reading far beyond what the
    filter expects, what is below zero counts as nothing."""
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(P)
        root: np.ndarray = vectors * np.sqrt(np.maximum(values, 0.0))
        return root
