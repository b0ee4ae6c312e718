"""The noise models of a fit: one for the flights of each moving average.

ma, ar          moving average of the noise; predictor of a residual from those before
e, F, R         residual (n, 3), rad/s, responses (n, G, 3), rad/s, and covariance of the noise (3, 3),
                (rad/s)2, as in `regression`
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc_logs.fit_parts import FitPart, Parts, one_step_residuals
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats

# Number of earlier residuals in the AR predictor of a noise model: chosen on seeds 11 and 12 in light
# turbulence, and, for the evidence that a name needs, on seed 11 of a pa28.
AR_ORDER = 20
# In this share of the samples of the fit, the power of the quick responses counts as usual.
_USUAL_SHARE = 0.9
# Largest standard error of a gain: from 0.25 on, `trust.known_gains` no longer takes the gain as known.
GAIN_SD_CAP = 0.33


def parts_of_noise(parts: Parts, ma: Sequence[float]) -> list[FitPart]:
    """The parts that are whitened by this moving average."""
    return [part for part in parts if part.samples.noise_ma_coefficients == tuple(ma)]


def fit_noise_models(parts: Parts, model: Model) -> list[NoiseModel]:
    """A noise model for each moving average of the flights, none if they are not whitened."""
    noises = []
    for ma in sorted({part.samples.noise_ma_coefficients for part in parts} - {()}):
        alike = parts_of_noise(parts, ma)
        noise = _fit_noise_model(alike, model)
        noises.append(_with_errors(alike, model, noise) if model.vehicle.other_laws else noise)
    return noises


def _fit_noise_model(alike: Parts, model: Model) -> NoiseModel:
    """The noise of flights of one moving average, with an AR predictor of the residual from the p before it,
    by least squares on runs of samples without a gap:

        e[k] = [e[k-1] ... e[k-p]] ar + noise,    ar (3 p, 3)

    Without a predictor if the runs have fewer than ten samples a coefficient of an axis.
    """
    ma = list(alike[0].samples.noise_ma_coefficients)
    p = AR_ORDER
    runs = [run for part in alike for run in part.innovations(model).residual_runs()]
    long = [run for run in runs if len(run) > p]
    if sum(len(run) - p for run in long) < 10 * 3 * p:
        return NoiseModel(average=ma, noise=np.cov(np.vstack(runs).T).tolist())
    E = np.vstack([np.hstack([run[p - lag : -lag] for lag in range(1, p + 1)]) for run in long])
    e = np.vstack([run[p:] for run in long])
    ar = np.linalg.lstsq(E, e, rcond=None)[0]
    return NoiseModel(average=ma, before=ar.tolist(), noise=np.cov((e - E @ ar).T).tolist())


def _with_errors(alike: Parts, model: Model, noise: NoiseModel) -> NoiseModel:
    """The noise model of some flights with two more fields:

        misreads (G,)   share by which a fit may misread the effect of each group: m / sqrt(3), the standard
                        deviation of an error that is uniform between -m and m, where m is at most GAIN_SD_CAP
        quick           power of the quick part of the responses that the flights exceed in a tenth of their
                        samples, in variances of the noise

    The part of a residual that the past predicts is no noise: the model lacks it. A law that feeds it back to
    the surfaces makes it look like their effect. Let q be the power of this part on an axis and p that of the
    effect, both in variances of the noise. The effect on this axis is then misread by at most the share
    sqrt(q / p). Least squares weighs the axes by p. m adds their errors as if these were independent,
    m = sqrt(sum q p) / sum p, so it is no bound: if all axes err alike, the share is sum sqrt(q p) / sum p.
    """
    flights = [part.innovations(model.model_copy(update={"colours": [noise]})) for part in alike]
    r = np.diag(np.array(noise.noise))
    p = np.vstack([centred(flight.F) ** 2 for flight in flights]).mean(axis=0) / r
    q = np.maximum(one_step_residuals(alike, model).var(axis=0) / r - 1.0, 0.0)
    misread = np.minimum(np.sqrt(p @ q) / np.maximum(p.sum(axis=1), MIN_DIVISOR), GAIN_SD_CAP)
    powers = np.concatenate([flight.quick_power(model.rate_hz) for flight in flights])
    usual = float(np.quantile(powers, _USUAL_SHARE))
    return noise.model_copy(update={"misreads": (misread / np.sqrt(3.0)).tolist(), "quick": usual})


def centred(values: Floats) -> Floats:
    """Values (n, ...) less their mean over n; an empty array stays as it is."""
    return values - values.mean(axis=0) if len(values) else values
