"""The informed test, which is given the fault and its onset: no test detects the fault more often.

All that is declared is taken as Gaussian. A Kalman filter turns the measurements that plug-ins are given into
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

The unexplained acceleration of the published bound is a sinusoid of unknown frequency; here it is a
first-order process of the same power with a memory of UNEXPLAINED_ACCELERATION_CORRELATION_S.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import prod
from statistics import NormalDist
from typing import Any

import numpy as np

from beaver_ftc.aircraft import Aircraft, Term
from beaver_ftc.design.context import Context
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.diagnosis.gusts import MIN_UNMEASURED_GUST_INTENSITY_SHARES

UNEXPLAINED_ACCELERATION_CORRELATION_S = 0.1
MIN_GYRO_NOISE_STD_RAD_S = 1e-5  # what perfect instruments are taken for
_KALMAN_SETTLING_FRAMES = 400


FlightColumns = Mapping[str, np.ndarray]  # columns of a log, (frames,) each


class WhiteningFilter:
    """The Kalman filter of rates, air and the unexplained, once it has settled."""

    def __init__(self, context: Context) -> None:
        declared, dt = context.declared, context.dt_s
        time_constants_s = np.concatenate(
            (declared.gust_time_s, np.full(3, UNEXPLAINED_ACCELERATION_CORRELATION_S))
        )
        stationary_std = np.concatenate((declared.gust_rad_s, context.constant_rad_s2 / np.sqrt(2.0)))
        decay_factors = np.exp(-dt / time_constants_s)
        self.F = np.eye(9)
        self.F[:3, 3:6], self.F[:3, 6:] = dt * declared.gust_effect, dt * np.eye(3)
        self.F[range(3, 9), range(3, 9)] = decay_factors
        self.dt = dt
        self.R = np.diag(declared.rate_variance(MIN_GYRO_NOISE_STD_RAD_S))
        rate_variance_from_model_error = (dt * declared.model_rad_s2) ** 2
        Q = np.diag(
            np.concatenate((rate_variance_from_model_error, (1.0 - decay_factors**2) * stationary_std**2))
        )
        P = np.diag(np.concatenate((np.diagonal(self.R), stationary_std**2)))
        for _ in range(_KALMAN_SETTLING_FRAMES):
            P = self._covariance_after_measurement(P)
            P = self.F @ P @ self.F.T + Q
        self.S = P[:3, :3] + self.R
        self.K = np.linalg.solve(self.S, P[:3]).T

    def _covariance_after_measurement(self, P: np.ndarray) -> np.ndarray:
        K = np.linalg.solve(P[:3, :3] + self.R, P[:3]).T
        return P - K @ P[:3]

    def whitened_response(self, added_acceleration: np.ndarray) -> np.ndarray:
        """Compute the effect of added_acceleration (n, 3, ...) rad/s2 on the innovations, scaled to variance
        one."""
        prediction_error_transition = self.F @ (np.eye(9) - self.K @ np.eye(3, 9))
        whitener = np.linalg.cholesky(np.linalg.inv(self.S)).T
        prediction_error_response = np.zeros((9, *added_acceleration.shape[2:]))
        whitened_innovation_change = np.empty_like(added_acceleration)
        for k, acceleration in enumerate(added_acceleration):
            prediction_error_response = prediction_error_transition @ prediction_error_response
            prediction_error_response[:3] += self.dt * acceleration
            whitened_innovation_change[k] = whitener @ prediction_error_response[:3]
        return whitened_innovation_change

    def deflection_coefficient_by_frame(self, fault_acceleration: np.ndarray) -> np.ndarray:
        """d after each frame, (n,), of fault_acceleration (n, 3) rad/s2: a fault from its first frame on."""
        return np.sqrt(np.cumsum(np.square(self.whitened_response(fault_acceleration)).sum(axis=1)))

    def deflection_coefficient_with_unknowns(
        self, fault_acceleration: np.ndarray, regressors: np.ndarray, unknown_constant_std: np.ndarray
    ) -> float:
        """d of fault_acceleration (n, 3) rad/s2 with unknown constants in all frames.

        The constants, of standard deviation unknown_constant_std (m,) > 0, multiply regressors (n, 3, m).
        """
        whitened_fault = self.whitened_response(fault_acceleration).ravel()
        whitened_regressors = (
            self.whitened_response(regressors).reshape(whitened_fault.size, unknown_constant_std.size)
            * unknown_constant_std
        )
        regressor_fault_correlation = whitened_regressors.T @ whitened_fault
        squared_deflection_coefficient = (
            whitened_fault @ whitened_fault
            - regressor_fault_correlation
            @ np.linalg.solve(
                whitened_regressors.T @ whitened_regressors + np.eye(unknown_constant_std.size),
                regressor_fault_correlation,
            )
        )
        return float(np.sqrt(max(squared_deflection_coefficient, 0.0)))


def context_with_measured_gust(context: Context, gust_estimate_noise_rad_s2: np.ndarray) -> Context:
    """Return the context of a test that knows the gusts the vanes measure, with noise (3,) rad/s2."""
    declared = context.declared
    if not declared.air:
        return context
    declared_with_measured_gust = replace(
        declared,
        gust_rad_s=declared.gust_rad_s * np.sqrt(MIN_UNMEASURED_GUST_INTENSITY_SHARES),
        model_rad_s2=np.hypot(declared.model_rad_s2, gust_estimate_noise_rad_s2),
    )
    return replace(context, declared=declared_with_measured_gust)


def detection_probability(
    deflection_coefficient: float, test_interval_s: float, false_alarms_per_h: float
) -> float:
    """Probability of detection by that test, made once every test_interval_s, at so many false alarms per
    hour."""
    standard_normal = NormalDist()
    if false_alarms_per_h <= 0.0:
        return 0.0  # noise that has no bound leaves nothing certain
    return standard_normal.cdf(
        deflection_coefficient
        - standard_normal.inv_cdf(1.0 - min(false_alarms_per_h * test_interval_s / 3600.0, 0.5))
    )


def healthy_surface_positions(context: Context, log_columns: FlightColumns, surface_name: str) -> np.ndarray:
    """Return the positions of a healthy surface under the commands of a flight, (frames,) rad."""
    s, commands_rad = context.surfaces.index(surface_name), log_columns[f"{surface_name}_cmd_rad"]
    bandwidth_rad_s = context.declared.bandwidth_rad_s[s]
    rate_limit_rad_s = context.declared.rate_limit_rad_s[s]
    step_share_of_difference = 1.0 - np.exp(-bandwidth_rad_s * context.dt_s) if bandwidth_rad_s else 1.0
    max_step_rad = rate_limit_rad_s * context.dt_s if rate_limit_rad_s else np.inf
    travel_min_rad, travel_max_rad = context.travel_rad[:, s]
    position_rad, positions_rad = log_columns[f"{surface_name}_effective_rad"][0], np.empty_like(commands_rad)
    for k, limited_command_rad in enumerate(np.clip(commands_rad, travel_min_rad, travel_max_rad)):
        position_rad += min(
            max((limited_command_rad - position_rad) * step_share_of_difference, -max_step_rad), max_step_rad
        )
        positions_rad[k] = position_rad
    return positions_rad


def unit_term_acceleration(
    aircraft: Aircraft, term: Term, log_columns: FlightColumns, deflection_rad: np.ndarray | None
) -> np.ndarray:
    """Compute the acceleration by a coefficient of one, (frames, 3) rad/s2; deflection_rad: of its
    surface."""
    V, geometry = log_columns["airspeed_mps"], aircraft.geometry
    inertia_coefficient = inertia_coefficients(aircraft.mass)
    value_by_factor_name: dict[str | None, Any] = {
        **{name: log_columns[name] for name in aircraft.signals},
        "alpha": log_columns["alpha_rad"], "beta": log_columns["beta_rad"],
        "ph": log_columns["p_rad_s"] * geometry.span_m / (2.0 * V),
        "qh": log_columns["q_rad_s"] * geometry.chord_m / V,
        "rh": log_columns["r_rad_s"] * geometry.span_m / (2.0 * V), term.surface: deflection_rad,
    }  # fmt: skip
    force_per_unit_coefficient = (
        log_columns["qdyn_pa"]
        * geometry.wing_area_m2
        * prod(value_by_factor_name[factor] for factor in term.factors)
    )
    acceleration_per_force = {
        "Cl": (inertia_coefficient.Pl * geometry.span_m, 0.0, inertia_coefficient.Rl * geometry.span_m),
        "Cm": (0.0, inertia_coefficient.Qm * geometry.chord_m, 0.0),
        "Cn": (inertia_coefficient.Pn * geometry.span_m, 0.0, inertia_coefficient.Rn * geometry.span_m),
    }[term.coefficient]
    return np.multiply.outer(force_per_unit_coefficient, acceleration_per_force)
