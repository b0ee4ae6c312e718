"""A diagnosis against the log's own word: labels of effectiveness, or the time and surface of a failure.

Used after the fact (`--score`, the benchmark, identification's own tests), never by the filter.
"""

from dataclasses import replace

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc.scenario import Onset
from beaver_ftc_logs.diagnose import Rows
from beaver_ftc_logs.recording import Event, Floats
from beaver_ftc_logs.samples import Samples

ENGINE = "engine"
_SETTLED_S = 2.0


def score(samples: Samples, rows: Rows, groups: list[list[str]]) -> Document:
    """Every figure that the log's own word allows: by labels where it has them, by its failure otherwise.

    Of a log faster than its samples each row has the label of its last sample; a surface of which the log
    says nothing is not judged.
    """
    labelled = np.isfinite(samples.labels).any(axis=0)
    if not labelled.any():
        return by_event(rows, samples.events, groups)
    last = np.maximum(np.searchsorted(samples.t_s, rows.t_s, side="right") - 1, 0)
    judged = {name: getattr(rows, name).compress(labelled, axis=1) for name in ("estimate", "low", "high")}
    return by_labels(replace(rows, **judged), samples.labels[last].compress(labelled, axis=1))


def by_labels(rows: Rows, labels: Floats) -> Document:
    """Against labelled effectiveness (n, S), on the rows where it is known.

    classes: share of rows whose estimate is nearest to the true one of the label's own settings, those that
    it takes for at least a hundredth of the flight, over all surfaces; side: whether the same surfaces are
    faulty.
    """
    ok = np.isfinite(labels).all(axis=1)
    truth, estimate = labels[ok], rows.estimate[ok]
    found, count = np.unique(truth, axis=0, return_counts=True)
    settings = found[count >= 0.005 * len(truth)]
    faulty = (truth < 1.0).any(axis=1)
    return {
        "rows": int(ok.sum()),
        "settings": settings.tolist(),
        "classes": float(np.mean(nearest(estimate, settings) == nearest(truth, settings))),
        "healthy_or_faulty": float(np.mean((rows.faulty[ok] == 1) == faulty)),
        "side": float(np.mean(((estimate < 1.0) == (truth < 1.0)).all(axis=1))),
        "mean_error": float(np.abs(estimate - truth).mean()),
        "held_by_bounds": float(np.mean((rows.low[ok] <= truth) & (truth <= rows.high[ok]))),
    }


def nearest(estimate: Floats, settings: Floats) -> np.ndarray:
    """Index of the setting nearest to each row."""
    distance = ((estimate[:, None, :] - settings[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(distance.argmin(axis=1))


def by_event(rows: Rows, events: tuple[Event, ...], groups: list[list[str]]) -> Document:
    """Against the first failure the log tells of: alarms before it are false, those after it are late by."""
    begins = min((event.t_s for event in events), default=np.inf)
    onset = Onset(None if np.isinf(begins) else float(begins))
    surfaces = sorted({event.surface for event in events if event.t_s < begins + _SETTLED_S})
    before = onset.is_false(rows.t_s)
    after = np.flatnonzero(~before & (rows.faulty == 1))
    detected = bool(after.size)
    named = _named(rows, after)
    return {
        "failure": "+".join(surfaces) or None,
        "failure_s": onset.at_s,
        "healthy_s": float(rows.t_s[before][-1] - rows.t_s[0]) if before.any() else 0.0,
        "false_alarms": int(np.sum(np.diff(rows.faulty[before], prepend=0) == 1)),
        "detected": detected,
        "delay_s": onset.delay_s(float(rows.t_s[after[0]])) if detected else None,
        "named": named,
        "right_group": _right_group(named, surfaces, groups),
    }


def _named(rows: Rows, after: np.ndarray) -> dict[str, float]:
    """What was named after the failure, as shares of the rows with an alarm."""
    names, count = np.unique(rows.named[after].astype(str), return_counts=True)
    return {str(name): float(share) for name, share in zip(names, count / max(len(after), 1), strict=True)}


def _right_group(named: dict[str, float], surfaces: list[str], groups: list[list[str]]) -> bool | None:
    """Whether the name held longest after the failure is of the group that failed; None: nothing to judge."""
    endings = tuple(f"_{surface}" for surface in surfaces)
    actual = {
        index
        for index, group in enumerate(groups)
        for name in group
        if name in surfaces or name.endswith(endings)
    }
    names = {name: share for name, share in named.items() if name != "unknown"}
    if not actual or not names:
        return None
    longest = set(max(names, key=lambda name: names[name]).split("+"))
    found = {index for index, group in enumerate(groups) if longest & set(group)}
    return bool(found) and found <= actual
