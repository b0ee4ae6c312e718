"""From rows to a verdict: what happened when, in this flight, and what it can and cannot separate.

What can be separated follows from the model, the mixer and how much the commands moved. Under a small loss of
effectiveness d of group g the rates of a sample shift by -d s F_g. Its information is F_g' R^-1 F_g a sample;
what trim, gain and the other groups could explain as well is taken off (the Schur complement). A loss shows
once d^2 / 2 times the information gathered passes the odds against it before.
"""

from itertools import combinations
from typing import Any

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import trust
from beaver_ftc_logs.bank import HypothesisBank, build_hypothesis_bank
from beaver_ftc_logs.diagnose import UNKNOWN_SURFACE, DiagnosisRows
from beaver_ftc_logs.energy import ENGINE
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.regression import unexplained_rates_and_responses
from beaver_ftc_logs.samples import Samples, constant_stretches

MAX_BRIEF_EVENT_S = 3.0
DETECTION_HORIZONS_S = (5.0, 20.0, 60.0)
_MIN_COSINE_OF_PROPORTIONAL_EFFECTS = 0.9
_MIN_CREDIBLE_ROW_SHARE = 0.1
"""Share of credible rows below which there is no verdict."""
_SURFACES_OF_ONE_GROUP_NOTE = (
    "{} get proportional commands while they are healthy: no fit of healthy flight tells their effects "
    "apart. A loss in any of them is named as all of them, and the effectiveness given is that of all "
    "together."
)


def verdict_document(samples: Samples, model: Model, rows: DiagnosisRows) -> Document:
    """The document of verdict.json."""
    isolability = isolability_document(samples, model)
    return {
        "flight": samples.name,
        "vehicle": model.vehicle.name,
        "duration_s": float(samples.t_s[-1] - samples.t_s[0]),
        "recorded_s": len(samples.t_s) * samples.dt_s,
        "gaps": int(samples.stretch_number[-1]),
        "rate_hz": 1.0 / samples.dt_s,
        "faulty": bool(rows.faulty.any()),
        "credible": trust.credibility_entry(rows.not_credible_rows_by_reason, rows.credible),
        "events": fault_events(rows, list(model.vehicle.surfaces)),
        "can_separate": [*trust.unknown_effect_sentences(model), *isolability_sentences(isolability)],
        "isolability": isolability,
        "settings": model.settings.model_dump(by_alias=True),
        "notes": list(samples.notes),
    }


def fault_events(rows: DiagnosisRows, surfaces: list[str]) -> list[Document]:
    """Each time with one name and one effectiveness: when, what, how much is left.

    What lasts less than MAX_BRIEF_EVENT_S between alarms is taken into the event before it; what stands alone
    is brief. This is hindsight, for the reader; the rows have none.
    """
    _, name_index_by_row = np.unique(rows.isolated_surfaces.astype(str), return_inverse=True)
    verdict_columns = np.column_stack(
        [name_index_by_row, rows.faulty, rows.faulty[:, None] * rows.effectiveness]
    )
    verdict_runs = _join_brief_and_alike_runs(rows, constant_stretches(verdict_columns))
    return [
        _fault_event_entry(rows, begin, end, surfaces) for begin, end in verdict_runs if rows.faulty[begin]
    ]


def _join_brief_and_alike_runs(
    rows: DiagnosisRows, constant_verdict_runs: list[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Runs with the brief ones taken into the alarm before them, a brief one without a name into the one
    after it, and alike neighbours made one."""
    joined_runs: list[tuple[int, int]] = []
    for begin, end in constant_verdict_runs:
        previous_run = joined_runs[-1] if joined_runs else (begin, begin)
        is_brief_or_continues_previous_run = (
            _is_brief(rows, begin, end)
            or _is_brief_and_unnamed(rows, *previous_run)
            or _have_same_surfaces_and_effectiveness(rows, previous_run[0], begin)
        )
        if (
            previous_run[0] < begin
            and rows.faulty[previous_run[0]]
            and rows.faulty[begin]
            and is_brief_or_continues_previous_run
        ):
            joined_runs[-1] = (previous_run[0], end)
        else:
            joined_runs.append((begin, end))
    return joined_runs


def _is_brief(rows: DiagnosisRows, begin: int, end: int) -> bool:
    return bool(rows.t_s[end - 1] - rows.t_s[begin] < MAX_BRIEF_EVENT_S)


def _is_brief_and_unnamed(rows: DiagnosisRows, begin: int, end: int) -> bool:
    return rows.isolated_surfaces[begin] == UNKNOWN_SURFACE and begin < end and _is_brief(rows, begin, end)


def _have_same_surfaces_and_effectiveness(rows: DiagnosisRows, first_row: int, second_row: int) -> bool:
    return rows.isolated_surfaces[first_row] == rows.isolated_surfaces[second_row] and bool(
        (rows.effectiveness[first_row] == rows.effectiveness[second_row]).all()
    )


def _fault_event_entry(rows: DiagnosisRows, begin: int, end: int, surfaces: list[str]) -> Document:
    """One event; name and effectiveness as they stood for most of it."""
    names, n_rows_of_name = np.unique(rows.isolated_surfaces[begin:end].astype(str), return_counts=True)
    main_name = str(names[n_rows_of_name.argmax()])
    reported_surfaces = surfaces if main_name in (UNKNOWN_SURFACE, ENGINE) else main_name.split("+")
    effectiveness_columns_by_key = {
        "estimate": rows.effectiveness,
        "low": rows.effectiveness_low,
        "high": rows.effectiveness_high,
    }
    effectiveness_medians_by_key = {
        key: np.median(effectiveness_column[begin:end], axis=0)
        for key, effectiveness_column in effectiveness_columns_by_key.items()
    }
    return {
        "from_s": float(rows.t_s[begin]),
        "to_s": float(rows.t_s[end - 1]),
        "brief": _is_brief(rows, begin, end),
        "named": main_name,
        "probability": float(rows.fault_probability[begin:end].max()),
        "effectiveness": {
            name: {key: float(median[i]) for key, median in effectiveness_medians_by_key.items()}
            for i, name in enumerate(surfaces)
            if name in reported_surfaces
        },
    }


def lasting_or_else_all_events(events: list[Document]) -> list[Document]:
    """The events that are not brief; all of them where every one is."""
    return [event for event in events if not event["brief"]] or events


def as_text(verdict: Document) -> str:
    """The verdict in lines for people."""
    shown_events, n_events = lasting_or_else_all_events(verdict["events"]), len(verdict["events"])
    summary_text = (
        f"{len(shown_events)} event{'s' if len(shown_events) > 1 else ''}"
        if shown_events
        else _no_event_text(verdict)
    )
    lines = [
        f"{verdict['flight']}: {summary_text} in {diagnosed_duration_text(verdict)}",
        *map(_event_text, shown_events),
    ]
    lines += credibility_text_lines(verdict)
    if n_brief := n_events - len(shown_events):
        lines.append(
            f"  and {n_brief} brief alarm{'s' if n_brief > 1 else ''} of under {MAX_BRIEF_EVENT_S:g} s"
        )
    lines += [f"  {sentence_or_note}" for sentence_or_note in (*verdict["can_separate"], *verdict["notes"])]
    for key, value in verdict.get("score", {}).items():
        lines.append(f"  {key}: {value:.3f}" if isinstance(value, float) else f"  {key}: {value}")
    return "\n".join(lines)


def _no_event_text(verdict: Document) -> str:
    """No event: because no fault shows, or because nothing can be said."""
    credible_share = verdict["credible"]["share"]
    if credible_share < _MIN_CREDIBLE_ROW_SHARE:
        return "no verdict"
    return "no fault shows" if credible_share >= 1.0 else "no fault shows where the model is credible,"


def credibility_text_lines(verdict: Document) -> list[str]:
    """Return lines on the parts of a flight without a statement, and the reasons."""
    credibility = verdict["credible"]
    if credibility["share"] >= 1.0:
        return []
    reason_lines = [
        f"  {reason['says']}: {reason['share']:.1%} of the rows" for reason in credibility["reasons"]
    ]
    return [
        f"  credible in {credibility['share']:.1%} of the rows; in the others nothing is said, because",
        *reason_lines,
    ]


def diagnosed_duration_text(verdict: Document) -> str:
    """How much flight was diagnosed, in words: a gap in the log is no flight."""
    if not (n_gaps := verdict["gaps"]):
        return f"{verdict['duration_s']:.0f} s"
    return f"{verdict['recorded_s']:.0f} s, {n_gaps} gap{'s' if n_gaps > 1 else ''} in the log left out"


def _event_text(event: Document) -> str:
    effectiveness_text = ", ".join(
        f"{name} {estimate_and_bounds['estimate']:.2f} "
        f"({estimate_and_bounds['low']:.2f} to {estimate_and_bounds['high']:.2f})"
        for name, estimate_and_bounds in event["effectiveness"].items()
    )
    brief_text = "  (brief)" if event["brief"] else ""
    return (
        f"  {event['from_s']:.1f} to {event['to_s']:.1f} s  {event['named']}  "
        f"effectiveness {effectiveness_text}{brief_text}"
    )


def isolability_document(samples: Samples, model: Model) -> dict[str, Any]:
    """Which faults this flight can separate and which not, and the smallest loss that would show by when."""
    bank = build_hypothesis_bank(model)
    standardized_group_responses = _standardized_group_responses(samples, model)
    return {
        "together": [
            {"surfaces": group, "says": _SURFACES_OF_ONE_GROUP_NOTE.format(", ".join(group))}
            for group in model.groups
            if len(group) > 1
        ],
        "groups": [
            {
                "surfaces": group,
                **_group_isolability_entry(
                    standardized_group_responses, group_index, model, bank, samples.dt_s
                ),
            }
            for group_index, group in enumerate(model.groups)
        ],
        "alike": _group_pair_cosine_entries(standardized_group_responses, model),
        "columns_held_s": {
            name: round(mean_age_s, 4) for name, mean_age_s in samples.mean_age_s_by_held_column.items()
        },
    }


def _standardized_group_responses(samples: Samples, model: Model) -> Floats:
    """Each group's share of the rates in standard deviations of the noise, (n, G, 3)."""
    is_predictable, _, group_responses = unexplained_rates_and_responses(samples, model)
    group_responses = group_responses[is_predictable]
    residual_covariance = np.array(model.residual_covariance)
    standardized_group_responses = np.linalg.solve(
        np.linalg.cholesky(residual_covariance), group_responses.reshape(-1, 3).T
    ).T
    return np.asarray(
        standardized_group_responses.reshape(group_responses.shape)
        * np.sqrt(model.settings.effective_sample_share)
    )


def _group_isolability_entry(
    standardized_group_responses: Floats, group_index: int, model: Model, bank: HypothesisBank, dt_s: float
) -> dict[str, Any]:
    """Information a second about one group's effectiveness, and the smallest loss seen within some times."""
    required_log_odds = _log_odds_needed_for_alarm(model, bank, group_index, dt_s)
    if not len(standardized_group_responses):
        return {
            "information_per_s": 0.0,
            "smallest_loss": _smallest_detectable_losses(0.0, required_log_odds),
        }
    information_per_s = float((standardized_group_responses[:, group_index] ** 2).sum(axis=1).mean()) / dt_s
    conditional_information_per_s = (
        _conditional_information_per_sample(standardized_group_responses, group_index) / dt_s
    )
    return {
        "information_per_s": information_per_s,
        "information_per_s_of_its_motion": conditional_information_per_s,
        "smallest_loss": _smallest_detectable_losses(information_per_s, required_log_odds),
        "smallest_loss_by_motion_alone": _smallest_detectable_losses(
            conditional_information_per_s, required_log_odds
        ),
    }


def _conditional_information_per_sample(standardized_group_responses: Floats, group_index: int) -> float:
    """Information a sample about one group that trim (a constant an axis) and other groups cannot explain."""
    n_samples, n_groups, n_axes = standardized_group_responses.shape
    trim_regressors = np.tile(np.eye(n_axes), (n_samples, 1))
    other_group_responses = [
        standardized_group_responses[:, other_group_index].reshape(-1, 1)
        for other_group_index in range(n_groups)
        if other_group_index != group_index
    ]
    nuisance_regressors = np.column_stack([trim_regressors, *other_group_responses])
    group_response = standardized_group_responses[:, group_index].reshape(-1)
    unexplained_group_response = (
        group_response
        - nuisance_regressors @ np.linalg.lstsq(nuisance_regressors, group_response, rcond=None)[0]
    )
    return float(unexplained_group_response @ unexplained_group_response) / n_samples


def _log_odds_needed_for_alarm(model: Model, bank: HypothesisBank, group_index: int, dt_s: float) -> float:
    """Log odds that a change to one level of this group overcomes to raise the alarm; inf where none can."""
    settings = model.settings
    transition_shares_of_group = bank.transition_share[bank.is_fault_of_group(group_index)]
    if not len(transition_shares_of_group):
        return float("inf")
    level_transition_probability_per_sample = (
        settings.effectiveness_changes_per_hour * dt_s / 3600.0 * float(np.median(transition_shares_of_group))
    )
    return float(
        np.log(settings.fault_probability_for_alarm / (1.0 - settings.fault_probability_for_alarm))
        - np.log(level_transition_probability_per_sample)
    )


def _smallest_detectable_losses(
    information_per_s: float, required_log_odds: float
) -> dict[str, float | None]:
    """By horizon in s the loss whose mean log likelihood passes the odds within it; None where none does."""
    information_by_horizon = {
        f"{horizon_s:g}": information_per_s * horizon_s for horizon_s in DETECTION_HORIZONS_S
    }
    loss_or_inf_by_horizon = {
        horizon_s_text: np.sqrt(2.0 * required_log_odds / information) if information > 0.0 else np.inf
        for horizon_s_text, information in information_by_horizon.items()
    }
    return {
        horizon_s_text: float(loss) if loss <= 1.0 else None
        for horizon_s_text, loss in loss_or_inf_by_horizon.items()
    }


def _group_pair_cosine_entries(standardized_group_responses: Floats, model: Model) -> list[dict[str, Any]]:
    """Pairs of groups whose effects in this flight were nearly proportional."""
    pair_entries = []
    for first_group_index, second_group_index in combinations(range(len(model.groups)), 2):
        first_response = standardized_group_responses[:, first_group_index].ravel()
        second_response = standardized_group_responses[:, second_group_index].ravel()
        norm_product = float(np.sqrt((first_response @ first_response) * (second_response @ second_response)))
        cosine = float(first_response @ second_response) / max(norm_product, MIN_DIVISOR)
        surfaces = [model.groups[first_group_index], model.groups[second_group_index]]
        pair_entries.append(
            {
                "surfaces": surfaces,
                "cosine": cosine,
                "separable": abs(cosine) < _MIN_COSINE_OF_PROPORTIONAL_EFFECTS,
            }
        )
    return pair_entries


def isolability_sentences(isolability: dict[str, Any]) -> list[str]:
    """The statement in words."""
    sentences = [entry["says"] for entry in isolability["together"]]
    for entry in isolability["groups"]:
        sentences.append(
            f"{', '.join(entry['surfaces'])}: {_smallest_detectable_loss_text(entry['smallest_loss'])}"
        )
    for pair in isolability["alike"]:
        if not pair["separable"]:
            first_surfaces_text, second_surfaces_text = (" and ".join(names) for names in pair["surfaces"])
            sentences.append(
                f"In this flight the effects of {first_surfaces_text} and of {second_surfaces_text} were "
                f"nearly proportional (cosine {pair['cosine']:.2f}): one may be named for the other."
            )
    return sentences


def _smallest_detectable_loss_text(smallest_loss_by_horizon: dict[str, float | None]) -> str:
    loss_texts = [
        f"{loss:.0%} within {horizon_s_text} s"
        for horizon_s_text, loss in smallest_loss_by_horizon.items()
        if loss is not None
    ]
    if not loss_texts:
        longest_horizon_text = f"{DETECTION_HORIZONS_S[-1]:g} s"
        return (
            f"not even a complete loss would show within {longest_horizon_text} by the mean of this flight's "
            "commands."
        )
    return f"the smallest loss that shows on average is {', '.join(loss_texts)}."
