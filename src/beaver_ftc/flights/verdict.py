"""From rows to a verdict: what happened when, in this flight, and what it can and cannot separate."""

from itertools import pairwise
from typing import Any

import numpy as np

from beaver_ftc.flights.diagnose import UNKNOWN, Rows
from beaver_ftc.flights.isolability import sentences, statement
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.samples import Samples

Document = dict[str, Any]


def verdict_of(samples: Samples, model: Model, rows: Rows) -> Document:
    """The document of verdict.json."""
    found = statement(samples, model)
    return {
        "flight": samples.name,
        "vehicle": model.vehicle.name,
        "duration_s": float(samples.t_s[-1] - samples.t_s[0]),
        "rate_hz": 1.0 / samples.dt_s,
        "faulty": bool(rows.faulty.any()),
        "events": events_of(rows, list(model.vehicle.surfaces)),
        "can_separate": sentences(found),
        "isolability": found,
        "settings": model.settings.model_dump(),
    }


def events_of(rows: Rows, surfaces: list[str]) -> list[Document]:
    """Each uninterrupted time with the same name: when, what, how much is left."""
    events: list[Document] = []
    change = np.flatnonzero(rows.named[1:] != rows.named[:-1]) + 1
    edges = [0, *change.tolist(), len(rows.named)]
    for begin, end in pairwise(edges):
        if rows.faulty[begin]:
            events.append(_event(rows, begin, end, surfaces))
    return events


def _event(rows: Rows, begin: int, end: int, surfaces: list[str]) -> Document:
    """One event; effectiveness as known when it ended."""
    named = str(rows.named[begin])
    mentioned = surfaces if named == UNKNOWN else named.split("+")
    last = end - 1
    return {
        "from_s": float(rows.t_s[begin]),
        "to_s": float(rows.t_s[last]),
        "named": named,
        "probability": float(rows.probability[begin:end].max()),
        "effectiveness": {
            name: {
                "estimate": float(rows.estimate[last, i]),
                "low": float(rows.low[last, i]),
                "high": float(rows.high[last, i]),
            }
            for i, name in enumerate(surfaces)
            if name in mentioned
        },
    }


def as_text(verdict: Document) -> str:
    """The verdict in lines for people."""
    lines = [f"{verdict['flight']}: {_summary(verdict)}"]
    lines += [f"  {_event_line(event)}" for event in verdict["events"]]
    lines += [f"  {sentence}" for sentence in verdict["can_separate"]]
    for key, value in verdict.get("score", {}).items():
        lines.append(f"  {key}: {_shown(value)}")
    return "\n".join(lines)


def _summary(verdict: Document) -> str:
    count = len(verdict["events"])
    what = f"{count} event{'s' if count > 1 else ''}" if count else "no fault shows"
    return f"{what} in {verdict['duration_s']:.0f} s"


def _event_line(event: Document) -> str:
    left = ", ".join(
        f"{name} {known['estimate']:.2f} ({known['low']:.2f} to {known['high']:.2f})"
        for name, known in event["effectiveness"].items()
    )
    return f"{event['from_s']:.1f} to {event['to_s']:.1f} s  {event['named']}  effectiveness {left}"


def _shown(value: Any) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
