"""The bank of filters: one causal pass through a flight, with all hypotheses in parallel.

Under hypothesis h, with effectiveness e_h of the groups, the part of the rates unexplained by the past is

    y = c + s (b + sum_g e_hg F_g) + sum_g d_g e_hg F_g + noise,      noise ~ t(0, q r R)

with the intercept b of the model. The trim c (3,), the common gain s and the additional gain d (G,) of each
group belong to the flight: each hypothesis estimates them with a Kalman filter. r is the running scale of the
noise, and q the variance of a sample over that of the noise, larger after quick commands
(`quick_response_variance_scale`). The common gain multiplies the intercept and all responses, whose sum
vanishes in trimmed flight: it shows in the motion about trim, as the dynamic pressure does, and not in the
trim. One hypothesis changes to another at random times (interacting multiple models [Blom1988]); the new one
inherits trim and gains, plus an offset of the rates if a surface may be stuck. The last hypothesis is that
nothing answers the commands, as on the ground: it estimates no trim and no gain.

The pass is repeated for each delay of the commands that the flight may have; the results are averaged with
the probabilities of the delays.
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
_RESIDUAL_SUM_SPANS_S, _VARIANCE_WINDOW_S = (0.0, 0.1), 2.0
"""Spans over which a residual is summed, and the window in which its variance is taken."""
_QUICK_RESPONSE_SPAN_S = 0.5
"""A response is quick if it differs from its mean over so many seconds."""
_MEAN_CLIPPED_SQUARED_RESIDUAL_PER_AXIS = 0.93
"""Mean of the clipped square of a residual per axis when the scale is right."""
_MIN_NOISE_MODEL_PROBABILITY = 1e-3
"""Probability of a noise model below which it is left out."""

BankRunResult = tuple[Floats, Floats, Floats, Floats]
"""As `run_bank` returns it."""


def hypothesis_state_and_noise_posterior(
    samples: Samples, model: Model, bank: HypothesisBank
) -> tuple[Floats, Floats, Floats]:
    """Probability of each hypothesis (n, H), trim and gains (n, 4 + G) and noise scale (n,), by sample.

    All are averages over the command delays of the model's settings and, if the flight is not yet whitened,
    over its noise models. The weights are their probabilities given the last minutes.
    """
    if model.noise_models and not samples.noise_ma_coefficients:
        return _posterior_averaged_over_noise_models(samples, model, bank)
    model_with_noise_covariance = model.with_inflated_covariance_of_noise_model(samples.noise_ma_coefficients)
    command_delay_offset_candidates_s = model.settings.command_delay_offset_candidates_s
    bank_runs = [
        _run_bank_on_flight(_with_command_delay(samples, delay_s), model_with_noise_covariance, bank)
        for delay_s in command_delay_offset_candidates_s
    ]
    return _average_bank_runs(
        list(_model_probabilities_with_forgetting([run[3] for run in bank_runs], model.rate_hz)), bank_runs
    )


def _posterior_averaged_over_noise_models(
    samples: Samples, model: Model, bank: HypothesisBank
) -> tuple[Floats, Floats, Floats]:
    """The average over the noise models. The bank is run with each up to the last sample at which its weight
    is not negligible: within a second most become far less likely than another, and stay so."""
    whitened_flights_and_models = [
        (whiten_samples(samples, noise_model.ma_coefficients), model.with_single_noise_model(noise_model))
        for noise_model in model.noise_models
    ]
    sample_log_likelihoods_by_model = [
        _noise_model_log_likelihood(
            whitened_flight, model_with_one_noise_model, model_with_one_noise_model.noise_models[0]
        )
        for whitened_flight, model_with_one_noise_model in whitened_flights_and_models
    ]
    noise_model_probabilities = _model_probabilities_with_forgetting(
        sample_log_likelihoods_by_model, model.rate_hz
    )
    kept_probabilities = np.where(
        np.asarray(noise_model_probabilities) < _MIN_NOISE_MODEL_PROBABILITY, 0.0, noise_model_probabilities
    )
    kept_probabilities /= kept_probabilities.sum(axis=0)
    n_run_samples_by_model = [
        int(np.flatnonzero(probability).max(initial=-1)) + 1 for probability in kept_probabilities
    ]
    bank_runs = [
        _run_bank_on_flight(
            first_samples(whitened_flight, n_samples),
            model_with_one_noise_model.with_inflated_covariance_of_noise_model(
                whitened_flight.noise_ma_coefficients
            ),
            bank,
        )
        for (whitened_flight, model_with_one_noise_model), n_samples in zip(
            whitened_flights_and_models, n_run_samples_by_model, strict=True
        )
        if n_samples
    ]
    return _average_bank_runs(
        [
            probability
            for probability, n_samples in zip(kept_probabilities, n_run_samples_by_model, strict=True)
            if n_samples
        ],
        bank_runs,
    )


def _average_bank_runs(
    weights: Sequence[Floats], bank_runs: Sequence[BankRunResult]
) -> tuple[Floats, Floats, Floats]:
    """Weighted average of runs; weights (n,) each. A run may be shorter than n where its weight stays 0."""
    averages: list[Floats] = []
    for output_index in range(3):
        shape = (len(weights[0]), *bank_runs[0][output_index].shape[1:])
        average = np.zeros(shape)
        for weight, bank_run in zip(weights, bank_runs, strict=True):
            output = bank_run[output_index]
            average[: len(output)] += weight[: len(output)].reshape(-1, *[1] * (output.ndim - 1)) * output
        averages.append(average)
    return averages[0], averages[1], averages[2]


def _noise_model_log_likelihood(whitened_flight: Samples, model: Model, noise_model: NoiseModel) -> Floats:
    """Log likelihood (n,) of a noise model for a flight that is whitened by it, with all surfaces healthy; by
    the covariance of the fit, without its inflation. The filter multiplied the samples by C(1)."""
    is_predictable, rates_unexplained_by_past, group_responses = whitened_rates_and_responses(
        whitened_flight, model
    )
    residual = np.nan_to_num(
        rates_unexplained_by_past
        - group_responses.sum(axis=1)
        - model.whitened_intercept(noise_model.ma_coefficients)
    )
    covariance = np.array(noise_model.residual_covariance)
    quick_variance_scale = quick_response_variance_scale(
        np.nan_to_num(group_responses), model, noise_model.ma_coefficients
    )
    squared_residual = np.einsum("na,ab,nb->n", residual, np.linalg.inv(covariance), residual)
    squared_residual /= quick_variance_scale
    t_degrees_of_freedom = model.settings.t_degrees_of_freedom
    log_determinant = np.linalg.slogdet(covariance)[1] + 3.0 * np.log(quick_variance_scale)
    log_likelihood = -0.5 * (
        (t_degrees_of_freedom + 3.0) * np.log1p(squared_residual / t_degrees_of_freedom) + log_determinant
    ) + 3.0 * np.log(sum(noise_model.ma_coefficients))
    return np.where(is_predictable, model.settings.effective_sample_share * log_likelihood, 0.0)


def any_fault_log_odds_gains(posterior: Floats, bank: HypothesisBank) -> Floats:
    """Return the increase of the log odds of any fault by each sample, beyond that by the prior of a change,
    (n,). Its sum is the logarithm of a likelihood ratio."""
    fault_probability = np.clip(
        posterior[:, bank.is_fault_hypothesis].sum(axis=1),
        _MIN_HYPOTHESIS_PROBABILITY,
        1.0 - _MIN_HYPOTHESIS_PROBABILITY,
    )
    change_from_any_hypothesis_to_fault_probability = (
        bank.change_probability_per_sample
        * bank.transition_share[bank.is_fault_hypothesis].sum()
        / bank.transition_share.sum()
    )
    predicted_fault_probability = np.concatenate(
        [
            [bank.prior_probability[bank.is_fault_hypothesis].sum()],
            (1.0 - bank.change_probability_per_sample) * fault_probability[:-1]
            + change_from_any_hypothesis_to_fault_probability,
        ]
    )
    return np.asarray(
        np.log(fault_probability / (1.0 - fault_probability))
        - np.log(predicted_fault_probability / (1.0 - predicted_fault_probability))
    )


@kernel
def page_cusum(evidence_increments, max_sum):
    """Page's sum of evidence_increments (n,): never below zero, where it starts again, and never above
    max_sum, (n,)."""
    page_sum, page_sums = 0.0, np.zeros(len(evidence_increments))
    for k in range(len(evidence_increments)):
        page_sum = min(max(page_sum + evidence_increments[k], 0.0), max_sum)
        page_sums[k] = page_sum
    return page_sums


def _with_command_delay(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act delay_s later than in the model; at most a sample, may be negative.

    The model uses commands from one sample before the rates, so a negative delay needs no later command than
    that of the same sample.
    """
    if delay_s == 0.0:
        return samples
    delay_magnitude_samples, commands = min(abs(delay_s) / samples.dt_s, 1.0), samples.commands
    neighbouring_commands = np.vstack(
        [commands[:1], commands[:-1]] if delay_s > 0 else [commands[1:], commands[-1:]]
    )
    return replace(
        samples,
        commands=(1.0 - delay_magnitude_samples) * commands + delay_magnitude_samples * neighbouring_commands,
    )


def _model_probabilities_with_forgetting(
    sample_log_likelihoods_by_model: Sequence[Floats], rate_hz: float
) -> Floats:
    """Probability of each alternative model (D of them) at each sample, (D, n), from its log likelihoods
    (n,), forgotten exponentially within minutes."""
    from scipy.signal import lfilter

    forgetting_factor = np.exp(-1.0 / (_MODEL_EVIDENCE_MEMORY_S * rate_hz))
    cumulated_log_likelihoods = lfilter(
        [1.0], [1.0, -forgetting_factor], np.array(sample_log_likelihoods_by_model), axis=1
    )
    relative_likelihoods = np.exp(cumulated_log_likelihoods - cumulated_log_likelihoods.max(axis=0))
    return np.asarray(relative_likelihoods / relative_likelihoods.sum(axis=0))


def _run_bank_on_flight(samples: Samples, model: Model, bank: HypothesisBank) -> BankRunResult:
    """The result of `run_bank` for one flight."""
    is_predictable, *rates_and_responses = whitened_rates_and_responses(samples, model)
    rates_unexplained_by_past, group_responses = (
        np.ascontiguousarray(np.nan_to_num(array)) for array in rates_and_responses
    )
    noise_parameters = build_residual_noise(model, samples.noise_ma_coefficients)
    quick_variance_scales = quick_response_variance_scale(
        group_responses, model, samples.noise_ma_coefficients
    )
    min_noise_variance_scales = np.zeros(len(is_predictable))
    if model.vehicle.other_laws:
        residual = np.where(
            is_predictable[:, None],
            rates_unexplained_by_past - noise_parameters.intercept_rad_s - group_responses.sum(axis=1),
            0.0,
        ) / np.sqrt(quick_variance_scales[:, None])
        min_noise_variance_scales = recent_noise_variance_scale(
            residual, is_predictable, noise_parameters.covariance, model.rate_hz
        )
    bank_run: BankRunResult = run_bank(
        rates_unexplained_by_past,
        group_responses,
        is_predictable,
        bank,
        build_trim_and_gain_state_model(model, samples.noise_ma_coefficients),
        noise_parameters,
        min_noise_variance_scales,
        quick_variance_scales,
    )
    return bank_run


def quick_response_variance_scale(
    group_responses: Floats, model: Model, ma_coefficients: Sequence[float]
) -> Floats:
    """Return the variance of the residual over that of the noise, (n,): above 1 where responses (n, G, 3) are
    quicker than usual in the fit, since a share of the quick part may be missing, or be too much.

    Slow commands of healthy flight hardly show how a surface responds to a step. The error after a step is no
    noise: it has the same sign in many samples.
    """
    power = quick_response_power(
        group_responses, model.covariance_of_noise_model(ma_coefficients), model.rate_hz
    )
    unusual_power = np.maximum(power - model.usual_quick_response_power(ma_coefficients), 0.0)
    return np.asarray(1.0 + model.settings.quick_response_error_share**2 * unusual_power)


def quick_response_power(group_responses: Floats, noise_covariance: Floats, rate_hz: float) -> Floats:
    """Return the power of the quick part of the responses (n, G, 3) an axis, in variances of the noise, (n,).

    The quick part is the difference from the mean over the last half second.
    """
    window_end_rows = np.arange(1, len(group_responses) + 1)
    window_begin_rows = np.maximum(window_end_rows - max(round(_QUICK_RESPONSE_SPAN_S * rate_hz), 1), 0)
    cumulated_responses = np.concatenate(
        [np.zeros((1, *group_responses.shape[1:])), np.cumsum(group_responses, axis=0)]
    )
    slow_responses = (cumulated_responses[window_end_rows] - cumulated_responses[window_begin_rows]) / (
        window_end_rows - window_begin_rows
    )[:, None, None]
    whitening_matrix = np.linalg.inv(np.linalg.cholesky(noise_covariance)).T
    return np.asarray((((group_responses - slow_responses) @ whitening_matrix) ** 2).sum(axis=(1, 2)) / 3.0)


def recent_noise_variance_scale(
    residual: Floats, is_usable: np.ndarray, noise_covariance: Floats, rate_hz: float
) -> Floats:
    """Return the ratio of the variance of a flight's residual (n, 3) in the last seconds to that of the
    fitted noise, (n,): of single samples, or of sums of several if that is larger.

    Air, gyros or a law that no fitted flight had leave a larger residual, and evidence must then count less
    at once. A fault leaves a larger residual, too; the right hypothesis explains it.
    """
    whitened_residual = residual @ np.linalg.inv(np.linalg.cholesky(noise_covariance)).T
    cumulated_residual = np.cumsum(np.vstack([np.zeros((1, 3)), whitened_residual]), axis=0)
    cumulated_usable_count = np.concatenate([[0], np.cumsum(is_usable)])
    window_end_rows = np.arange(1, len(whitened_residual) + 1)
    max_variance_ratio = np.zeros(len(whitened_residual))
    for span_s in _RESIDUAL_SUM_SPANS_S:
        span_begin_rows = np.maximum(window_end_rows - max(round(span_s * rate_hz), 1), 0)
        squared_sum_per_sample_and_axis = (
            (cumulated_residual[window_end_rows] - cumulated_residual[span_begin_rows]) ** 2
        ).sum(axis=1) / (
            3.0
            * np.maximum(cumulated_usable_count[window_end_rows] - cumulated_usable_count[span_begin_rows], 1)
        )
        cumulated_squares = np.concatenate([[0.0], np.cumsum(squared_sum_per_sample_and_axis)])
        window_begin_rows = np.maximum(window_end_rows - max(round(_VARIANCE_WINDOW_S * rate_hz), 1), 0)
        max_variance_ratio = np.maximum(
            max_variance_ratio,
            (cumulated_squares[window_end_rows] - cumulated_squares[window_begin_rows])
            / (window_end_rows - window_begin_rows),
        )
    return max_variance_ratio


@kernel
def run_bank(
    rates_unexplained_by_past,
    group_responses,
    is_usable,
    bank,
    state_model,
    noise_parameters,
    min_noise_variance_scales,
    quick_variance_scales,
):
    """Posterior probabilities (n, H), mean trim and gains (n, N), noise scale (n,) and sample_log_likelihoods
    (n,): the log likelihood of a sample given all before it, times effective_sample_share.

    Shapes: rates_unexplained_by_past (n, 3); group_responses (n, G, 3) while healthy; is_usable (n,) the
    sample may be used. bank: HypothesisBank, state_model: TrimAndGainStateModel, noise_parameters:
    ResidualNoise (bank.py); min_noise_variance_scales (n,): lower bound of the scale of the noise;
    quick_variance_scales (n,): by `quick_response_variance_scale`.
    """
    n_samples = len(rates_unexplained_by_past)
    n_hypotheses = len(bank.transition_share)
    n_states = len(state_model.initial_mean)
    no_response_hypothesis_index = n_hypotheses - 1
    hypothesis_probabilities = bank.prior_probability.copy()
    state_means = np.zeros((n_hypotheses, n_states))
    state_covariances = np.zeros((n_hypotheses, n_states, n_states))
    state_means[:] = state_model.initial_mean
    state_covariances[:] = state_model.initial_covariance
    posterior = np.zeros((n_samples, n_hypotheses))
    mean_states = np.zeros((n_samples, n_states))
    noise_variance_scales = np.zeros(n_samples)
    sample_log_likelihoods = np.zeros(n_samples)
    noise_variance_scale = 1.0
    for k in range(n_samples):
        prior_probabilities = _mix_hypotheses(
            hypothesis_probabilities, state_means, state_covariances, bank, state_model.random_walk_variance
        )
        _relax_to_model(state_means, state_covariances, state_model)
        state_means[no_response_hypothesis_index], state_covariances[no_response_hypothesis_index] = (
            state_model.initial_mean,
            state_model.initial_covariance,
        )  # while nothing answers, nothing is learnt
        if is_usable[k]:
            hypothesis_probabilities, mean_clipped_squared_residual, sample_log_likelihoods[k] = (
                _correct_hypotheses(
                    prior_probabilities,
                    state_means,
                    state_covariances,
                    rates_unexplained_by_past[k],
                    group_responses[k],
                    bank,
                    noise_parameters,
                    quick_variance_scales[k] * max(noise_variance_scale, min_noise_variance_scales[k]),
                )
            )
            _limit_states(
                state_means,
                state_model.initial_mean - state_model.max_deviation,
                state_model.initial_mean + state_model.max_deviation,
            )
            noise_variance_scale *= np.exp(
                (1.0 - hypothesis_probabilities[no_response_hypothesis_index])
                * (mean_clipped_squared_residual / 3.0 - _MEAN_CLIPPED_SQUARED_RESIDUAL_PER_AXIS)
                / noise_parameters.scale_memory_samples
            )
            noise_variance_scale = min(
                max(noise_variance_scale, noise_parameters.min_variance_scale),
                noise_parameters.max_variance_scale,
            )
        else:
            hypothesis_probabilities = prior_probabilities
        posterior[k] = hypothesis_probabilities
        noise_variance_scales[k] = noise_variance_scale
        for h in range(n_hypotheses):
            mean_states[k] += hypothesis_probabilities[h] * state_means[h]
    return posterior, mean_states, noise_variance_scales, sample_log_likelihoods


@kernel
def _mix_hypotheses(hypothesis_probabilities, state_means, state_covariances, bank, random_walk_variance):
    """Interaction of the hypotheses: each may change to any other. state_means (H, N) and state_covariances
    (H, N, N) are replaced. Returns the prior probabilities (H,)."""
    n_hypotheses, n_states = state_means.shape
    stay_probability = 1.0 - bank.change_probability_per_sample
    mixed_mean = np.zeros(n_states)
    mixed_covariance = np.zeros((n_states, n_states))
    for h in range(n_hypotheses):
        mixed_mean += hypothesis_probabilities[h] * state_means[h]
    for h in range(n_hypotheses):
        for i in range(n_states):
            for j in range(n_states):
                mixed_covariance[i, j] += hypothesis_probabilities[h] * (
                    state_covariances[h, i, j]
                    + (state_means[h, i] - mixed_mean[i]) * (state_means[h, j] - mixed_mean[j])
                )
    prior_probabilities = np.empty(n_hypotheses)
    prior_probability_sum = 0.0
    for h in range(n_hypotheses):
        prior_probabilities[h] = (
            stay_probability * hypothesis_probabilities[h]
            + bank.change_probability_per_sample * bank.transition_share[h]
        )
        prior_probability_sum += prior_probabilities[h]
        _merge_gaussians_and_add_variances(
            stay_probability * hypothesis_probabilities[h] / prior_probabilities[h],
            state_means[h],
            state_covariances[h],
            mixed_mean,
            mixed_covariance,
            bank.rate_offset_variance[h],
            random_walk_variance,
        )
    return prior_probabilities / prior_probability_sum


@kernel
def _merge_gaussians_and_add_variances(
    own_weight,
    state_mean,
    state_covariance,
    mixed_mean,
    mixed_covariance,
    rate_offset_variance,
    random_walk_variance,
):
    """Replace two Gaussians by one with the same moments: that of the hypothesis, with weight `own_weight`,
    and the mixture of all hypotheses, with the rest of the weight.

    state_mean (N,) and state_covariance (N, N) are replaced. The mixture gets the variance of the offset of
    the rates, rate_offset_variance (3,), that comes with a change to this hypothesis.
    """
    other_weight, n_states = 1.0 - own_weight, len(state_mean)
    for i in range(n_states):
        for j in range(n_states):
            deviation_product = (state_mean[i] - mixed_mean[i]) * (state_mean[j] - mixed_mean[j])
            state_covariance[i, j] = (
                own_weight * state_covariance[i, j]
                + other_weight * mixed_covariance[i, j]
                + own_weight * other_weight * deviation_product
            )
        state_covariance[i, i] += random_walk_variance[i]
    for i in range(n_states):
        state_mean[i] = own_weight * state_mean[i] + other_weight * mixed_mean[i]
    for i in range(len(rate_offset_variance)):
        state_covariance[i, i] += other_weight * rate_offset_variance[i]


@kernel
def _relax_to_model(state_means, state_covariances, state_model):
    """Move all trims and gains towards those of the model, by one sample. state_means (H, N) and
    state_covariances (H, N, N) are replaced."""
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
    rates_unexplained_by_past,
    group_responses,
    bank,
    noise_parameters,
    noise_variance_scale,
):
    """Kalman correction of every hypothesis by one sample; state_means and state_covariances are replaced.

    Returns the posterior probabilities (H,), the clipped squared residual averaged over them (in the
    covariance without its inflation), and the log likelihood of the sample.
    """
    n_hypotheses, n_states = state_means.shape
    log_likelihoods = np.empty(n_hypotheses)
    squared_residuals = np.empty(n_hypotheses)
    zero_state_mean, zero_state_covariance = np.zeros(n_states), np.zeros((n_states, n_states))
    noise_covariance = noise_parameters.covariance * noise_variance_scale
    t_degrees_of_freedom = noise_parameters.t_degrees_of_freedom
    for h in range(n_hypotheses):
        rate_sensitivity_by_state = _rate_sensitivity_by_state(
            bank.effectiveness[h],
            bank.response_share_scaled_by_group_gain[h],
            group_responses,
            noise_parameters.intercept_rad_s,
            n_states,
        )
        if h == n_hypotheses - 1:
            squared_residuals[h], log_determinant = _update_gaussian(
                zero_state_mean,
                zero_state_covariance,
                rates_unexplained_by_past,
                rate_sensitivity_by_state,
                noise_covariance,
                noise_parameters,
            )
        else:
            squared_residuals[h], log_determinant = _update_gaussian(
                state_means[h],
                state_covariances[h],
                rates_unexplained_by_past,
                rate_sensitivity_by_state,
                noise_covariance,
                noise_parameters,
            )
        squared_residual_for_log_likelihood = min(squared_residuals[h], noise_parameters.max_squared_residual)
        log_likelihoods[h] = noise_parameters.effective_sample_share * (
            -0.5
            * (t_degrees_of_freedom + 3.0)
            * np.log(1.0 + squared_residual_for_log_likelihood / t_degrees_of_freedom)
            - 0.5 * log_determinant
        )
    max_hypothesis_log_likelihood = log_likelihoods.max()
    hypothesis_probabilities = np.maximum(
        prior_probabilities * np.exp(log_likelihoods - max_hypothesis_log_likelihood),
        _MIN_HYPOTHESIS_PROBABILITY,
    )
    probability_sum = hypothesis_probabilities.sum()
    hypothesis_probabilities /= probability_sum
    mean_clipped_squared_residual = 0.0
    for h in range(n_hypotheses):
        mean_clipped_squared_residual += hypothesis_probabilities[h] * min(
            noise_parameters.covariance_inflation * squared_residuals[h],
            3.0 * _SQUARED_RESIDUAL_CLIP_PER_AXIS,
        )
    return (
        hypothesis_probabilities,
        mean_clipped_squared_residual,
        max_hypothesis_log_likelihood + np.log(probability_sum),
    )


@kernel
def _rate_sensitivity_by_state(
    effectiveness, response_share_scaled_by_group_gain, group_responses, intercept_rad_s, n_states
):
    """Sensitivity of the unexplained rates to the states, (N, 3): to the trim; to the common gain, which
    multiplies the intercept and all group_responses (G, 3) times effectiveness (G,); and to each group's own
    gain, which multiplies the share response_share_scaled_by_group_gain (G,) of its response."""
    rate_sensitivity_by_state = np.zeros((n_states, 3))
    rate_sensitivity_by_state[:3] = np.eye(3)
    rate_sensitivity_by_state[3] = intercept_rad_s
    for g in range(len(effectiveness)):
        rate_sensitivity_by_state[4 + g] = response_share_scaled_by_group_gain[g] * group_responses[g]
        rate_sensitivity_by_state[3] += effectiveness[g] * group_responses[g]
    return rate_sensitivity_by_state


@kernel
def _limit_states(state_means, min_state, max_state):
    """Limit trim and gains of every hypothesis, so that they do not adapt to a fault."""
    for h in range(len(state_means)):
        state_means[h] = np.minimum(np.maximum(state_means[h], min_state), max_state)


@kernel
def _update_gaussian(
    state_mean,
    state_covariance,
    rates_unexplained_by_past,
    rate_sensitivity_by_state,
    noise_covariance,
    noise_parameters,
):
    """Correct one Gaussian (state_mean (N,), state_covariance (N, N), replaced) by
    rates_unexplained_by_past (3,) = rate_sensitivity_by_state' state_mean + noise, with
    rate_sensitivity_by_state (N, 3).

    Returns the squared residual, normalised by its covariance, and the log determinant of that covariance.
    The gain is reduced for a residual in the tail of the t distribution, and 0 above max_squared_residual.
    """
    n_states, t_degrees_of_freedom = len(state_mean), noise_parameters.t_degrees_of_freedom
    cross_covariance = np.zeros((n_states, 3))
    residual_covariance = noise_covariance.copy()
    residual = rates_unexplained_by_past.copy()
    for i in range(n_states):
        for j in range(3):
            residual[j] -= state_mean[i] * rate_sensitivity_by_state[i, j]
            for k in range(n_states):
                cross_covariance[i, j] += state_covariance[i, k] * rate_sensitivity_by_state[k, j]
    for i in range(n_states):
        for j in range(3):
            for k in range(3):
                residual_covariance[j, k] += rate_sensitivity_by_state[i, j] * cross_covariance[i, k]
    inverse_residual_covariance, determinant = _invert_symmetric(residual_covariance)
    kalman_gain = np.zeros((n_states, 3))
    squared_residual = 0.0
    for j in range(3):
        for k in range(3):
            squared_residual += residual[j] * inverse_residual_covariance[j, k] * residual[k]
            for i in range(n_states):
                kalman_gain[i, j] += cross_covariance[i, k] * inverse_residual_covariance[k, j]
    kalman_gain *= (
        min(1.0, (t_degrees_of_freedom + 3.0) / (t_degrees_of_freedom + squared_residual))
        if squared_residual < noise_parameters.max_squared_residual
        else 0.0
    )
    for j in range(3):
        for i in range(n_states):
            state_mean[i] += kalman_gain[i, j] * residual[j]
            # symmetric by construction: an asymmetry from rounding would grow without bound
            for k in range(i + 1):
                state_covariance[i, k] -= kalman_gain[i, j] * cross_covariance[k, j]
                state_covariance[k, i] = state_covariance[i, k]
    return squared_residual, np.log(determinant)


@kernel
def _invert_symmetric(matrix):
    """Inverse and determinant of a symmetric (3, 3) matrix, by its cofactors."""
    adjugate = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            next_row, previous_row = (i + 1) % 3, (i + 2) % 3
            next_column, previous_column = (j + 1) % 3, (j + 2) % 3
            adjugate[j, i] = (
                matrix[next_row, next_column] * matrix[previous_row, previous_column]
                - matrix[next_row, previous_column] * matrix[previous_row, next_column]
            )
    determinant = (
        matrix[0, 0] * adjugate[0, 0] + matrix[0, 1] * adjugate[1, 0] + matrix[0, 2] * adjugate[2, 0]
    )
    return adjugate / determinant, determinant
