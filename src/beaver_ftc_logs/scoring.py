"""Compare a diagnosis with what the log states: labels of effectiveness, or time and surface of a failure.

Used after the diagnosis (`--score`, the benchmark, the tests of an identification), never by the filter.
"""

from dataclasses import replace

import numpy as np

from beaver_ftc.results import Document, Onset
from beaver_ftc_logs.diagnose import UNKNOWN_SURFACE, DiagnosisRows
from beaver_ftc_logs.recording import Floats, LoggedFailure
from beaver_ftc_logs.samples import Samples

_SIMULTANEOUS_FAILURE_SPAN_S = 2.0


def score_diagnosis(samples: Samples, diagnosis_rows: DiagnosisRows, groups: list[list[str]]) -> Document:
    """All figures that the log allows: by its labels, or by its failure if it has no labels.

    Where the log has more rows than samples, each row is compared with the label of the last sample up to its
    time. Surfaces without a label are left out.
    """
    is_surface_labelled = np.isfinite(samples.labels).any(axis=0)
    if not is_surface_labelled.any():
        return score_against_failures(diagnosis_rows, samples.logged_failures, groups)
    last_sample_index_of_row = np.maximum(
        np.searchsorted(samples.t_s, diagnosis_rows.t_s, side="right") - 1, 0
    )
    labelled_surface_arrays_by_field = {
        name: getattr(diagnosis_rows, name).compress(is_surface_labelled, axis=1)
        for name in ("effectiveness", "effectiveness_low", "effectiveness_high")
    }
    return score_against_labels(
        replace(diagnosis_rows, **labelled_surface_arrays_by_field),
        samples.labels[last_sample_index_of_row].compress(is_surface_labelled, axis=1),
    )


def score_against_labels(diagnosis_rows: DiagnosisRows, labels: Floats) -> Document:
    """Scores against labelled effectiveness (n, S), on the rows in which every label is known.

    A setting is a row of labels that makes up at least 0.5 % of the flight. classes: share of rows whose
    estimate is nearest to the same setting as the label. side: share of rows in which the same surfaces are
    below 1. Without such a row all figures are None.
    """
    is_every_label_known = np.isfinite(labels).all(axis=1)
    if not is_every_label_known.any():
        score_names = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
        return {"rows": 0, "settings": [], **dict.fromkeys(score_names)}
    true_effectiveness = labels[is_every_label_known]
    estimated_effectiveness = diagnosis_rows.effectiveness[is_every_label_known]
    label_settings, n_rows_of_setting = np.unique(true_effectiveness, axis=0, return_counts=True)
    frequent_settings = label_settings[n_rows_of_setting >= 0.005 * len(true_effectiveness)]
    is_truly_faulty = (true_effectiveness < 1.0).any(axis=1)
    return {
        "rows": int(is_every_label_known.sum()),
        "settings": frequent_settings.tolist(),
        "classes": float(
            np.mean(
                nearest_label_setting_index(estimated_effectiveness, frequent_settings)
                == nearest_label_setting_index(true_effectiveness, frequent_settings)
            )
        ),
        "healthy_or_faulty": float(
            np.mean((diagnosis_rows.faulty[is_every_label_known] == 1) == is_truly_faulty)
        ),
        "side": float(np.mean(((estimated_effectiveness < 1.0) == (true_effectiveness < 1.0)).all(axis=1))),
        "mean_error": float(np.abs(estimated_effectiveness - true_effectiveness).mean()),
        "held_by_bounds": float(
            np.mean(
                (diagnosis_rows.effectiveness_low[is_every_label_known] <= true_effectiveness)
                & (true_effectiveness <= diagnosis_rows.effectiveness_high[is_every_label_known])
            )
        ),
    }


def nearest_label_setting_index(effectiveness: Floats, label_settings: Floats) -> np.ndarray:
    """Index of the setting nearest to each row of effectiveness (n, S), (n,)."""
    squared_distance = ((effectiveness[:, None, :] - label_settings[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(squared_distance.argmin(axis=1))


def score_against_failures(
    diagnosis_rows: DiagnosisRows, failures: tuple[LoggedFailure, ...], groups: list[list[str]]
) -> Document:
    """Scores against the first failure in the log: alarms before it are false, the first one after it has the
    delay delay_s."""
    first_failure_s = min((failure.t_s for failure in failures), default=np.inf)
    failure_onset_record = Onset(None if np.isinf(first_failure_s) else float(first_failure_s))
    first_failed_surfaces = sorted(
        {
            failure.surface
            for failure in failures
            if failure.t_s < first_failure_s + _SIMULTANEOUS_FAILURE_SPAN_S
        }
    )
    is_before_failure = failure_onset_record.is_false(diagnosis_rows.t_s)
    alarm_rows_after_failure = np.flatnonzero(~is_before_failure & (diagnosis_rows.faulty == 1))
    detected = bool(alarm_rows_after_failure.size)
    name_shares = _name_shares_after_failure(diagnosis_rows, alarm_rows_after_failure)
    return {
        "failure": "+".join(first_failed_surfaces) or None,
        "failure_s": failure_onset_record.at_s,
        "healthy_s": float(diagnosis_rows.t_s[is_before_failure][-1] - diagnosis_rows.t_s[0])
        if is_before_failure.any()
        else 0.0,
        "false_alarms": int(np.sum(np.diff(diagnosis_rows.faulty[is_before_failure], prepend=0) == 1)),
        "detected": detected,
        "delay_s": failure_onset_record.delay_s(float(diagnosis_rows.t_s[alarm_rows_after_failure[0]]))
        if detected
        else None,
        "named": name_shares,
        "right_group": _is_most_frequent_name_right(name_shares, first_failed_surfaces, groups),
    }


def _name_shares_after_failure(
    diagnosis_rows: DiagnosisRows, alarm_rows_after_failure: np.ndarray
) -> dict[str, float]:
    """Return the names after the failure, as shares of the rows with an alarm."""
    names, n_rows_of_name = np.unique(
        diagnosis_rows.isolated_surfaces[alarm_rows_after_failure].astype(str), return_counts=True
    )
    return {
        str(name): float(share)
        for name, share in zip(names, n_rows_of_name / max(len(alarm_rows_after_failure), 1), strict=True)
    }


def _is_most_frequent_name_right(
    name_shares: dict[str, float], failed_surfaces: list[str], groups: list[list[str]]
) -> bool | None:
    """Whether the most frequent name after the failure is a group that failed; None without a failure or
    name."""
    failed_surface_suffixes = tuple(f"_{surface}" for surface in failed_surfaces)
    failed_group_indices = {
        group_index
        for group_index, group in enumerate(groups)
        for name in group
        if name in failed_surfaces or name.endswith(failed_surface_suffixes)
    }
    share_of_known_name = {name: share for name, share in name_shares.items() if name != UNKNOWN_SURFACE}
    if not failed_group_indices or not share_of_known_name:
        return None
    surfaces_of_most_frequent_name = set(
        max(share_of_known_name, key=lambda name: share_of_known_name[name]).split("+")
    )
    named_group_indices = {
        group_index for group_index, group in enumerate(groups) if surfaces_of_most_frequent_name & set(group)
    }
    return bool(named_group_indices) and named_group_indices <= failed_group_indices
