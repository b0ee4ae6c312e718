"""A flight through the bank of filters: causal, one pass, all hypotheses at once.

Under hypothesis h with effectiveness e_h of the groups, what the past does not explain of the rates is

    y = c + s (b + sum_g e_hg F_g) + sum_g d_g e_hg F_g + noise,      noise ~ t(0, r R)

with the model's constant b, and of the flight its own trim c (3,), gain s, and what each group has more of it
than the others, d (G,): each hypothesis estimates them by a Kalman filter. r is the running scale of the
noise. The gain acts on what a trimmed flight balances: it shows by the motion alone, as dynamic pressure
does, and not in the trim. A hypothesis passes to another at random
times (interacting multiple models [Blom1988]): the one that takes over inherits trim and gain, plus an offset
where a surface may be stuck. The last hypothesis says that nothing answers the commands, as on the ground: it
learns no trim and no gain.

This is done once for each delay the flight may have; the likelier delay counts more.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc_logs.bank import HypothesisBank, build_residual_noise, build_trim_and_gain_state_model
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import whitened_rates_and_responses
from beaver_ftc_logs.samples import Samples, first_samples, whiten_samples

_MODEL_EVIDENCE_MEMORY_S = 600.0
_MIN_HYPOTHESIS_PROBABILITY = 1e-15
_SQUARED_RESIDUAL_CLIP_PER_AXIS = 3.0
_RESIDUAL_SUM_SPANS_S, _SCALE_WINDOW_S = (0.0, 0.1), 2.0
"""Spans over which a residual is summed, and the seconds in which its size is taken."""
_MEAN_CLIPPED_SQUARED_RESIDUAL_PER_AXIS = 0.93
"""Mean of the clipped square of a residual per axis when the scale is right."""
_MIN_NOISE_MODEL_PROBABILITY = 1e-3
"""Probability of a colour of the noise below which it is left out."""

BankRunResult = tuple[Floats, Floats, Floats, Floats]
"""As `run_bank` returns it."""


def hypothesis_posterior(
    samples: Samples, model: Model, bank: HypothesisBank
) -> tuple[Floats, Floats, Floats]:
    """Probability of each hypothesis (n, H), trim and gains (n, 4 + G) and noise scale (n,), by sample.

    The mean over the delays of the model's settings, and the colours of its noise where the flight is not yet
    whitened, each weighted by how well it explains the last minutes.
    """
    if model.noise_models and not samples.noise_ma_coefficients:
        return _posterior_averaged_over_noise_models(samples, model, bank)
    noise_model_of_flight, delays_s = (
        model.with_noise_model(samples.noise_ma_coefficients),
        model.settings.command_delay_candidates_s,
    )
    bank_runs = [
        _run_bank_on_flight(_with_command_delay(samples, delay_s), noise_model_of_flight, bank)
        for delay_s in delays_s
    ]
    return _average_bank_runs(
        list(_model_probabilities_with_forgetting([run[3] for run in bank_runs], model.rate_hz)), bank_runs
    )


def _posterior_averaged_over_noise_models(
    samples: Samples, model: Model, bank: HypothesisBank
) -> tuple[Floats, Floats, Floats]:
    """The mean over the colours of the noise. A colour is filtered up to the last sample at which its weight
    counts: within a second most are far less likely than another, and stay so."""
    whitened_flights = [
        (whiten_samples(samples, one.ma_coefficients), model.with_single_noise_model(one))
        for one in model.noise_models
    ]
    log_likelihoods = [
        _noise_model_log_likelihood(flight, single_model, single_model.noise_models[0])
        for flight, single_model in whitened_flights
    ]
    weights = _model_probabilities_with_forgetting(log_likelihoods, model.rate_hz)
    kept_weights = np.where(np.asarray(weights) < _MIN_NOISE_MODEL_PROBABILITY, 0.0, weights)
    kept_weights /= kept_weights.sum(axis=0)
    last_samples = [int(np.flatnonzero(weight).max(initial=-1)) + 1 for weight in kept_weights]
    bank_runs = [
        _run_bank_on_flight(
            first_samples(flight, count), single_model.with_noise_model(flight.noise_ma_coefficients), bank
        )
        for (flight, single_model), count in zip(whitened_flights, last_samples, strict=True) if count
    ]  # fmt: skip
    return _average_bank_runs(
        [weight for weight, count in zip(kept_weights, last_samples, strict=True) if count], bank_runs
    )


def _average_bank_runs(
    weights: Sequence[Floats], runs: Sequence[BankRunResult]
) -> tuple[Floats, Floats, Floats]:
    """Runs with weights (n,) each; a run ends where its weight stays 0."""
    averages: list[Floats] = []
    for output_index in range(3):
        shape = (len(weights[0]), *runs[0][output_index].shape[1:])
        average = np.zeros(shape)
        for weight, run in zip(weights, runs, strict=True):
            output = run[output_index]
            average[: len(output)] += weight[: len(output)].reshape(-1, *[1] * (output.ndim - 1)) * output
        averages.append(average)
    return averages[0], averages[1], averages[2]


def _noise_model_log_likelihood(flight: Samples, model: Model, noise_model: NoiseModel) -> Floats:
    """Log likelihood of a colour at each sample of a flight that is whitened by it, all in health, (n,): by
    its noise as it was, not as much wider as gains differ. Filtering made a sample C(1) times as large."""
    is_predictable, unexplained, responses = whitened_rates_and_responses(flight, model)
    residual = np.nan_to_num(
        unexplained - responses.sum(axis=1) - model.whitened_intercept(noise_model.ma_coefficients)
    )
    squared_residual = np.einsum(
        "na,ab,nb->n", residual, np.linalg.inv(noise_model.residual_covariance), residual
    )
    dof, log_determinant = (
        model.settings.t_degrees_of_freedom,
        np.linalg.slogdet(noise_model.residual_covariance)[1],
    )
    log_likelihood = -0.5 * ((dof + 3.0) * np.log1p(squared_residual / dof) + log_determinant) + 3.0 * np.log(
        sum(noise_model.ma_coefficients)
    )
    return np.where(is_predictable, model.settings.effective_sample_share * log_likelihood, 0.0)


def any_fault_log_odds_gains(posterior: Floats, bank: HypothesisBank) -> Floats:
    """Return the gain of each sample in the log odds of a fault, beyond that of a random change, (n,): the
    sum of it is the log of a likelihood ratio, in which one who believes in no fault gains nothing on the
    mean."""
    fault_probability = np.clip(
        posterior[:, bank.is_fault_hypothesis].sum(axis=1),
        _MIN_HYPOTHESIS_PROBABILITY,
        1.0 - _MIN_HYPOTHESIS_PROBABILITY,
    )
    change_to_fault = (
        bank.change_probability_per_sample
        * bank.transition_share[bank.is_fault_hypothesis].sum()
        / bank.transition_share.sum()
    )
    predicted_probability = np.concatenate(
        [
            [bank.prior_probability[bank.is_fault_hypothesis].sum()],
            (1.0 - bank.change_probability_per_sample) * fault_probability[:-1] + change_to_fault,
        ]
    )
    return np.asarray(
        np.log(fault_probability / (1.0 - fault_probability))
        - np.log(predicted_probability / (1.0 - predicted_probability))
    )


@kernel
def page_cusum(evidence_increments, max_sum):
    """Page's sum of evidence_increments (n,): never below zero, where it starts again, and never above
    max_sum, (n,)."""
    page_value, page_sums = 0.0, np.zeros(len(evidence_increments))
    for k in range(len(evidence_increments)):
        page_value = min(max(page_value + evidence_increments[k], 0.0), max_sum)
        page_sums[k] = page_value
    return page_sums


def _with_command_delay(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act by so much later, less than a sample, than the model says.

    Sooner takes from the command of the same sample, which is known; never from a later one: a command enters
    from one sample back.
    """
    if delay_s == 0.0:
        return samples
    delay_share, commands = min(abs(delay_s) / samples.dt_s, 1.0), samples.commands
    neighbouring_commands = np.vstack(
        [commands[:1], commands[:-1]] if delay_s > 0 else [commands[1:], commands[-1:]]
    )
    return replace(samples, commands=(1.0 - delay_share) * commands + delay_share * neighbouring_commands)


def _model_probabilities_with_forgetting(log_likelihoods: Sequence[Floats], rate_hz: float) -> Floats:
    """Probability of each delay at each sample, (D, n), by the evidence of some minutes."""
    from scipy.signal import lfilter

    forgetting_factor = np.exp(-1.0 / (_MODEL_EVIDENCE_MEMORY_S * rate_hz))
    cumulated = lfilter([1.0], [1.0, -forgetting_factor], np.array(log_likelihoods), axis=1)
    weights = np.exp(cumulated - cumulated.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


def _run_bank_on_flight(samples: Samples, model: Model, bank: HypothesisBank) -> BankRunResult:
    """As the kernel gives it."""
    ok, *parts = whitened_rates_and_responses(samples, model)
    unexplained, answers = (np.ascontiguousarray(np.nan_to_num(part)) for part in parts)
    noise = build_residual_noise(model, samples.noise_ma_coefficients)
    least = np.zeros(len(ok))
    if model.vehicle.other_laws:
        residual = np.where(ok[:, None], unexplained - noise.intercept_rad_s - answers.sum(axis=1), 0.0)
        least = recent_noise_variance_scale(residual, ok, noise.covariance, model.rate_hz)
    found: BankRunResult = run_bank(
        unexplained, answers, ok, bank, build_trim_and_gain_state_model(model), noise, least
    )
    return found


def recent_noise_variance_scale(
    residual: Floats, is_usable: np.ndarray, covariance: Floats, rate_hz: float
) -> Floats:
    """Return how many times the covariance of the fitted noise that of a flight's residual (n, 3) was in the
    last seconds, (n,), at each sample: of a sample, or of the sum of some per sample where these are alike.

    Air, gyros or a law that the fit has not seen leave more unexplained, and evidence is to weigh less at
    once. A fault leaves more, too; the hypothesis that is right explains it, and gains as much a sample.
    """
    white = residual @ np.linalg.inv(np.linalg.cholesky(covariance)).T
    total = np.cumsum(np.vstack([np.zeros((1, 3)), white]), axis=0)
    known = np.concatenate([[0], np.cumsum(is_usable)])
    end = np.arange(1, len(white) + 1)
    found = np.zeros(len(white))
    for span_s in _RESIDUAL_SUM_SPANS_S:
        begin = np.maximum(end - max(round(span_s * rate_hz), 1), 0)
        square = ((total[end] - total[begin]) ** 2).sum(axis=1) / (
            3.0 * np.maximum(known[end] - known[begin], 1)
        )
        sums = np.concatenate([[0.0], np.cumsum(square)])
        begin = np.maximum(end - max(round(_SCALE_WINDOW_S * rate_hz), 1), 0)
        found = np.maximum(found, (sums[end] - sums[begin]) / (end - begin))
    return found


@kernel
def run_bank(
    unexplained_rates, group_responses, is_usable, bank, state_model, noise, recent_noise_variance_scale
):
    """Posterior probability of each hypothesis, mean trim and gain, noise scale, and evidence, by sample.

    Evidence is the log likelihood of the sample given all before it, raised to the power.

    Shapes: unexplained_rates (n, 3); group_responses (n, G, 3) while healthy; is_usable (n,) the sample may
    be used. bank: HypothesisBank, state_model: TrimAndGainStateModel, noise: ResidualNoise (bank.py);
    recent_noise_variance_scale (n,): lower bound of the scale of the noise.
    """
    n, hypotheses, states = len(unexplained_rates), len(bank.transition_share), len(state_model.initial_mean)
    idle = hypotheses - 1
    mu = bank.prior_probability.copy()
    m = np.zeros((hypotheses, states))
    p = np.zeros((hypotheses, states, states))
    m[:] = state_model.initial_mean
    p[:] = state_model.initial_covariance
    posterior = np.zeros((n, hypotheses))
    trim = np.zeros((n, states))
    scales = np.zeros(n)
    evidence = np.zeros(n)
    scale = 1.0
    for k in range(n):
        prior = _mix_hypotheses(mu, m, p, bank, state_model.random_walk_variance)
        _relax_to_model(m, p, state_model)
        m[idle], p[idle] = (
            state_model.initial_mean,
            state_model.initial_covariance,
        )  # while nothing answers, nothing is learnt
        if is_usable[k]:
            mu, square, evidence[k] = _correct_hypotheses(
                prior,
                m,
                p,
                unexplained_rates[k],
                group_responses[k],
                bank,
                noise,
                max(scale, recent_noise_variance_scale[k]),
            )
            _limit_states(
                m,
                state_model.initial_mean - state_model.max_deviation,
                state_model.initial_mean + state_model.max_deviation,
            )
            scale *= np.exp(
                (1.0 - mu[idle])
                * (square / 3.0 - _MEAN_CLIPPED_SQUARED_RESIDUAL_PER_AXIS)
                / noise.scale_memory_samples
            )
            scale = min(max(scale, noise.min_variance_scale), noise.max_variance_scale)
        else:
            mu = prior
        posterior[k] = mu
        scales[k] = scale
        for h in range(hypotheses):
            trim[k] += mu[h] * m[h]
    return posterior, trim, scales, evidence


@kernel
def _mix_hypotheses(probabilities, state_means, state_covariances, bank, random_walk_variance):
    """Let each hypothesis pass to any other; state_means (H, N) and state_covariances (H, N, N) are replaced,
    the prior probabilities returned."""
    hypotheses, states = state_means.shape
    stay = 1.0 - bank.change_probability_per_sample
    mean = np.zeros(states)
    spread = np.zeros((states, states))
    for h in range(hypotheses):
        mean += probabilities[h] * state_means[h]
    for h in range(hypotheses):
        for i in range(states):
            for j in range(states):
                spread[i, j] += probabilities[h] * (
                    state_covariances[h, i, j] + (state_means[h, i] - mean[i]) * (state_means[h, j] - mean[j])
                )
    prior = np.empty(hypotheses)
    total = 0.0
    for h in range(hypotheses):
        prior[h] = stay * probabilities[h] + bank.change_probability_per_sample * bank.transition_share[h]
        total += prior[h]
        _merge_gaussians(
            stay * probabilities[h] / prior[h],
            state_means[h],
            state_covariances[h],
            mean,
            spread,
            bank.rate_offset_variance[h],
            random_walk_variance,
        )
    return prior / total


@kernel
def _merge_gaussians(
    own_weight,
    state_mean,
    state_covariance,
    mixed_mean,
    mixed_covariance,
    rate_offset_variance,
    random_walk_variance,
):
    """One Gaussian for two: the hypothesis' own with weight `own_weight`, everyone's with the rest.

    state_mean (N,) and state_covariance (N, N) are replaced; who comes from elsewhere brings the offset of
    the rates along, of variance rate_offset_variance (3,).
    """
    rest, states = 1.0 - own_weight, len(state_mean)
    for i in range(states):
        for j in range(states):
            away = (state_mean[i] - mixed_mean[i]) * (state_mean[j] - mixed_mean[j])
            state_covariance[i, j] = (
                own_weight * state_covariance[i, j] + rest * mixed_covariance[i, j] + own_weight * rest * away
            )
        state_covariance[i, i] += random_walk_variance[i]
    for i in range(states):
        state_mean[i] = own_weight * state_mean[i] + rest * mixed_mean[i]
    for i in range(len(rate_offset_variance)):
        state_covariance[i, i] += rest * rate_offset_variance[i]


@kernel
def _relax_to_model(state_means, state_covariances, state_model):
    """Let all trims and gains return towards the model's; state_means (H, N) and state_covariances (H, N, N)
    are replaced."""
    for h in range(len(state_means)):
        for i in range(len(state_model.deviation_retention)):
            state_means[h, i] = state_model.initial_mean[i] + state_model.deviation_retention[i] * (
                state_means[h, i] - state_model.initial_mean[i]
            )
            for j in range(len(state_model.deviation_retention)):
                state_covariances[h, i, j] *= (
                    state_model.deviation_retention[i] * state_model.deviation_retention[j]
                )


@kernel
def _correct_hypotheses(
    prior_probabilities,
    state_means,
    state_covariances,
    unexplained_rates,
    group_responses,
    bank,
    noise,
    noise_variance_scale,
):
    """Kalman correction of every hypothesis by one sample; state_means and state_covariances are replaced.

    Returns the posterior probabilities, the clipped square of the residual under them, as if the noise were
    no wider than residuals are, and the evidence.
    """
    hypotheses, states = state_means.shape
    log = np.empty(hypotheses)
    squares = np.empty(hypotheses)
    nothing, certain = np.zeros(states), np.zeros((states, states))
    covariance, dof = noise.covariance * noise_variance_scale, noise.t_degrees_of_freedom
    for h in range(hypotheses):
        seen = _state_sensitivity(
            bank.effectiveness[h],
            bank.response_share_scaled_by_group_gain[h],
            group_responses,
            noise.intercept_rad_s,
            states,
        )
        if h == hypotheses - 1:
            squares[h], log_det = _update_gaussian(
                nothing, certain, unexplained_rates, seen, covariance, noise
            )
        else:
            squares[h], log_det = _update_gaussian(
                state_means[h], state_covariances[h], unexplained_rates, seen, covariance, noise
            )
        square = min(squares[h], noise.max_squared_residual)
        log[h] = noise.effective_sample_share * (
            -0.5 * (dof + 3.0) * np.log(1.0 + square / dof) - 0.5 * log_det
        )
    most = log.max()
    mu = np.maximum(prior_probabilities * np.exp(log - most), _MIN_HYPOTHESIS_PROBABILITY)
    total = mu.sum()
    mu /= total
    clipped = 0.0
    for h in range(hypotheses):
        clipped += mu[h] * min(noise.covariance_inflation * squares[h], 3.0 * _SQUARED_RESIDUAL_CLIP_PER_AXIS)
    return mu, clipped, most + np.log(total)


@kernel
def _state_sensitivity(effectiveness, gain_sensitivity, group_responses, intercept_rad_s, n_states):
    """How the rates show the states, (N, 3): trim, the gain of the constant and of all group_responses (G,
    3), each as effective as effectiveness (G,) says, and each group's own gain, gain_sensitivity (G,) of its
    response."""
    seen = np.zeros((n_states, 3))
    seen[:3] = np.eye(3)
    seen[3] = intercept_rad_s
    for g in range(len(effectiveness)):
        seen[4 + g] = gain_sensitivity[g] * group_responses[g]
        seen[3] += effectiveness[g] * group_responses[g]
    return seen


@kernel
def _limit_states(state_means, min_state, max_state):
    """Keep every hypothesis' trim and gain near those of the model: a fault is not to be learnt away."""
    for h in range(len(state_means)):
        state_means[h] = np.minimum(np.maximum(state_means[h], min_state), max_state)


@kernel
def _update_gaussian(
    state_mean, state_covariance, unexplained_rates, state_sensitivity, noise_covariance, noise
):
    """Correct one Gaussian (state_mean (N,), state_covariance (N, N), replaced) by unexplained_rates (3,) =
    state_sensitivity' state_mean + noise, state_sensitivity (N, 3).

    Returns the square of the residual in its own covariance, and the log determinant of that. A residual far
    out in the tail of the t distribution counts less, and one that is too far nothing.
    """
    states, dof = len(state_mean), noise.t_degrees_of_freedom
    cross = np.zeros((states, 3))
    s = noise_covariance.copy()
    v = unexplained_rates.copy()
    for i in range(states):
        for j in range(3):
            v[j] -= state_mean[i] * state_sensitivity[i, j]
            for k in range(states):
                cross[i, j] += state_covariance[i, k] * state_sensitivity[k, j]
    for i in range(states):
        for j in range(3):
            for k in range(3):
                s[j, k] += state_sensitivity[i, j] * cross[i, k]
    inverse, determinant = _invert_symmetric(s)
    gain = np.zeros((states, 3))
    square = 0.0
    for j in range(3):
        for k in range(3):
            square += v[j] * inverse[j, k] * v[k]
            for i in range(states):
                gain[i, j] += cross[i, k] * inverse[k, j]
    gain *= min(1.0, (dof + 3.0) / (dof + square)) if square < noise.max_squared_residual else 0.0
    for j in range(3):
        for i in range(states):
            state_mean[i] += gain[i, j] * v[j]
            # mirrored: what rounding makes of an unsymmetric matrix grows without bound
            for k in range(i + 1):
                state_covariance[i, k] -= gain[i, j] * cross[k, j]
                state_covariance[k, i] = state_covariance[i, k]
    return square, np.log(determinant)


@kernel
def _invert_symmetric(matrix):
    """Inverse and determinant of a symmetric (3, 3) matrix, by its cofactors."""
    c = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            d, e = (j + 1) % 3, (j + 2) % 3
            c[j, i] = matrix[a, d] * matrix[b, e] - matrix[a, e] * matrix[b, d]
    determinant = matrix[0, 0] * c[0, 0] + matrix[0, 1] * c[1, 0] + matrix[0, 2] * c[2, 0]
    return c / determinant, determinant
