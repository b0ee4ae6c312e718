"""How a flight may differ from its model: the states of the bank of filters, and the noise.

Trim, common gain and each group's own gain may differ from the model. They start from it and are bounded, so
that the filter does not adapt to a fault that exists from the start. The trim differs as another loading or
rigging would change it, which is like a shift of each group's command, and it drifts. Gains return to those
of the model in time, since the airspeed varies about that of the fitted flights. If the standard error of a
group's gain is larger than a step between levels, the excess of its square is added to the variance of its
own gain. The square of the share by which the fit may misread the group is always added.

Letters as in `filtering`: n groups; response (n, L, 3), rad/s for one sample; index g is a group.
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats

# Squared residual from which on a larger one counts no more, if the noise has an AR predictor: the predictor
# needs a fraction of a second to adapt to a fault.
_MAX_SQUARE = 30.0


class StateModel(NamedTuple):
    """Limits of the adaptation of the N = 4 + G states: trim (3,) rad/s a sample, common gain, own gain of
    each group.

    initial_mean (N,) and initial_covariance (N, N) are those before the flight; max_deviation (N,): largest
    distance from the mean; deviation_retention (N,): share of that distance that remains a sample later;
    random_walk_variance (N,): variance added a sample.
    """

    initial_mean: Floats
    initial_covariance: Floats
    max_deviation: Floats
    deviation_retention: Floats
    random_walk_variance: Floats


def build_states(model: Model, noise: NoiseModel) -> StateModel:
    """The prior and the limits of trim and gains, from a model's settings: mean x (N,), covariance P (N, N),
    retention a (N,) = exp(-1 / (rate return_s)) a sample, and walk (N,) = (1 - a^2) diag(P), which keeps P;
    the trim does not return, and its walk is r trim_walk^2.

    States 0 to 2 are the trim, 3 the common gain, 4 to 3 + n the own gains of the n groups. r (3,): variance
    of the noise, (rad/s)2; shift (n, 3): trim by a shift of each group's command, rad/s; drift, hidden (n,):
    variance of an own gain that returns in time, and of the share that the fit misreads.
    """
    settings = model.settings
    n = len(model.groups)
    r = noise.wider * np.diag(np.array(noise.noise))
    shift = np.array(model.response).sum(axis=1) * settings.trim_shift
    P = np.zeros((4 + n, 4 + n))
    P[:3, :3] = np.diag(r * settings.trim_sd**2) + shift.T @ shift
    P[3, 3] = settings.gain_sd**2
    known_sd = np.array(model.fitted.gain_sd or [0.0] * n)
    drift = settings.own_gain_sd**2 + np.maximum(known_sd**2 - settings.level_step**2, 0.0)
    hidden = np.array(noise.misreads or [0.0] * n) ** 2
    P[range(4, 4 + n), range(4, 4 + n)] = drift + hidden
    # What the fit misreads stays the same in a flight: the larger spread adds nothing to the drift.
    own_s = settings.own_gain_time_s * (1.0 + hidden / np.maximum(drift, MIN_DIVISOR))
    return_s = np.array([np.inf] * 3 + [settings.gain_time_s, *own_s])
    a = np.exp(-1.0 / (model.rate_hz * return_s))
    walk = (1.0 - a**2) * np.diag(P)
    walk[:3] = r * np.array(settings.trim_walk) ** 2
    bound = np.array([settings.trim_bound] * 3 + [settings.gain_bound] * (1 + n))
    x = np.array([0.0, 0.0, 0.0, 1.0] + [0.0] * n)
    return StateModel(
        initial_mean=x,
        initial_covariance=P,
        max_deviation=np.sqrt(np.diag(P)) * bound,
        deviation_retention=a,
        random_walk_variance=walk,
    )


class ResidualNoise(NamedTuple):
    """The noise of the one-step residual.

    intercept_rad_s (3,): intercept of the model. covariance (3, 3) of a sample, (rad/s)2.
    effective_sample_share: information of a residual over that of a white one. t_degrees_of_freedom of its t
    distribution. scale_memory_samples: memory of the running scale of the covariance. max_squared_residual:
    squared standardised residual from which on a sample corrects no state, and a larger one is no less
    likely. covariance_inflation: covariance over that of the residuals in the fit.
    """

    intercept_rad_s: Floats
    covariance: Floats
    effective_sample_share: float
    t_degrees_of_freedom: float
    scale_memory_samples: float
    max_squared_residual: float
    covariance_inflation: float


def build_noise(model: Model, noise: NoiseModel, intercept_rad_s: Floats) -> ResidualNoise:
    """The noise of a flight, from a model's settings."""
    settings = model.settings
    return ResidualNoise(
        intercept_rad_s=intercept_rad_s,
        covariance=noise.wider * np.array(noise.noise),
        effective_sample_share=settings.power,
        t_degrees_of_freedom=settings.tail,
        scale_memory_samples=settings.noise_memory_s * model.rate_hz,
        max_squared_residual=_MAX_SQUARE if noise.before else np.inf,
        covariance_inflation=noise.wider,
    )
