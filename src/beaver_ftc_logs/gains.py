"""The errors of the gains of the groups in parts left out, and the inflation of the noise that covers them.

Letters as in `orders`, and

    e, F            residual (n, 3) and responses (n, 3, G, 3), in standard deviations of the noise, without
                    means, from `_standardized`. The last axis of F is the axis of the response
    g, S            errors of the groups' gains (G,), and covariance of the gains in the filter's prior (G, G)
    known           whether the effect of each group is known (G,)
"""

import numpy as np

from beaver_ftc_logs import regression, trust
from beaver_ftc_logs.bank import build_states
from beaver_ftc_logs.filtering import recent_scale
from beaver_ftc_logs.folds import Fold, held_out_folds
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.orders import RANK_TOLERANCE, centred, parts_of_noise
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import FitPart, Parts

# Length of the windows in which the gains are estimated: chosen on seeds 11 and 12, in light turbulence.
_GAIN_WINDOW_S = 10.0
# Further factors on the variance of the noise of gyros and of gusts, in moving air under another law. Chosen
# on seeds 71, 73 and 101 to 106: 3 of 240 healthy flights alarmed, and 6 of 150 without the factors.
_GYRO_FACTOR = 1.7
_GUST_FACTOR = 2.5
# Largest noise factor of a window. If there are few flights, one of them can be far from all others (a factor
# of 1,550 in seed 205, otherwise 5).
_MAX_INFLATION = 200.0


def gain_overdispersion(parts: Parts, model: Model) -> float:
    """Ratio of the squared errors of the gains of parts left out to those that the filter expects.

    In a part, least squares of the residual e = F g + noise gives the errors g of the gains (`_gain_errors`).
    If the noise were white and all flights alike, the square of g in the covariance (F' F)^-1 + S would on
    average equal the number of gains. Differences between flights and the colour of the noise make it larger.
    The information of a sample about an effectiveness is smaller by this ratio [McCullagh1989, section 4.5].
    One further part with the ratio 1 and a gain for each group is counted.
    """
    errors = [(float(len(model.groups)), len(model.groups))]
    for fold in held_out_folds(parts, model):
        errors += _gain_errors(fold)
    total, n = np.sum(errors, axis=0)
    return float(total / n)


def widen_noise(parts: Parts, model: Model) -> Model:
    """The model whose noise models have a variance inflation (`wider`), at least 1: the mean over all windows
    of _GAIN_WINDOW_S in parts left out, with this noise, of the squared errors of the gains over the expected
    ones, each at most _MAX_INFLATION, with a gain for each axis of a response; under other laws, times
    _GYRO_FACTOR or _GUST_FACTOR. A noise without a window gets 1."""
    windows: dict[tuple[float, ...], list[float]] = {}
    for fold in held_out_folds(parts, model):
        loudness = _loudness(fold, fold.fitted if len(parts) > 1 else parts)
        errors = _gain_errors(fold, _GAIN_WINDOW_S, loudness)
        inflations = windows.setdefault(fold.held_out.samples.noise_ma_coefficients, [])
        inflations.extend(min(error / max(n, 1), _MAX_INFLATION) for error, n in errors)
    noises = []
    for noise in model.colours:
        ma = tuple(noise.average)
        inflation = 1.0
        if windows.get(ma):
            inflation = max(float(np.mean(windows[ma])), 1.0)
            if model.vehicle.other_laws:
                # The noise of a gyro subtracts from the next sample what it added to one: its ma[1] is
                # negative.
                inflation *= _GYRO_FACTOR if len(ma) > 1 and ma[1] < 0.0 else _GUST_FACTOR
        noises.append(noise.model_copy(update={"wider": inflation}))
    return model.model_copy(update={"colours": noises})


def _loudness(fold: Fold, others: Parts) -> float:
    """Ratio of the variance of the residual in a flight left out to that in the loudest other flight of the
    same noise, or to that of the noise if it is larger; 1 if the flight is not louder, or if no other laws
    fly. The filter widens its noise by this ratio itself (`recent_scale`), so `_gain_errors` divides F and e
    by its root."""
    model = fold.model
    ma = fold.held_out.samples.noise_ma_coefficients
    if not model.vehicle.other_laws:
        return 1.0

    def scale(part: FitPart) -> float:
        """Mean ratio of the variance in a part to that of the noise, 1 without a sample."""
        _, e = _standardized(model, part.innovations(model))
        scales = recent_scale(e, np.ones(len(e), dtype=bool), model.rate_hz)
        return float(scales.mean()) if len(scales) else 1.0

    return max(scale(fold.held_out) / max([1.0, *map(scale, parts_of_noise(others, ma))]), 1.0)


def _gain_errors(fold: Fold, window_s: float | None = None, loudness: float = 1.0) -> list[tuple[float, int]]:
    """The square of the errors g of the gains in a part left out, and the number of gains that it shows (the
    rank of F' F):

        g = (F' F)^-1 F' e,    square = g' ((F' F)^-1 + S)^-1 g = (F' e)' (1 + S F' F)^-1 g

    Without window_s: one pair, with a gain for each group; the effects of its axes are added. With window_s:
    a pair for each window of about this length, with a gain for each axis of each group. The gains of the
    three axes of a group then have the same prior error. loudness: ratio of variances by which the filter
    widens its noise itself (`_loudness`).
    """
    known = trust.known_effects(fold.model)
    flight = fold.innovations()
    F, e = _standardized(fold.model, flight)
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


def squared_deviations(fold: Fold) -> Floats:
    """Squared error of the gain of each group in a flight left out, less the part that the noise causes, at
    least 0, (G,); nan for a group whose effect is unknown or that the flight does not show."""
    F, e = _standardized(fold.model, fold.innovations())
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


def _standardized(model: Model, flight: regression.Innovations) -> tuple[Floats, Floats]:
    """The effect F (n, 3, G, 3) of each axis of each group's response on the residuals of a flight, and the
    residuals e (n, 3), both without means and in standard deviations of the noise, `quick_scale` included."""
    sd = np.sqrt(flight.noise.wider * flight.quick_scale(model))[:, None]
    F = np.einsum("nga,ab->nbga", flight.F, flight.W)
    return centred(F) / sd[:, :, None, None], centred(flight.e @ flight.W) / sd
