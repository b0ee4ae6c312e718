"""The errors of the gains of the groups in parts left out.

e, F            residual (n, 3) and responses (n, 3, G, 3), in standard deviations of the noise, without
                means, from `standardized`. The last axis of F is the axis of the response
g, S            errors of the groups' gains (G,), and covariance of the gains in the filter's prior (G, G)
G               number of groups of surfaces
known           whether the effect of each group is known (G,)
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc_logs import regression, trust
from beaver_ftc_logs.effect_errors import RANK_TOLERANCE, group_gain_sd
from beaver_ftc_logs.fit_parts import Parts
from beaver_ftc_logs.flight_states import build_states
from beaver_ftc_logs.folds import Fold, held_out_folds
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.noise_models import GAIN_SD_CAP, centred
from beaver_ftc_logs.orders import fit_of
from beaver_ftc_logs.recording import Floats


def gain_overdispersion(parts: Parts, model: Model) -> float:
    """Ratio of the squared errors of the gains of parts left out to those that the filter expects.

    In a part, least squares of the residual e = F g + noise gives the errors g of the gains (`gain_errors`).
    If the noise were white and all flights alike, the square of g in the covariance (F' F)^-1 + S would on
    average equal the number of gains. Differences between flights and the colour of the noise make it larger.
    The information of a sample about an effectiveness is smaller by this ratio [McCullagh1989, section 4.5].
    One further part with the ratio 1 and a gain for each group is counted.
    """
    errors = [(float(len(model.groups)), len(model.groups))]
    for fold in held_out_folds(parts, model):
        errors += gain_errors(fold)
    total, n = np.sum(errors, axis=0)
    return float(total / n)


def gain_errors(fold: Fold, window_s: float | None = None, loudness: float = 1.0) -> list[tuple[float, int]]:
    """The square of the errors g of the gains in a part left out, and the number of gains that it shows (the
    rank of F' F):

        g = (F' F)^-1 F' e,    square = g' ((F' F)^-1 + S)^-1 g = (F' e)' (1 + S F' F)^-1 g

    Without window_s: one pair, with a gain for each group; the effects of its axes are added. With window_s:
    a pair for each window of about this length, with a gain for each axis of each group. The gains of the
    three axes of a group then have the same prior error. loudness: ratio of variances by which the filter
    widens its noise itself (`noise_inflation`).
    """
    known = trust.known_effects(fold.model)
    flight = fold.innovations()
    F, e = standardized(fold.model, flight)
    if not len(e):  # a part without a residual shows no gain
        return []
    P = build_states(fold.model, flight.noise).initial_covariance[3:, 3:]
    S = P[0, 0] + np.diag(np.diag(P)[1:][known])
    F = F[:, :, known]
    n = 1
    if window_s is None:
        F = F.sum(axis=3)
    else:
        F = F.reshape(*e.shape, -1)
        S = np.kron(S, np.ones((3, 3)))
        n = max(round(len(e) * fold.held_out.samples.dt_s / window_s), 1)
    errors = []
    for rows in np.array_split(np.arange(len(e)), n):
        FF, Fe, g = _gains(*(centred(values[rows]) / np.sqrt(loudness) for values in (F, e)))
        A = np.eye(len(g)) + S @ FF  # singular by rounding if no effect shows a gain
        error = max(float(Fe @ np.linalg.lstsq(A, g, rcond=RANK_TOLERANCE)[0]), 0.0)
        errors.append((error, int(np.linalg.matrix_rank(FF, tol=RANK_TOLERANCE * np.trace(FF)))))
    return errors


def gain_sd_with_deviations(parts: Parts, model: Model, folds: Sequence[Fold]) -> Floats:
    """Standard error of the gain of each group, sd (G,), of a gain that is 1 in the model:

        sd = min(sqrt(s^2 + d^2), GAIN_SD_CAP)
        d^2 = mean over k = 0 to K of d_k^2, 0 without other laws

    s: standard error of the fit. d_1 to d_K: deviations of the gain from 1 in each of several flights left
    out. d_0: the largest error by which the fit may misread the gain, sqrt(3) times its standard deviation
    under the noise model with the largest.
    """
    variance = group_gain_sd(fit_of(parts, model), model) ** 2
    if model.vehicle.other_laws:
        misreads = [noise.misreads for noise in model.colours] or [[0.0] * len(model.groups)]
        deviations = [_squared_deviations(fold) for fold in folds] if len(parts) > 1 else []
        variance += np.nanmean([3.0 * np.max(misreads, axis=0) ** 2, *deviations], axis=0)
    return np.minimum(np.sqrt(variance), GAIN_SD_CAP)


def _squared_deviations(fold: Fold) -> Floats:
    """Squared error of the gain of each group in a flight left out, less the part that the noise causes, at
    least 0, (G,); nan for a group whose effect is unknown or that the flight does not show."""
    F, e = standardized(fold.model, fold.innovations())
    F = F.sum(axis=3)
    squares = np.full(F.shape[2], np.nan)
    known = trust.known_effects(fold.model) & F.any(axis=(0, 1))
    if known.any():  # a part without a residual shows the effect of no group
        FF, _, g = _gains(F[:, :, known], e)
        P = np.linalg.pinv(FF, rcond=RANK_TOLERANCE, hermitian=True)
        squares[known] = np.maximum(g**2 - np.diag(P) * max(float((e**2).mean()), 1.0), 0.0)
    return squares


def _gains(F: Floats, e: Floats) -> tuple[Floats, Floats, Floats]:
    """F' F, F' e, and the errors g of the gains by least squares, of e (n, 3) = F g + noise, F (n, 3, m)."""
    X = F.reshape(e.size, F.shape[2])
    FF = X.T @ X
    Fe = X.T @ e.ravel()
    return FF, Fe, np.asarray(np.linalg.lstsq(FF, Fe, rcond=RANK_TOLERANCE)[0])


def standardized(model: Model, flight: regression.Innovations) -> tuple[Floats, Floats]:
    """The effect F (n, 3, G, 3) of each axis of each group's response on the residuals of a flight, and the
    residuals e (n, 3), both without means and in standard deviations of the noise, `quick_scale` included."""
    sd = np.sqrt(flight.noise.wider * flight.quick_scale(model))[:, None]
    F = np.einsum("nga,ab->nbga", flight.F, flight.W)
    return centred(F) / sd[:, :, None, None], centred(flight.e @ flight.W) / sd
