"""The probabilities of the hypotheses in a flight.

The bank of filters (`filtering`) runs for each noise model, or else for each delay of the commands that the
flight may have. The results are averaged with the probabilities of these alternatives (`bank_posterior`).
Letters as in `filtering`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc_logs.bank import HypothesisBank
from beaver_ftc_logs.filtering import run_bank
from beaver_ftc_logs.flight_states import build_noise, build_states
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import Innovations, by_noise, innovations
from beaver_ftc_logs.runs import shifted, trailing_sums
from beaver_ftc_logs.samples import Samples

_EVIDENCE_MEMORY_S = 600.0  # memory of the comparison of delays or noise models
_SUM_SPANS_S = (0.0, 0.1)  # `recent_scale` sums the residual over each of these; 0: a single sample
_VARIANCE_WINDOW_S = 2.0  # `recent_scale` takes the variance of the sums over the last 2 s
# Probability of a noise model below which a sample leaves it out.
_MIN_NOISE_WEIGHT = 1e-3

# The two results of `run_bank`: probabilities (n, H) and log likelihoods (n,).
BankRun = tuple[Floats, Floats]


def bank_posterior(samples: Samples, model: Model, bank: HypothesisBank) -> Floats:
    """Probability of each hypothesis by sample, (n, H).

    It is a weighted average of several runs of the bank. If the model has noise models (`colours`) and the
    flight is not yet whitened, there is a run for each noise model, otherwise for each command delay of the
    settings. The weights are the probabilities of the runs given the last minutes (`model_weights`): of a
    delay by the likelihood of its run, of a noise model by that of a healthy flight (`_noise_likelihood`). A
    noise model is run only up to the last sample at which its weight is at least _MIN_NOISE_WEIGHT: within a
    second most become far less likely than another.
    """
    if not model.colours or samples.noise_ma_coefficients:
        delays = model.settings.delays_s
        flights = [innovations(_with_command_delay(samples, delay_s), model) for delay_s in delays]
        runs = [run_flight(flight, model, bank) for flight in flights]
        weights = model_weights([ll for _, ll in runs], model.rate_hz)
        return (weights[:, :, None] * np.array([p for p, _ in runs])).sum(axis=0)
    pairs = [(innovations(white, own_model), own_model) for white, own_model in by_noise(samples, model)]
    weights = model_weights([_noise_likelihood(*pair) for pair in pairs], model.rate_hz)
    kept = np.where(weights < _MIN_NOISE_WEIGHT, 0.0, weights)
    kept /= kept.sum(axis=0)
    mean = np.zeros((len(samples.t_s), len(bank.transition_share)))
    for w, (flight, own_model) in zip(kept, pairs, strict=True):
        if n := int(np.flatnonzero(w).max(initial=-1)) + 1:
            p, _ = run_flight(flight.at(slice(n)), own_model, bank)
            mean[:n] += w[:n, None] * p
    return mean


def _noise_likelihood(flight: Innovations, model: Model) -> Floats:
    """Log likelihood of each sample (n,), but for a constant, if all surfaces are healthy, for a flight that
    is whitened by the model's noise; 0 where the sample is not known:

        -power ((nu + 3) log(1 + d2 / nu) + 3 log q + log det R) / 2 + power 3 log sum(ma),   d2 = |e W|^2 / q

    R: covariance of the noise in the fit, without its inflation. ma: moving average of the noise.
    """
    q = flight.quick_scale(model)
    d2 = ((flight.e @ flight.W) ** 2).sum(axis=1) / q
    nu = model.settings.tail
    ll = -0.5 * ((nu + 3.0) * np.log1p(d2 / nu) + 3.0 * np.log(q)) - flight.log_size
    return np.where(flight.is_known, model.settings.power * ll, 0.0)


def _with_command_delay(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act delay_s later than in the model. A negative delay acts earlier; the
    magnitude counts up to one sample.

    A delayed command is interpolated between two samples. The model uses commands from one sample before the
    rates, so a negative delay needs no later command than that of the same sample.
    """
    n = np.clip(-delay_s / samples.dt_s, -1.0, 1.0)
    return replace(samples, commands=shifted(samples.commands, n))


def model_weights(ll: Sequence[Floats], rate_hz: float) -> Floats:
    """Probability of each of J alternative models at each sample, (J, n), from their log likelihoods ll, (n,)
    each. Older samples are forgotten exponentially, with the time constant _EVIDENCE_MEMORY_S."""
    from scipy.signal import lfilter

    pole = np.exp(-1.0 / (_EVIDENCE_MEMORY_S * rate_hz))
    sums = lfilter([1.0], [1.0, -pole], np.array(ll), axis=1)
    p = np.exp(sums - sums.max(axis=0))
    return p / p.sum(axis=0)


def run_flight(flight: Innovations, model: Model, bank: HypothesisBank) -> BankRun:
    """The result of `run_bank` for one flight. Under other laws, the scale of the noise has the lower bound
    of `recent_scale`."""
    q = flight.quick_scale(model)
    r_min = np.zeros(len(q))
    if model.vehicle.other_laws:
        white = flight.e @ flight.W / np.sqrt(flight.noise.wider * q[:, None])
        r_min = recent_scale(white, flight.is_known, model.rate_hz)
    states = build_states(model, flight.noise)
    noise = build_noise(model, flight.noise, flight.c)
    return run_bank(flight.y, flight.F, flight.is_known, bank, states, noise, r_min, q)


def recent_scale(g: Floats, ok: np.ndarray, rate_hz: float) -> Floats:
    """Variance of a flight's residual over the last _VARIANCE_WINDOW_S, over that of the noise, (n,):

        max over the spans of the mean of |sum of g over the span|^2 / (3 number of ok samples in the span)

    g (n, 3): residual in standard deviations of the noise, 0 where a sample is not ok (n,). The mean is over
    the rows of the window whose span has an ok sample; 0 without such a row.

    Air, gyros or a law that no fitted flight had leave a larger residual, and evidence must then count less
    at once. A fault leaves a larger residual, too; the right hypothesis explains it.
    """
    ratio = np.zeros(len(g))
    for span_s in _SUM_SPANS_S:
        sums, _ = trailing_sums(np.column_stack([g, ok]), span_s * rate_hz)
        n_ok = sums[:, 3]
        squares = (sums[:, :3] ** 2).sum(axis=1) / (3.0 * np.maximum(n_ok, 1.0))
        totals, _ = trailing_sums(np.column_stack([squares, n_ok > 0.0]), _VARIANCE_WINDOW_S * rate_hz)
        ratio = np.maximum(ratio, totals[:, 0] / np.maximum(totals[:, 1], 1.0))
    return ratio
