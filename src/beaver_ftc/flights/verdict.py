"""From rows to a verdict: what happened when, in this flight, and what it can and cannot separate."""

from itertools import pairwise
from typing import Any

import numpy as np

from beaver_ftc.flights.diagnose import UNKNOWN, Rows
from beaver_ftc.flights.isolability import sentences, statement
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.samples import Samples

Document = dict[str, Any]

BRIEF_S = 3.0


def verdict_of(samples: Samples, model: Model, rows: Rows) -> Document:
    """The document of verdict.json."""
    found = statement(samples, model)
    return {
        "flight": samples.name,
        "vehicle": model.vehicle.name,
        "duration_s": float(samples.t_s[-1] - samples.t_s[0]),
        "recorded_s": len(samples.t_s) * samples.dt_s,
        "gaps": int(samples.run[-1]),
        "rate_hz": 1.0 / samples.dt_s,
        "faulty": bool(rows.faulty.any()),
        "events": events_of(rows, list(model.vehicle.surfaces)),
        "can_separate": sentences(found),
        "isolability": found,
        "settings": model.settings.model_dump(),
        "notes": list(samples.notes),
    }


def events_of(rows: Rows, surfaces: list[str]) -> list[Document]:
    """Each time with one name and one effectiveness: when, what, how much is left.

    What lasts less than BRIEF_S between alarms is taken into the event before it; what stands alone is brief.
    This is hindsight, for the reader; the rows have none.
    """
    return [
        _event(rows, begin, end, surfaces) for begin, end in _joined(rows, _runs(rows)) if rows.faulty[begin]
    ]


def _runs(rows: Rows) -> list[tuple[int, int]]:
    """Begin and end of what has one name and one estimate."""
    changed = (rows.named[1:] != rows.named[:-1]) | (np.diff(rows.faulty) != 0)
    changed |= (np.diff(rows.estimate, axis=0) != 0.0).any(axis=1) & (rows.faulty[1:] == 1)
    edges = [0, *(np.flatnonzero(changed) + 1).tolist(), len(rows.named)]
    return list(pairwise(edges))


def _joined(rows: Rows, runs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Runs with the brief ones taken into the alarm before them, and alike neighbours made one."""
    joined: list[tuple[int, int]] = []
    for begin, end in runs:
        last = joined[-1] if joined else None
        brief = rows.t_s[end - 1] - rows.t_s[begin] < BRIEF_S
        if last and rows.faulty[last[0]] and (brief or _alike(rows, last[0], begin)) and rows.faulty[begin]:
            joined[-1] = (last[0], end)
        else:
            joined.append((begin, end))
    return joined


def _alike(rows: Rows, one: int, other: int) -> bool:
    return bool(
        rows.named[one] == rows.named[other] and np.array_equal(rows.estimate[one], rows.estimate[other])
    )


def _event(rows: Rows, begin: int, end: int, surfaces: list[str]) -> Document:
    """One event; name and effectiveness as they stood for most of it."""
    names, count = np.unique(rows.named[begin:end].astype(str), return_counts=True)
    named = str(names[count.argmax()])
    mentioned = surfaces if named == UNKNOWN else named.split("+")
    return {
        "from_s": float(rows.t_s[begin]),
        "to_s": float(rows.t_s[end - 1]),
        "brief": bool(rows.t_s[end - 1] - rows.t_s[begin] < BRIEF_S),
        "named": named,
        "probability": float(rows.probability[begin:end].max()),
        "effectiveness": {
            name: {
                "estimate": float(np.median(rows.estimate[begin:end, i])),
                "low": float(np.median(rows.low[begin:end, i])),
                "high": float(np.median(rows.high[begin:end, i])),
            }
            for i, name in enumerate(surfaces)
            if name in mentioned
        },
    }


def lasting(events: list[Document]) -> list[Document]:
    """The events that are not brief; all of them where every one is."""
    return [event for event in events if not event["brief"]] or events


def as_text(verdict: Document) -> str:
    """The verdict in lines for people."""
    lines = [f"{verdict['flight']}: {_summary(verdict)}"]
    shown = lasting(verdict["events"])
    lines += [f"  {_event_line(event)}" for event in shown]
    if len(shown) < len(verdict["events"]):
        lines.append(f"  and {len(verdict['events']) - len(shown)} brief alarms of under {BRIEF_S:g} s")
    lines += [f"  {sentence}" for sentence in (*verdict["can_separate"], *verdict["notes"])]
    for key, value in verdict.get("score", {}).items():
        lines.append(f"  {key}: {_shown(value)}")
    return "\n".join(lines)


def _summary(verdict: Document) -> str:
    count = len(lasting(verdict["events"]))
    what = f"{count} event{'s' if count > 1 else ''}" if count else "no fault shows"
    return f"{what} in {looked_at(verdict)}"


def looked_at(verdict: Document) -> str:
    """How much flight was diagnosed, in words: a gap in the log is no flight."""
    if not (gaps := verdict["gaps"]):
        return f"{verdict['duration_s']:.0f} s"
    return f"{verdict['recorded_s']:.0f} s, {gaps} gap{'s' if gaps > 1 else ''} in the log left out"


def _event_line(event: Document) -> str:
    left = ", ".join(
        f"{name} {known['estimate']:.2f} ({known['low']:.2f} to {known['high']:.2f})"
        for name, known in event["effectiveness"].items()
    )
    return f"{event['from_s']:.1f} to {event['to_s']:.1f} s  {event['named']}  effectiveness {left}"


def _shown(value: Any) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
