"""The inputs of the bank of filters: its hypotheses, how a flight may differ from the model, the noise.

The hypotheses: all healthy; one group of surfaces at a level of effectiveness; two groups at once; an unknown
offset of the rates; nothing answers the commands. Their prior probabilities follow from the model's settings:
the levels in labelled flights, and the rate of changes.

Trim, common gain and each group's own gain may differ from the model. They start from it and are bounded, so
that the filter does not adapt to a fault that is there from the start. The trim differs as another loading or
rigging would change it (a shift of each group's command), and it drifts. Gains return to those of the model
in time, since the airspeed varies about that of the fitted flights. If the standard error of a group's gain
is larger than a step between levels, the excess is added to the variance of its own gain.
"""

from collections.abc import Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.trust import is_group_effect_known

HEALTHY, GROUP_LOSS, PAIR_LOSS, UNKNOWN_OFFSET, NO_RESPONSE = range(5)
_PAIR_LOSS_TRANSITION_SHARE = 0.02
_UNKNOWN_OFFSET_TRANSITION_SHARE = 0.05
_NO_RESPONSE_TRANSITION_SHARE = 0.02
_PAIR_EFFECTIVENESS_LEVELS = (0.25, 0.5, 0.75)
_PRIOR_ALL_HEALTHY_PROBABILITY, _PRIOR_NO_RESPONSE_PROBABILITY = 0.7, 0.2
_MIN_NOISE_VARIANCE_SCALE, _MAX_NOISE_VARIANCE_SCALE = 0.3, 6.0
_MAX_INFORMATIVE_SQUARED_RESIDUAL = 30.0
"""For a whitened flight: the predictor needs a fraction of a second to adapt to a fault."""


HypothesisRow = tuple[
    Floats, int, float, Floats
]  # effectiveness of each group, kind, transition share, variance of the rate offset


class HypothesisBank(NamedTuple):
    """H hypotheses of G groups; the first is healthy, the last that nothing answers the commands.

    effectiveness (H, G). hypothesis_kind (H,). transition_share (H,): share of all changes of hypothesis that
    lead to this one. rate_offset_variance (H, 3): variance of the offset of the rates that comes with it,
    (rad/s)2. prior_probability (H,): probability before the flight. change_probability_per_sample:
    probability that the hypothesis changes within a sample. response_share_scaled_by_group_gain (H, G): share
    of a group's healthy response that the group's own gain multiplies: the effectiveness, or 1 where the
    response of a control law to noise adds to the effect of a surface.
    """

    effectiveness: Floats
    hypothesis_kind: np.ndarray
    transition_share: Floats
    rate_offset_variance: Floats
    prior_probability: Floats
    change_probability_per_sample: float
    response_share_scaled_by_group_gain: Floats

    @property
    def no_response_hypothesis_index(self) -> int:
        """Index of the hypothesis that nothing answers the commands: on the ground, or everything lost."""
        return len(self.hypothesis_kind) - 1

    @property
    def is_fault_hypothesis(self) -> np.ndarray:
        """Which hypotheses say that some surface has lost effectiveness, (H,)."""
        return np.asarray((self.hypothesis_kind == GROUP_LOSS) | (self.hypothesis_kind == PAIR_LOSS))

    def is_fault_of_group(self, group_index: int) -> np.ndarray:
        """Which hypotheses say that a group has lost effectiveness, (H,)."""
        return np.asarray((self.effectiveness[:, group_index] < 1.0) & (self.hypothesis_kind != NO_RESPONSE))


def build_hypothesis_bank(model: Model) -> HypothesisBank:
    """The hypotheses of a model. A group whose effect is unknown has none, unless all effects are unknown."""
    n_groups, settings = len(model.groups), model.settings
    group_has_known_effect = is_group_effect_known(model)
    indices_of_groups_with_hypotheses = [
        group_index
        for group_index in range(n_groups)
        if group_has_known_effect[group_index] or not any(group_has_known_effect)
    ]
    hypothesis_rows: list[HypothesisRow] = [(np.ones(n_groups), HEALTHY, settings.repair_share, np.zeros(3))]
    n_surfaces_with_hypotheses = sum(
        len(model.groups[group_index]) for group_index in indices_of_groups_with_hypotheses
    )
    may_surfaces_be_stuck = "stuck" in model.vehicle.faults
    has_pair_hypotheses = len(indices_of_groups_with_hypotheses) > 1
    single_fault_share_before_normalization = (
        1.0
        - (_PAIR_LOSS_TRANSITION_SHARE if has_pair_hypotheses else 0.0)
        - (_UNKNOWN_OFFSET_TRANSITION_SHARE if may_surfaces_be_stuck else 0.0)
    )
    for group_index in indices_of_groups_with_hypotheses:
        levels, level_shares = _effectiveness_levels_and_prior_shares(model, group_index)
        group_transition_share_per_fault_kind = (
            single_fault_share_before_normalization
            * len(model.groups[group_index])
            / n_surfaces_with_hypotheses
            / len(model.vehicle.faults)
        )
        for rate_offset_variance in _rate_offset_variance_per_fault_kind(model, group_index):
            for level, level_share in zip(levels, level_shares, strict=True):
                hypothesis_rows.append(
                    (
                        _group_effectiveness_row(n_groups, {group_index: level}),
                        GROUP_LOSS,
                        group_transition_share_per_fault_kind * level_share,
                        rate_offset_variance,
                    )
                )
    hypothesis_rows += _pair_hypotheses(n_groups, indices_of_groups_with_hypotheses)
    if may_surfaces_be_stuck:
        unknown_offset_variance = (
            np.diag(np.array(model.residual_covariance)) * settings.jam_rate_offset_sd**2
        )
        hypothesis_rows.append(
            (np.ones(n_groups), UNKNOWN_OFFSET, _UNKNOWN_OFFSET_TRANSITION_SHARE, unknown_offset_variance)
        )
    hypothesis_rows.append((np.zeros(n_groups), NO_RESPONSE, _NO_RESPONSE_TRANSITION_SHARE, np.zeros(3)))
    effectiveness, hypothesis_kind, transition_share, rate_offset_variance = (
        np.array(values_of_one_field) for values_of_one_field in zip(*hypothesis_rows, strict=True)
    )
    transition_share[1:] *= (1.0 - settings.repair_share) / transition_share[1:].sum()
    change_probability_per_sample = settings.effectiveness_changes_per_hour / (3600.0 * model.rate_hz)
    response_share_scaled_by_group_gain = (
        np.ones_like(effectiveness) if model.vehicle.other_laws else effectiveness
    )
    return HypothesisBank(
        effectiveness,
        hypothesis_kind,
        transition_share,
        rate_offset_variance,
        _prior_probabilities(hypothesis_kind, transition_share),
        change_probability_per_sample,
        response_share_scaled_by_group_gain,
    )


def _group_effectiveness_row(n_groups: int, level_by_group_index: dict[int, float]) -> Floats:
    effectiveness = np.ones(n_groups)
    for group_index, level in level_by_group_index.items():
        effectiveness[group_index] = level
    return effectiveness


def _effectiveness_levels_and_prior_shares(model: Model, group_index: int) -> tuple[Floats, Floats]:
    """Levels of effectiveness below 1, and the share of each among the group's faults."""
    settings = model.settings
    labelled_levels = settings.likely_effectiveness_levels_by_group.get(
        "+".join(model.groups[group_index]), []
    )
    grid_levels = np.arange(
        0.0, 1.0 - 0.5 * settings.effectiveness_level_step, settings.effectiveness_level_step
    )
    levels = np.unique(np.round(np.concatenate([grid_levels, np.array(labelled_levels, dtype=float)]), 6))
    is_labelled_level = np.isin(levels, np.round(labelled_levels, 6))
    if not is_labelled_level.any() or is_labelled_level.all():
        return levels, np.full(len(levels), 1.0 / len(levels))
    fault_share_at_labelled_levels = settings.share_of_faults_at_likely_levels
    return levels, np.where(
        is_labelled_level,
        fault_share_at_labelled_levels / is_labelled_level.sum(),
        (1.0 - fault_share_at_labelled_levels) / (~is_labelled_level).sum(),
    )


def _rate_offset_variance_per_fault_kind(model: Model, group_index: int) -> list[Floats]:
    """Variances of the rates' offset that may come with a loss, (3,) each: none, or that of the group stuck
    anywhere within its travel, along the axes it moves most."""
    _, _, response_coefficients, residual_covariance = model.intercept_past_response_noise()
    summed_response_in_residual_sd = np.abs(response_coefficients[group_index]).sum(axis=0) / np.sqrt(
        np.diag(residual_covariance)
    )
    relative_axis_response = np.clip(
        summed_response_in_residual_sd / max(summed_response_in_residual_sd.max(), MIN_DIVISOR), 0.3, 1.0
    )
    rate_offset_variance_by_fault_kind = {
        "loss": np.zeros(3),
        "stuck": np.diag(residual_covariance)
        * (model.settings.jam_rate_offset_sd * relative_axis_response) ** 2,
    }
    return [rate_offset_variance_by_fault_kind[kind] for kind in model.vehicle.faults]


def _pair_hypotheses(n_groups: int, indices_of_groups_with_hypotheses: list[int]) -> list[HypothesisRow]:
    """Two of the known groups at once, on a coarse grid."""
    group_pairs_with_level_pairs = list(
        product(
            combinations(indices_of_groups_with_hypotheses, 2), product(_PAIR_EFFECTIVENESS_LEVELS, repeat=2)
        )
    )
    return [
        (
            _group_effectiveness_row(n_groups, dict(zip(group_pair, level_pair, strict=True))),
            PAIR_LOSS,
            _PAIR_LOSS_TRANSITION_SHARE / len(group_pairs_with_level_pairs),
            np.zeros(3),
        )
        for group_pair, level_pair in group_pairs_with_level_pairs
    ]


def _prior_probabilities(hypothesis_kind: np.ndarray, transition_share: Floats) -> Floats:
    """Probability of each hypothesis before the flight, (H,): mostly healthy, any fault allowed."""
    is_fault_or_unknown_offset = (hypothesis_kind != HEALTHY) & (hypothesis_kind != NO_RESPONSE)
    prior_probability = (
        transition_share
        * (1.0 - _PRIOR_ALL_HEALTHY_PROBABILITY - _PRIOR_NO_RESPONSE_PROBABILITY)
        / transition_share[is_fault_or_unknown_offset].sum()
    )
    prior_probability[0] = _PRIOR_ALL_HEALTHY_PROBABILITY
    prior_probability[-1] = _PRIOR_NO_RESPONSE_PROBABILITY
    return np.asarray(prior_probability)


class TrimAndGainStateModel(NamedTuple):
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


def build_trim_and_gain_state_model(
    model: Model, noise_ma_coefficients: Sequence[float] = ()
) -> TrimAndGainStateModel:
    """The prior and the limits of trim and gains, from a model's settings. noise_ma_coefficients: as in
    `build_residual_noise`."""
    settings, n_groups = model.settings, len(model.groups)
    _, _, response_coefficients, residual_covariance = model.intercept_past_response_noise()
    residual_variance = np.diag(residual_covariance)
    trim_sd_of_group_shift_rad_s = response_coefficients.sum(axis=1) * settings.trim_command_shift_sd
    initial_covariance = np.zeros((4 + n_groups, 4 + n_groups))
    initial_covariance[:3, :3] = (
        np.diag(residual_variance * settings.trim_sd**2)
        + trim_sd_of_group_shift_rad_s.T @ trim_sd_of_group_shift_rad_s
    )
    initial_covariance[3, 3] = settings.gain_sd**2
    drifting_variance = settings.group_gain_offset_sd**2 + _gain_variance_beyond_level_step(model)
    hidden_variance = model.hidden_gain_error_sd(noise_ma_coefficients) ** 2
    initial_covariance[range(4, 4 + n_groups), range(4, 4 + n_groups)] = drifting_variance + hidden_variance
    # What the fit misreads stays the same in a flight: the larger spread adds nothing to the drift.
    group_return_times_s = settings.group_gain_offset_return_time_s * (
        1.0 + hidden_variance / np.maximum(drifting_variance, MIN_DIVISOR)
    )
    return_times_s = np.array([np.inf] * 3 + [settings.gain_return_time_s, *group_return_times_s])
    deviation_retention = np.exp(-1.0 / (model.rate_hz * return_times_s))
    random_walk_variance = (1.0 - deviation_retention**2) * np.diag(initial_covariance)
    random_walk_variance[:3] = residual_variance * np.array(settings.trim_walk_sd_per_sample) ** 2
    max_deviation_in_sd = np.array(
        [settings.max_trim_deviation_in_sd] * 3 + [settings.max_gain_deviation_in_sd] * (1 + n_groups)
    )
    initial_mean = np.array([0.0, 0.0, 0.0, 1.0] + [0.0] * n_groups)
    return TrimAndGainStateModel(
        initial_mean,
        initial_covariance,
        np.sqrt(np.diag(initial_covariance)) * max_deviation_in_sd,
        deviation_retention,
        random_walk_variance,
    )


def _gain_variance_beyond_level_step(model: Model) -> Floats:
    """Variance of each group's gain by which it is known worse than to a step between levels, (G,)."""
    gain_estimation_error_variance = np.zeros(len(model.groups))
    if model.fitted_ranges is not None and model.fitted_ranges.group_gain_standard_error:
        gain_estimation_error_variance += np.array(model.fitted_ranges.group_gain_standard_error) ** 2
    return np.maximum(gain_estimation_error_variance - model.settings.effectiveness_level_step**2, 0.0)


class ResidualNoise(NamedTuple):
    """The noise of the one-step residual.

    intercept_rad_s (3,): intercept of the model. covariance (3, 3) of a sample, (rad/s)2.
    effective_sample_share: information of a residual over that of a white one. t_degrees_of_freedom of its t
    distribution. scale_memory_samples, min_variance_scale, max_variance_scale: memory and limits of the
    running scale of the covariance. max_squared_residual: squared standardised residual above which a sample
    carries no information. covariance_inflation: covariance over that of the residuals in the fit.
    """

    intercept_rad_s: Floats
    covariance: Floats
    effective_sample_share: float
    t_degrees_of_freedom: float
    scale_memory_samples: float
    min_variance_scale: float
    max_variance_scale: float
    max_squared_residual: float
    covariance_inflation: float


def build_residual_noise(model: Model, noise_ma_coefficients: Sequence[float] = ()) -> ResidualNoise:
    """The noise of a flight, from a model's settings. noise_ma_coefficients: the moving average by which the
    flight is whitened, empty if it is not."""
    settings = model.settings
    max_squared_residual = (
        _MAX_INFORMATIVE_SQUARED_RESIDUAL
        if len(model.residual_ar_coefficients(noise_ma_coefficients))
        else np.inf
    )
    scale_memory_samples = settings.noise_scale_memory_s * model.rate_hz
    return ResidualNoise(
        model.whitened_intercept(noise_ma_coefficients), model.intercept_past_response_noise()[3],
        settings.effective_sample_share, settings.t_degrees_of_freedom, scale_memory_samples,
        _MIN_NOISE_VARIANCE_SCALE, _MAX_NOISE_VARIANCE_SCALE, max_squared_residual,
        model.covariance_inflation_of_noise_model(noise_ma_coefficients),
    )  # fmt: skip
