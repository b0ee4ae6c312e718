"""Compare a diagnosis with the log's own truth: labels of effectiveness, or time and surface of a failure.

The scores are computed after the diagnosis (`--score`, the benchmark, the tests of an identification). The
filter never uses them.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from beaver_ftc.results import Document, Onset
from beaver_ftc_logs.energy import UNKNOWN_SURFACE
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.recording import Floats, LoggedFailure
from beaver_ftc_logs.runs import last_row_at
from beaver_ftc_logs.samples import Samples

_SAME_FAILURE_S = 2.0  # surfaces that fail within this time of the first belong to one failure


def score_diagnosis(samples: Samples, rows: LogRows, groups: list[list[str]]) -> Document:
    """All figures that the log allows: by its labels, or by its failure if it has no labels.

    Where the log has more rows than samples, each row is compared with the label of the last sample up to its
    time. A surface without a label is left out of all scores of effectiveness. An alarm that names such a
    surface still counts in healthy_or_faulty.
    """
    labelled = np.isfinite(samples.labels).any(axis=0)
    if not labelled.any():
        return score_against_failures(rows, samples.logged_failures, groups)
    last = last_row_at(samples.t_s, rows.t_s)
    names = ("effectiveness", "effectiveness_low", "effectiveness_high")
    rows = replace(rows, **{name: getattr(rows, name).compress(labelled, axis=1) for name in names})
    return score_against_labels(rows, samples.labels[last].compress(labelled, axis=1))


def score_against_labels(rows: LogRows, labels: Floats) -> Document:
    """Scores against labelled effectiveness (n, S), on the rows in which every label is known.

    A setting is a row of labels that makes up at least 0.5 % of the known rows, or the most frequent.

    classes             share of rows whose estimate is nearest to the same setting as the label
    healthy_or_faulty   share of rows with an alarm if a label is below 1, and without one if none is
    side                share of rows in which the same surfaces are below 1 in estimate and label
    mean_error          mean magnitude of estimate less label, over rows and surfaces
    held_by_bounds      share of rows and surfaces whose label is within the bounds of the estimate

    If no row has all labels, these figures are None.
    """
    known = np.isfinite(labels).all(axis=1)
    if not known.any():
        keys = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
        return {"rows": 0, "settings": [], **dict.fromkeys(keys)}
    truth = labels[known]
    e, low, high = (
        values[known] for values in (rows.effectiveness, rows.effectiveness_low, rows.effectiveness_high)
    )
    levels, counts = np.unique(truth, axis=0, return_counts=True)
    frequent = levels[counts >= min(0.005 * len(truth), counts.max())]
    faulty = (truth < 1.0).any(axis=1)
    return {
        "rows": int(known.sum()),
        "settings": frequent.tolist(),
        "classes": float(np.mean(nearest_setting(e, frequent) == nearest_setting(truth, frequent))),
        "healthy_or_faulty": float(np.mean((rows.faulty[known] == 1) == faulty)),
        "side": float(np.mean(((e < 1.0) == (truth < 1.0)).all(axis=1))),
        "mean_error": float(np.abs(e - truth).mean()),
        "held_by_bounds": float(np.mean((low <= truth) & (truth <= high))),
    }


def worst_of(key: str, values: Iterable[float]) -> float:
    """The worst value of a score: the largest `mean_error`, the least of any other score."""
    return max(values) if key == "mean_error" else min(values)


def nearest_setting(e: Floats, levels: Floats) -> np.ndarray:
    """Index of the setting nearest to each row of the effectiveness e (n, S), (n,)."""
    distance = ((e[:, None] - levels) ** 2).sum(axis=2)
    return distance.argmin(axis=1)


def score_against_failures(
    rows: LogRows, failures: tuple[LoggedFailure, ...], groups: list[list[str]]
) -> Document:
    """Scores against the first failure in the log.

    failure, failure_s   surfaces of the first failure (within _SAME_FAILURE_S), joined by +, and its time, s;
                         None without one
    healthy_s            time from the first row to the last one before the failure, s
    false_alarms         number of alarms that begin before the failure
    detected, delay_s    whether a row from the failure on has an alarm; time from the failure to the first, s
    named                share of the rows with an alarm from the failure on, by their isolated surfaces
    right_group          whether the most frequent name is right (`_is_main_name_right`)

    An alarm that lasts over the failure counts as both: it is false, and it detects with a delay of less than
    one step.
    """
    first_s = min((failure.t_s for failure in failures), default=np.inf)
    onset = Onset(None if np.isinf(first_s) else float(first_s))
    failed = sorted({failure.surface for failure in failures if failure.t_s < first_s + _SAME_FAILURE_S})
    before = onset.is_false(rows.t_s)
    alarms = np.flatnonzero(~before & (rows.faulty == 1))
    detected = bool(alarms.size)
    names, counts = np.unique(rows.isolated_surfaces[alarms].astype(str), return_counts=True)
    shares = dict(zip(names.tolist(), (counts / max(len(alarms), 1)).tolist(), strict=True))
    return {
        "failure": "+".join(failed) or None,
        "failure_s": onset.at_s,
        "healthy_s": float(rows.t_s[before][-1] - rows.t_s[0]) if before.any() else 0.0,
        "false_alarms": int(np.sum(np.diff(rows.faulty[before], prepend=0) == 1)),
        "detected": detected,
        "delay_s": onset.delay_s(float(rows.t_s[alarms[0]])) if detected else None,
        "named": shares,
        "right_group": _is_main_name_right(shares, failed, groups),
    }


def _is_main_name_right(
    shares: dict[str, float], surfaces: list[str], groups: list[list[str]]
) -> bool | None:
    """Whether the most frequent name after the failure of some surfaces is a group that failed; None without
    a name, or if no group has failed. A name of several groups is right if all of them failed; `unknown`
    counts as no name, `engine` as a wrong one.

    A log may name a kind of surface for one of them: a failed `aileron` is right_aileron or left_aileron. Of
    the groups [right_aileron], [left_aileron] and [elevator], the names right_aileron and
    right_aileron+left_aileron are right then, elevator and right_aileron+elevator are not.
    """
    suffixes = tuple(f"_{surface}" for surface in surfaces)
    has_failed = [any(name in surfaces or name.endswith(suffixes) for name in group) for group in groups]
    shares = {name: share for name, share in shares.items() if name != UNKNOWN_SURFACE}
    if not any(has_failed) or not shares:
        return None
    main = set(max(shares, key=lambda name: shares[name]).split("+"))
    right = [failed for failed, group in zip(has_failed, groups, strict=True) if main & set(group)]
    return bool(right) and all(right)
