"""A flight through the bank of filters, once for each delay it may have; the likelier delay counts more."""

from dataclasses import replace

import numpy as np

from beaver_ftc.flights.adaptation import adaptation_of
from beaver_ftc.flights.bank import Bank, at_first
from beaver_ftc.flights.kernel import run_bank
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.regressors import build, group_indices, predict
from beaver_ftc.flights.samples import Samples

_LEAST_SCALE, _MOST_SCALE = 0.3, 6.0
_DELAY_MEMORY_S = 600.0


def posterior_of(samples: Samples, model: Model, bank: Bank) -> tuple[Floats, Floats, Floats]:
    """Probability of each hypothesis (n, H), trim and gains (n, 4 + G) and noise scale (n,), by sample.

    The mean over the delays of the model's settings, each weighted by how well it explains the last minutes.
    """
    runs = [_filtered(_later(samples, delay_s), model, bank) for delay_s in model.settings.delays_s]
    weights = _weights([run[3] for run in runs], model.rate_hz)
    posterior = sum(weight[:, None] * run[0] for weight, run in zip(weights, runs, strict=True))
    state = sum(weight[:, None] * run[1] for weight, run in zip(weights, runs, strict=True))
    scale = sum(weight * run[2] for weight, run in zip(weights, runs, strict=True))
    return np.asarray(posterior), np.asarray(state), np.asarray(scale)


def _later(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act by so much later, less than a sample, than the model says.

    Sooner takes from the command of the same sample, which is known; never from a later one: a command enters
    from one sample back.
    """
    if delay_s == 0.0:
        return samples
    share, commands = min(abs(delay_s) / samples.dt_s, 1.0), samples.commands
    other = np.vstack([commands[:1], commands[:-1]] if delay_s > 0 else [commands[1:], commands[-1:]])
    return replace(samples, commands=(1.0 - share) * commands + share * other)


def _weights(evidence: list[Floats], rate_hz: float) -> Floats:
    """Probability of each delay at each sample, (D, n), by the evidence of some minutes."""
    from scipy.signal import lfilter

    fade = np.exp(-1.0 / (_DELAY_MEMORY_S * rate_hz))
    total = lfilter([1.0], [1.0, -fade], np.array(evidence), axis=1)
    weights = np.exp(total - total.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


def _filtered(samples: Samples, model: Model, bank: Bank) -> tuple[Floats, Floats, Floats, Floats]:
    """As the kernel gives it."""
    regressors = build(samples, group_indices(model), model.history, model.lags, scaled=False)
    intercept, past, response, noise = model.arrays()
    settings, own = model.settings, adaptation_of(model)
    unexplained, answers = predict(samples.rates, regressors, past, response)
    change = settings.changes_per_hour / (3600.0 * model.rate_hz)
    memory = settings.noise_memory_s * model.rate_hz
    found: tuple[Floats, Floats, Floats, Floats] = run_bank(
        np.ascontiguousarray(np.nan_to_num(unexplained)),
        np.ascontiguousarray(np.nan_to_num(answers)),
        intercept,
        regressors.ok,
        bank.effectiveness,
        change * bank.weight,
        1.0 - change,
        bank.offset,
        bank.idle,
        at_first(bank),
        own.mean,
        own.covariance,
        own.bound,
        own.keep,
        own.walk,
        noise,
        (settings.power, settings.tail, memory, _LEAST_SCALE, _MOST_SCALE),
    )
    return found
