"""What one method did on all flights of a data set, in figures."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from beaver_ftc.flights.scoring import ENGINE
from beaver_ftc.studies.engine.statistics import poisson

Document = dict[str, Any]

SOON_S = 5.0
_KINDS = {"left_aileron": "aileron", "right_aileron": "aileron", "rudder": "rudder", "elevator": "elevator"}


def by_events(scores: Sequence[Document]) -> Document:
    """From each flight's score against its failure. A flight whose surface failed is found if an alarm comes
    after; a flight with an alarm before its failure, or without any failure, counts as a false one."""
    surface = [one for one in scores if one["failure"] and ENGINE not in one["failure"]]
    found = [one for one in surface if one["detected"]]
    falsely = [one for one in scores if one["false_alarms"]]
    healthy = [one for one in scores if one["failure"] is None]
    quiet = [one for one in healthy if not one["false_alarms"]]
    hours = sum(one["healthy_s"] for one in scores) / 3600.0
    alarms = poisson(sum(one["false_alarms"] for one in scores), hours)
    right = len(found) + len(quiet)
    return {
        "surface_failures": len(surface),
        "found": len(found),
        "precision": len(found) / max(len(found) + len(falsely), 1),
        "recall": len(found) / max(len(surface), 1),
        "accuracy": right / max(len(surface) + len(healthy), 1),
        "healthy_flights": len(healthy),
        "healthy_flights_with_an_alarm": len(healthy) - len(quiet),
        "false_alarms_per_hour": {"value": alarms.value, "low": alarms.low, "high": alarms.high},
        "healthy_hours": hours,
        "wrong_group": sum(one["right_group"] is False for one in found),
        "delay_s": {kind: _delays(surface, kind) for kind in ("aileron", "rudder", "elevator")},
        "engine_failures_with_an_alarm": sum(
            one["detected"] for one in scores if one["failure"] and ENGINE in one["failure"]
        ),
    }


def _delays(surface: Sequence[Document], kind: str) -> Document:
    ours = [one for one in surface if _kind(one["failure"]) == kind]
    delays = [one["delay_s"] for one in ours if one["detected"]]
    return {
        "failures": len(ours),
        "found": len(delays),
        "within_5_s": sum(delay <= SOON_S for delay in delays),
        "mean": float(np.mean(delays)) if delays else None,
    }


def _kind(failure: str) -> str:
    """What failed first in the name: an aileron before a rudder, as both do in one flight."""
    kinds = [_KINDS.get(name, name) for name in failure.split("+")]
    return min(kinds)


def by_labels(scores: Sequence[Document]) -> Document:
    """Mean of the figures over the parts that were left out, weighted by their rows."""
    weights = np.array([one["rows"] for one in scores], dtype=float)
    keys = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
    return {key: float(np.average([one[key] for one in scores], weights=weights)) for key in keys} | {
        "rows": int(weights.sum())
    }
