"""How well a fit knows the effect of each group of surfaces on the rates.

G, L            number of groups; of past samples of the commands
Z               regressors of the fit (n, m), each row times the weight of its flight; those of the groups
                are the last G L columns
B               response of the rates to the commands of the groups (G, L, 3), rad/s
W               whitening matrix (3, 3): W W' is the inverse of the covariance of the noise
"""

import numpy as np

from beaver_ftc_logs.fit_parts import Parts
from beaver_ftc_logs.least_squares import Regression, left_by
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.noise_models import GAIN_SD_CAP
from beaver_ftc_logs.orders import stack_data
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats

RANK_TOLERANCE = 1e-9  # an eigenvalue that is smaller, over the largest, is rounding
# Limits of the power of a group's effect, in variances of the noise in a sample. Below the first, the group
# did not move. Above the second, the second counts: at the limit of the share, 0.98 (`trust`), the
# unexplained part is then 12.5 / 50 = 0.25, the square of half a standard deviation.
_MIN_EFFECT_POWER = 1e-6
_EFFECT_POWER_CAP = 12.5


def tied_shares(parts: Parts, model: Model) -> Floats:
    """Share of the effect of each group on the rates that the other columns of the fit explain, (G,):

        f = U_g B_g W less its mean,   u = f - Z_o b,   share = max(1 - mean |u|^2 / min(mean |f|^2, cap), 0)

    U_g (n, L): columns of the group in the regressors; f, u (n, 3): its effect in standard deviations of the
    noise, and the part that Z_o, the other columns of Z, do not explain; b: least squares of f on Z_o. cap:
    _EFFECT_POWER_CAP.

    If the share is near 1, the law ties the group to the quantities that it controls, and its effect is not
    identifiable. The share is 1 if mean |f|^2 is at most _MIN_EFFECT_POWER: the group never moved. If the
    effect is far above the noise, the power of the unexplained part decides alone, because of the cap.
    """
    Z, _, _ = stack_data(parts, model.vehicle, model.history, model.lags)
    B = np.array(model.response)
    W = np.linalg.inv(np.linalg.cholesky(np.array(model.noise))).T
    shares = np.ones(len(B))
    for g, columns in enumerate(np.arange(Z.shape[1])[-B.shape[1] * len(B) :].reshape(len(B), -1)):
        f = Z[:, columns] @ B[g] @ W
        f = f - f.mean(axis=0)
        power = float((f**2).sum()) / len(f)
        if power > _MIN_EFFECT_POWER:
            u = left_by(np.delete(Z, columns, axis=1), f)
            shares[g] = max(1.0 - float((u**2).sum()) / len(f) / min(power, _EFFECT_POWER_CAP), 0.0)
    return shares


def group_gain_sd(fit: Regression, model: Model) -> Floats:
    """Standard error of the gain of each group, (G,), from Newey-West standard errors; at most GAIN_SD_CAP.

        s (L, 3)    standard errors of the group's coefficients, in standard deviations of the noise
        C (L, L)    correlation of their errors
        b (3,)      sum of the coefficients over the lags, in standard deviations of the noise
        v (3,)      variance of b: s' C s by axis
        z (L, 3)    coefficients in their standard errors

    The gain is that of the response summed over the lags, with the variance (b^2).v / |b|^4. With
    `other_laws`, it is the factor of the whole response, with the variance 1 / (sum over the axes of z' C^+
    z), C^+ the pseudo-inverse: if the past explains the slow effect of a surface, as alpha does for an
    elevator, the sum over the lags is not known, but the factor is.
    """
    G = len(model.groups)
    L = model.lags
    first = len(fit.coefficients) - G * L
    sd = np.sqrt(np.maximum(np.diag(fit.residual_covariance), MIN_DIVISOR))
    gain_sd = np.zeros(G)
    for g in range(G):
        rows = slice(first + g * L, first + (g + 1) * L)
        C = fit.coefficient_error_correlation[rows, rows]
        s = fit.standard_errors[rows] / sd
        if model.vehicle.other_laws:
            z = fit.coefficients[rows] / sd / np.maximum(s, MIN_DIVISOR)
            information = np.einsum("la,lm,ma->", z, np.linalg.pinv(C, rcond=RANK_TOLERANCE), z)
            gain_sd[g] = 1.0 / np.sqrt(MIN_DIVISOR + information)
        else:
            b = fit.coefficients[rows].sum(axis=0) / sd
            v = np.einsum("la,lm,ma->a", s, C, s)
            gain_sd[g] = np.sqrt(b**2 @ np.maximum(v, 0.0)) / max(float(b @ b), MIN_DIVISOR)
    return np.minimum(gain_sd, GAIN_SD_CAP)
