"""Filter a recorded flight with a model: what broke, by how much, and how sure that is, sample by sample.

Everything a row says comes from samples up to its own time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, trust
from beaver_ftc_logs.bank import GROUP_LOSS, UNKNOWN_OFFSET, HypothesisBank, build_hypothesis_bank
from beaver_ftc_logs.filtering import (
    any_fault_log_odds_gains,
    hypothesis_state_and_noise_posterior,
    page_cusum,
)
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.regression import expand_group_values_to_surfaces, unexplained_rates_and_responses
from beaver_ftc_logs.samples import Samples

_LOG_RATE_TOLERANCE = 0.25
UNKNOWN_SURFACE = energy.UNKNOWN_SURFACE
_MIN_FAULT_PROBABILITY_SHARE_FOR_NAME = 0.5
_MAX_WRONG_EXCLUSION_PROBABILITY = 0.001
"""Chance of a name without the surface at fault: a likelihood ratio of two groups passes 1000 against the
true one with that chance at most (Markov's inequality), where the model is right."""
_RESIDUAL_DIRECTION_WINDOW_S = 1.0
_MIN_COMMAND_MOTION_TRAVEL_SHARE = 1e-6
"""Share of travel that a command moves by rounding alone."""
_MAX_NO_RESPONSE_PROBABILITY = 0.5
"""Probability that nothing answers the commands above which nothing is said of any surface."""


@dataclass(frozen=True)
class DiagnosisRows:
    """The diagnosis of a flight, one row for each sample.

    t_s (n,). faulty (n,): 0 or 1. isolated_surfaces (n,): names joined by +, empty without an alarm.
    effectiveness of each surface, its bounds effectiveness_low and effectiveness_high (n, S).
    fault_probability (n,) of any surface. credible (n,): 0 or 1, by default 1. evidence_start_time_s (n,):
    time at which the evidence for a fault began to increase, by default t_s. not_credible_rows_by_reason:
    for each reason the rows (n,) that are not credible.
    """

    t_s: Floats
    faulty: NDArray[np.int64]
    isolated_surfaces: NDArray[np.object_]
    effectiveness: Floats
    effectiveness_low: Floats
    effectiveness_high: Floats
    fault_probability: Floats
    credible: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    evidence_start_time_s: Floats = field(default_factory=lambda: np.empty(0))
    not_credible_rows_by_reason: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.evidence_start_time_s) != len(self.t_s):
            object.__setattr__(self, "evidence_start_time_s", self.t_s)
        if len(self.credible) != len(self.t_s):
            object.__setattr__(self, "credible", np.ones(len(self.t_s), dtype=np.int64))

    def has_credible_alarm(self) -> bool:
        """Whether an alarm is raised in a credible row."""
        return bool(((self.faulty == 1) & (self.credible == 1)).any())

    def are_healthy_where_credible_in(self, other: "DiagnosisRows") -> bool:
        """Whether there is no alarm in these rows, and each credible row of `other`, of the same log with
        other columns, is credible here too."""
        return not self.has_credible_alarm() and bool((self.credible >= other.credible).all())

    def with_uninformative_estimate(self, is_removed: NDArray[np.bool_]) -> "DiagnosisRows":
        """The rows with effectiveness 1 and bounds 0 and 1 where is_removed (n,) or (n, S) is true."""
        is_removed_by_surface = is_removed if is_removed.ndim == 2 else is_removed[:, None]
        return replace(
            self,
            effectiveness=np.where(is_removed_by_surface, 1.0, self.effectiveness),
            effectiveness_low=np.where(is_removed_by_surface, 0.0, self.effectiveness_low),
            effectiveness_high=np.where(is_removed_by_surface, 1.0, self.effectiveness_high),
        )

    def without_alarm(self, is_removed: NDArray[np.bool_]) -> "DiagnosisRows":
        """The rows without alarm and name where is_removed (n,) is true."""
        return replace(
            self,
            faulty=np.where(is_removed, 0, self.faulty),
            isolated_surfaces=np.where(is_removed, "", self.isolated_surfaces),
            fault_probability=np.where(is_removed, 0.0, self.fault_probability),
        )

    def without_verdict(self, rows_by_reason: Mapping[str, NDArray[np.bool_]]) -> "DiagnosisRows":
        """The rows without alarm, name and bounds, and not credible, where one of the reasons, (n,) each, is
        true."""
        is_removed = np.zeros(len(self.t_s), dtype=bool)
        for has_reason in rows_by_reason.values():
            is_removed |= has_reason
        rows = self.with_uninformative_estimate(is_removed).without_alarm(is_removed)
        return replace(rows, credible=np.where(is_removed, 0, 1), not_credible_rows_by_reason=rows_by_reason)


def diagnose(samples: Samples, model: Model) -> DiagnosisRows:
    """The diagnosis of each sample. Raises BadInput where the log's rate, columns or units are not the
    model's."""
    check_log_fits_model(samples, model)
    rows = _diagnose_checked_log(samples, model)
    if rows.has_credible_alarm():
        for group in trust.groups_with_reversed_gain(samples, model):
            signs = [-1.0 if surface in group else 1.0 for surface in model.vehicle.surfaces]
            corrected_rows = _diagnose_checked_log(replace(samples, commands=samples.commands * signs), model)
            if corrected_rows.are_healthy_where_credible_in(rows):
                raise reversed_command_error(samples.name, "+".join(group), "in the flights of the model")
    return rows


def reversed_command_error(flight_name: str, surface_name: str, allowed_signs: str) -> BadInput:
    """The error for a log that raises an alarm, and none if the command of surface_name has the other
    sign."""
    return BadInput(
        f"{flight_name}: if the command of {surface_name} has the other sign, there is no alarm, allowed: "
        f"signs as {allowed_signs}; does `scale: -1` fit?"
    )


def _diagnose_checked_log(samples: Samples, model: Model) -> DiagnosisRows:
    bank = build_hypothesis_bank(model)
    samples_with_bad_rates_unknown = trust.with_rates_unknown_where_frozen_or_clipped(samples, model)
    posterior, _, _ = hypothesis_state_and_noise_posterior(samples_with_bad_rates_unknown, model, bank)
    has_no_response = posterior[:, bank.no_response_hypothesis_index] > _MAX_NO_RESPONSE_PROBABILITY
    rows = diagnosis_rows_from_posterior(samples, model, bank, posterior)
    if model.vehicle.other_laws and model.settings.alarm_threshold is not None and not model.noise_models:
        rows = _withdraw_contradicted_isolation(
            samples_with_bad_rates_unknown, model, rows, model.settings.alarm_threshold
        )
    return finalize_rows_at_log_stamps(samples, model, rows, has_no_response)


def finalize_rows_at_log_stamps(
    samples: Samples,
    model: Model,
    rows: DiagnosisRows,
    has_no_response: NDArray[np.bool_] | None = None,
) -> DiagnosisRows:
    """Rows at the log's own stamps, without a verdict where the model is not credible, and without bounds
    for a group whose effect is unknown. has_no_response (n,): where nothing answers the commands."""
    rows_by_reason = trust.rows_not_credible_by_reason(samples, model)
    if has_no_response is not None and has_no_response.any():
        rows_by_reason["nothing answers the commands: on the ground, or these are not what it follows"] = (
            has_no_response
        )
    if not any(trust.is_group_effect_known(model)):
        rows_by_reason["of no surface is the effect known from the flights fitted"] = np.ones(
            len(rows.t_s), dtype=bool
        )
    rows = _add_unknown_effect_surfaces_widening_bounds(
        samples, model, _withdraw_isolation_after_engine_failure(samples, model, rows)
    )
    group_gain_known_as_float = np.array(trust.is_group_gain_known(model), dtype=float)[None]
    is_surface_gain_unknown = np.broadcast_to(
        expand_group_values_to_surfaces(group_gain_known_as_float, model) == 0.0, rows.effectiveness_low.shape
    )
    return _rows_at_log_stamps(
        samples, rows.with_uninformative_estimate(is_surface_gain_unknown).without_verdict(rows_by_reason)
    )


def _add_unknown_effect_surfaces_widening_bounds(
    samples: Samples, model: Model, rows: DiagnosisRows
) -> DiagnosisRows:
    """Rows whose name also has each surface of unknown effect that may be at fault in place of the isolated
    one. If a name has several surfaces, the bounds hold whichever of them is at fault.

    A loss of effectiveness shows only while the command moves: a surface whose command has not moved so far
    is not added. If surfaces can be stuck, any is added.
    """
    surfaces = list(model.vehicle.surfaces)
    may_have_shown_fault = (
        np.maximum.accumulate(np.abs(samples.commands - samples.commands[:1]), axis=0)
        > _MIN_COMMAND_MOTION_TRAVEL_SHARE
    )
    may_have_shown_fault |= "stuck" in model.vehicle.faults
    surfaces_of_unknown_effect = trust.surfaces_of_unknown_effect(model)
    may_be_added = may_have_shown_fault & np.array(
        [surface in surfaces_of_unknown_effect for surface in surfaces]
    )
    names_by_row, effectiveness_high = rows.isolated_surfaces.copy(), rows.effectiveness_high.copy()
    for k in np.flatnonzero(rows.faulty == 1):
        named_surfaces = set(str(names_by_row[k]).split("+"))
        if not named_surfaces <= set(surfaces):
            continue
        is_in_extended_name = np.array(
            [surface in named_surfaces or bool(may_be_added[k, i]) for i, surface in enumerate(surfaces)]
        )
        names_by_row[k] = "+".join(compress(surfaces, is_in_extended_name))
        if is_in_extended_name.sum() > len(named_surfaces) or (
            model.settings.assumes_one_group_at_fault and not _are_in_one_group(named_surfaces, model)
        ):
            effectiveness_high[k, is_in_extended_name] = 1.0
    return replace(rows, isolated_surfaces=names_by_row, effectiveness_high=effectiveness_high)


def _are_in_one_group(isolated_surfaces: set[str], model: Model) -> bool:
    """Whether these surfaces belong to one group of the model, which has one effectiveness."""
    return any(isolated_surfaces <= set(group) for group in model.groups)


def _withdraw_isolation_after_engine_failure(
    samples: Samples, model: Model, rows: DiagnosisRows
) -> DiagnosisRows:
    """Rows in which no surface is named where an engine may have failed."""
    unpowered_energy_height_rate_mps = (
        model.fitted_ranges.unpowered_energy_height_rate_mps if model.fitted_ranges is not None else None
    )
    if unpowered_energy_height_rate_mps is None or samples.energy_height_rate_mps is None:
        return rows
    energy_height_rate_mps = samples.energy_height_rate_mps
    isolated_names = energy.withdraw_surfaces_where_engine_may_have_failed(
        rows.t_s,
        rows.faulty,
        rows.isolated_surfaces,
        energy_height_rate_mps,
        unpowered_energy_height_rate_mps,
        rows.evidence_start_time_s,
    )
    return replace(
        rows.with_uninformative_estimate(isolated_names != rows.isolated_surfaces),
        isolated_surfaces=isolated_names,
    )


def _withdraw_contradicted_isolation(
    samples: Samples, model: Model, rows: DiagnosisRows, min_log_likelihood_gain: float
) -> DiagnosisRows:
    """Rows with the name `unknown` where the residual of the last second lies along another group.

    A faulty surface, be it stuck, biased or oscillating, changes the rates along the direction in which it
    turns the aircraft when healthy. A name is withdrawn where the direction of another group explains the
    residual better by min_log_likelihood_gain, whatever the course of time along it. Not used in moving air,
    since gusts have directions too.
    """
    residual = standardized_healthy_residual(model, *unexplained_rates_and_responses(samples, model))
    _, _, response_coefficients, residual_covariance = model.intercept_past_response_noise()
    response_directions = np.linalg.solve(
        np.linalg.cholesky(residual_covariance), response_coefficients.sum(axis=1).T
    )
    direction_norms = np.linalg.norm(response_directions, axis=0)
    squared_projections = (residual @ (response_directions / np.maximum(direction_norms, MIN_DIVISOR))) ** 2
    cumulated_squared_projections = np.cumsum(squared_projections, axis=0)
    window_begin_rows = np.maximum(
        np.arange(len(cumulated_squared_projections)) - round(_RESIDUAL_DIRECTION_WINDOW_S * model.rate_hz), 0
    )
    log_likelihood_gain_by_group = (
        0.5
        * model.settings.effective_sample_share
        * (cumulated_squared_projections - cumulated_squared_projections[window_begin_rows])
    )
    max_log_likelihood_gain = log_likelihood_gain_by_group.max(axis=1)
    is_contradicted = np.zeros(len(residual), dtype=bool)
    for group_index, group in enumerate(model.groups):
        is_contradicted |= _rows_isolating_any(rows.isolated_surfaces, set(group)) & (
            max_log_likelihood_gain - log_likelihood_gain_by_group[:, group_index] > min_log_likelihood_gain
        )
    return replace(
        rows.with_uninformative_estimate(is_contradicted),
        isolated_surfaces=np.where(is_contradicted, UNKNOWN_SURFACE, rows.isolated_surfaces),
    )


def standardized_healthy_residual(
    model: Model,
    is_predictable: NDArray[np.bool_],
    rates_unexplained_by_past: Floats,
    group_responses: Floats,
) -> Floats:
    """Residual of a healthy vehicle by `unexplained_rates_and_responses`, in standard deviations of the
    noise, (n, 3); 0 where no sample can be predicted."""
    intercept, _, _, residual_covariance = model.intercept_past_response_noise()
    residual = np.where(
        is_predictable[:, None], rates_unexplained_by_past - intercept - group_responses.sum(axis=1), 0.0
    )
    return np.asarray(residual @ np.linalg.inv(np.linalg.cholesky(residual_covariance)).T)


def _rows_isolating_any(isolated_surfaces: NDArray[np.object_], surfaces: set[str]) -> NDArray[np.bool_]:
    """Which rows (n,) name at least one of these surfaces."""
    return np.array([bool(surfaces & set(name.split("+"))) for name in isolated_surfaces], dtype=bool)


def check_log_fits_model(samples: Samples, model: Model) -> None:
    """Raise BadInput where a log's rate is not the model's."""
    rate_hz = 1.0 / samples.dt_s
    if abs(rate_hz / model.rate_hz - 1.0) > _LOG_RATE_TOLERANCE:
        raise BadInput(
            f"{samples.name}: has samples at {rate_hz:.3g} Hz, allowed: within {_LOG_RATE_TOLERANCE:.0%} of "
            f"the {model.rate_hz:.3g} Hz the model was identified at"
        )
    trust.refuse_rates_in_other_unit(samples, model.fitted_ranges)
    trust.refuse_columns_not_as_identified(samples, model)


def diagnosis_rows_from_posterior(
    samples: Samples, model: Model, bank: HypothesisBank, posterior: Floats
) -> DiagnosisRows:
    """Return the rows that follow from the probabilities of the hypotheses (n, H)."""
    no_response_probability = posterior[:, bank.no_response_hypothesis_index]
    fault_probability = posterior[:, bank.is_fault_hypothesis].sum(axis=1)
    posterior_given_response = (
        posterior[:, : bank.no_response_hypothesis_index]
        / np.maximum(1.0 - no_response_probability, MIN_DIVISOR)[:, None]
    )
    is_health_or_no_response_likelier = posterior[:, 0] + no_response_probability > 0.5
    alarm_evidence_threshold = model.settings.alarm_threshold
    evidence_increments = any_fault_log_odds_gains(posterior, bank)
    fault_evidence = page_cusum(evidence_increments, alarm_evidence_threshold or np.inf)
    has_alarm_evidence = has_isolation_evidence = _has_held_long_enough(
        fault_probability >= model.settings.fault_probability_for_alarm, model
    )
    if alarm_evidence_threshold is not None:
        naming_evidence_threshold = (
            model.settings.isolation_to_alarm_evidence_ratio * alarm_evidence_threshold
        )
        has_alarm_evidence = (fault_evidence >= alarm_evidence_threshold) & ~is_health_or_no_response_likelier
        has_isolation_evidence = (
            page_cusum(evidence_increments, naming_evidence_threshold) >= naming_evidence_threshold
        ) & ~is_health_or_no_response_likelier
    faulty = _latch_until_healthy(has_alarm_evidence, is_health_or_no_response_likelier).astype(np.int64)
    evidence_start_rows = np.maximum.accumulate(
        np.where(fault_evidence <= 0.0, np.arange(len(fault_evidence)), 0)
    )
    estimate_and_bounds_by_group = [
        _group_effectiveness_and_bounds(bank, posterior_given_response, group_index, model)
        for group_index in range(len(model.groups))
    ]
    effectiveness, effectiveness_low, effectiveness_high = (
        np.column_stack(values_by_group)
        for values_by_group in zip(*estimate_and_bounds_by_group, strict=True)
    )
    has_no_response = no_response_probability > _MAX_NO_RESPONSE_PROBABILITY
    (
        effectiveness[has_no_response],
        effectiveness_low[has_no_response],
        effectiveness_high[has_no_response],
    ) = 1.0, 0.0, 1.0
    if model.vehicle.other_laws:  # health is not excluded before an alarm excludes it
        effectiveness_high[faulty == 0] = 1.0
    return DiagnosisRows(
        t_s=samples.t_s,
        faulty=faulty,
        isolated_surfaces=_surfaces_at_fault(
            model,
            bank,
            posterior,
            faulty,
            _latch_until_healthy(has_isolation_evidence, is_health_or_no_response_likelier),
        ),
        effectiveness=expand_group_values_to_surfaces(effectiveness, model),
        effectiveness_low=expand_group_values_to_surfaces(effectiveness_low, model),
        effectiveness_high=expand_group_values_to_surfaces(effectiveness_high, model),
        fault_probability=fault_probability,
        evidence_start_time_s=samples.t_s[evidence_start_rows],
    )


def _group_effectiveness_and_bounds(
    bank: HypothesisBank, posterior_given_response: Floats, group_index: int, model: Model
) -> tuple[Floats, ...]:
    """A group's effectiveness and its bounds, (n,) each.

    Of several surfaces that move together any may have lost all, or nothing.
    """
    levels, level_probability = _group_level_distribution(bank, posterior_given_response, group_index)
    if model.vehicle.other_laws:  # how rare faults are says nothing of a flight with one: all levels alike
        level_probability = (
            level_probability
            / _group_level_distribution(
                bank, bank.prior_probability[None, : bank.no_response_hypothesis_index], group_index
            )[1]
        )
        level_probability /= level_probability.sum(axis=1, keepdims=True)
    low, high = _credible_bounds(levels, level_probability, model.settings.credible_mass)
    if len(model.groups[group_index]) > 1:
        low, high = np.where(low < low.max(initial=0.0), 0.0, low), np.ones_like(high)
    return _median_level(levels, level_probability), low, high


def _has_held_long_enough(condition: NDArray[np.bool_], model: Model) -> NDArray[np.bool_]:
    """Return the rows at which a condition holds and has held for long enough, (n,)."""
    confirmation_samples = round(model.settings.alarm_confirmation_time_s * model.rate_hz)
    samples_since_false = np.arange(len(condition)) - np.maximum.accumulate(
        np.where(condition, -1, np.arange(len(condition)))
    )
    return np.asarray(condition & (samples_since_false > confirmation_samples))


def _latch_until_healthy(
    has_evidence: NDArray[np.bool_], is_health_or_no_response_likelier: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """An alarm once raised stands until health is the likelier again."""
    row_indices = np.arange(len(has_evidence))
    last_evidence_row = np.maximum.accumulate(np.where(has_evidence, row_indices, -1))
    last_healthy_row = np.maximum.accumulate(
        np.where(is_health_or_no_response_likelier & ~has_evidence, row_indices, -1)
    )
    return np.asarray((last_evidence_row >= 0) & (last_evidence_row > last_healthy_row))


def _group_level_distribution(
    bank: HypothesisBank, probability_given_response: Floats, group_index: int
) -> tuple[Floats, Floats]:
    """A group's levels, the last of them 1, and the probability of each, (L,) and (n, L)."""
    levels, level_index_of_hypothesis = np.unique(
        bank.effectiveness[: bank.no_response_hypothesis_index, group_index], return_inverse=True
    )
    level_probability = np.zeros((len(probability_given_response), len(levels)))
    for hypothesis_index, level_index in enumerate(level_index_of_hypothesis):
        level_probability[:, level_index] += probability_given_response[:, hypothesis_index]
    return levels, level_probability


def _median_level(levels: Floats, level_probability: Floats) -> Floats:
    """The level with half of the probability on either side: the least mean absolute error."""
    return np.asarray(levels[(np.cumsum(level_probability, axis=1) >= 0.5 - 1e-12).argmax(axis=1)])


def _credible_bounds(
    levels: Floats, level_probability: Floats, credible_mass: float
) -> tuple[Floats, Floats]:
    """The range of the fewest levels that hold a share of the probability, half a step wider each way."""
    order_by_probability = np.argsort(-level_probability, axis=1, kind="stable")
    ranked_probability = np.take_along_axis(level_probability, order_by_probability, axis=1)
    is_in_credible_set = np.cumsum(ranked_probability, axis=1) - ranked_probability < credible_mass
    credible_levels = np.where(is_in_credible_set, levels[order_by_probability], np.nan)
    low, high = np.nanmin(credible_levels, axis=1), np.nanmax(credible_levels, axis=1)
    level_edges = np.concatenate([[0.0], 0.5 * (levels[1:] + levels[:-1]), [1.0]])
    return level_edges[np.searchsorted(levels, low)], level_edges[np.searchsorted(levels, high) + 1]


def _surfaces_at_fault(
    model: Model,
    bank: HypothesisBank,
    posterior: Floats,
    faulty: NDArray[np.int64],
    has_isolation_evidence: NDArray[np.bool_],
) -> NDArray[np.object_]:
    """The surfaces of the groups that most of the fault's probability is on; `unknown` where it is split.

    has_isolation_evidence (n,): where the evidence is enough for a name. Where one group is at fault
    (`one_group`), each that may be instead is named with it; `unknown` where none that the bank has is left
    out.
    """
    fault_probability = np.maximum(posterior[:, bank.is_fault_hypothesis].sum(axis=1), MIN_DIVISOR)
    fault_share_columns_of_groups = [
        posterior[:, bank.is_fault_of_group(group_index)].sum(axis=1) / fault_probability
        for group_index in range(len(model.groups))
    ]
    fault_share_by_row_and_group = np.column_stack(fault_share_columns_of_groups)
    is_group_likely = (
        fault_share_by_row_and_group > _MIN_FAULT_PROBABILITY_SHARE_FOR_NAME
    ) & has_isolation_evidence[:, None]
    if model.settings.assumes_one_group_at_fault:
        is_any_single_group_loss = bank.hypothesis_kind == GROUP_LOSS
        group_loss_probability = np.column_stack(
            [
                posterior[:, bank.is_fault_of_group(group_index) & is_any_single_group_loss].sum(axis=1)
                for group_index in range(len(model.groups))
            ]
        )
        is_group_likely = (
            group_loss_probability
            > _MAX_WRONG_EXCLUSION_PROBABILITY * group_loss_probability.max(axis=1, keepdims=True)
        ) & has_isolation_evidence[:, None]
        has_group_loss_hypothesis = group_loss_probability.max(axis=0) > 0.0
        is_group_likely &= ~(
            is_group_likely[:, has_group_loss_hypothesis].all(axis=1) & (has_group_loss_hypothesis.sum() > 1)
        )[:, None]
    likely_names = join_flagged_names_by_row(is_group_likely, ["+".join(group) for group in model.groups])
    isolated_names = np.full(len(posterior), "", dtype=object)
    is_unknown_offset_likelier = (
        posterior[:, bank.hypothesis_kind == UNKNOWN_OFFSET].sum(axis=1) > fault_probability
    )
    hold_samples = round(model.settings.isolation_change_hold_s * model.rate_hz)
    new_name_unchanged_samples = 0
    for k in np.flatnonzero(faulty):
        new_name, previous_name = likely_names[k] or UNKNOWN_SURFACE, isolated_names[k - 1] if k else ""
        new_name_unchanged_samples = (
            new_name_unchanged_samples + 1
            if k and new_name == (likely_names[k - 1] or UNKNOWN_SURFACE)
            else 0
        )
        # an offset of no known cause, or a name that has not stood, while the alarm does: nothing new
        keeps_name = previous_name and (
            is_unknown_offset_likelier[k]
            or (
                previous_name != UNKNOWN_SURFACE
                and (
                    new_name_unchanged_samples < hold_samples
                    or _would_name_all_named_before(new_name, previous_name, model)
                )
            )
        )
        isolated_names[k] = previous_name if keeps_name else new_name
    return isolated_names


def _would_name_all_named_before(new_name: str, previous_name: str, model: Model) -> bool:
    """Whether a name holds all that one before it held: what was once excluded stays so (Ville's inequality
    bounds the chance of a wrong exclusion over all time)."""
    return model.settings.assumes_one_group_at_fault and (
        new_name == UNKNOWN_SURFACE or set(previous_name.split("+")) <= set(new_name.split("+"))
    )


def join_flagged_names_by_row(is_flagged: NDArray[np.bool_], names: Sequence[str]) -> NDArray[np.object_]:
    """The names that are flagged in is_flagged (n, K), joined by +, (n,) text."""
    return np.array(["+".join(compress(names, row)) for row in is_flagged], dtype=object)


def _rows_at_log_stamps(samples: Samples, rows: DiagnosisRows) -> DiagnosisRows:
    """The rows at the log's own stamps: each stamp has the last row up to it."""
    if len(samples.log_stamps_s) == len(rows.t_s) and np.array_equal(samples.log_stamps_s, rows.t_s):
        return rows
    last_rows = np.maximum(np.searchsorted(rows.t_s, samples.log_stamps_s, side="right") - 1, 0)
    field_names = [
        name
        for name in DiagnosisRows.__dataclass_fields__
        if name not in ("t_s", "not_credible_rows_by_reason")
    ]
    rows_by_reason = {
        reason: not_credible_rows[last_rows]
        for reason, not_credible_rows in rows.not_credible_rows_by_reason.items()
    }
    fields = {name: getattr(rows, name)[last_rows] for name in field_names}
    return DiagnosisRows(t_s=samples.log_stamps_s, not_credible_rows_by_reason=rows_by_reason, **fields)
