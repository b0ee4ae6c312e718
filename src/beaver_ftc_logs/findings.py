"""From rows to a verdict: the events of a flight, and their text.

A verdict is the document of verdict.json. An *event* is a period of an alarm with one name and one
effectiveness. `isolability` makes the part of the document on the faults that the flight can separate.
"""

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import trust
from beaver_ftc_logs.energy import ENGINE, UNKNOWN_SURFACE
from beaver_ftc_logs.isolability import isolability_document, isolability_sentences
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.runs import Runs, constant_runs
from beaver_ftc_logs.samples import Samples

MAX_BRIEF_EVENT_S = 3.0  # a shorter alarm is brief
# Share of credible rows below which there is no verdict.
MIN_CREDIBLE_SHARE = 0.1


def verdict_document(samples: Samples, model: Model, rows: LogRows) -> Document:
    """The document of verdict.json."""
    isolable = isolability_document(samples, model)
    return {
        "flight": samples.name,
        "vehicle": model.vehicle.name,
        **span_entry(samples),
        "faulty": bool(rows.faulty.any()),
        "credible": rows.credibility(),
        "events": fault_events(rows, list(model.vehicle.surfaces)),
        "can_separate": [*trust.unknown_sentences(model), *isolability_sentences(isolable)],
        "isolability": isolable,
        "settings": model.settings.model_dump(),
        "notes": list(samples.notes),
    }


def span_entry(samples: Samples) -> Document:
    """How much of a flight was recorded."""
    return {
        "duration_s": float(samples.t_s[-1] - samples.t_s[0]),
        "recorded_s": len(samples.t_s) * samples.dt_s,
        "gaps": int(samples.stretch_number[-1]),
        "rate_hz": 1.0 / samples.dt_s,
    }


def fault_events(rows: LogRows, surfaces: list[str]) -> list[Document]:
    """The events: periods of an alarm with one name and one effectiveness.

    A period of less than MAX_BRIEF_EVENT_S joins the event directly before it. If there is none, it is an
    event of its own, marked as brief; `_joins` has all rules. Events use later samples, which rows do not.
    """
    _, index = np.unique(rows.isolated_surfaces.astype(str), return_inverse=True)
    columns = np.column_stack([index, rows.faulty, rows.faulty[:, None] * rows.effectiveness])
    runs: Runs = []
    for begin, end in constant_runs(columns):
        if runs and _joins(rows, runs[-1], (begin, end)):
            runs[-1] = (runs[-1][0], end)
        else:
            runs.append((begin, end))
    return [_fault_event_entry(rows, begin, end, surfaces) for begin, end in runs if rows.faulty[begin]]


def _joins(rows: LogRows, earlier: tuple[int, int], later: tuple[int, int]) -> bool:
    """Whether a run of rows joins the run directly before it: both are alarms, and

        the later one is brief, or
        both have the same name and effectiveness, or
        the earlier one is brief and its name is `unknown`.

    Name and effectiveness of a run are those of its first row, i or k.
    """
    i = earlier[0]
    k = later[0]
    names = rows.isolated_surfaces
    is_alike = names[i] == names[k] and (rows.effectiveness[i] == rows.effectiveness[k]).all()
    is_unnamed = names[i] == UNKNOWN_SURFACE and _is_brief(rows, *earlier)
    return bool(rows.faulty[i] and rows.faulty[k] and (is_alike or is_unnamed or _is_brief(rows, *later)))


def _is_brief(rows: LogRows, begin: int, end: int) -> bool:
    """Whether a run of rows lasts for less than MAX_BRIEF_EVENT_S."""
    return bool(rows.t_s[end - 1] - rows.t_s[begin] < MAX_BRIEF_EVENT_S)


def _fault_event_entry(rows: LogRows, begin: int, end: int, surfaces: list[str]) -> Document:
    """One event, with its most frequent name, its largest probability, and the medians of the effectiveness:
    of the named surfaces, or of all if none is named."""
    names, counts = np.unique(rows.isolated_surfaces[begin:end].astype(str), return_counts=True)
    most_frequent = str(names[counts.argmax()])
    shown_surfaces = surfaces if most_frequent in (UNKNOWN_SURFACE, ENGINE) else most_frequent.split("+")
    columns = {"estimate": rows.effectiveness, "low": rows.effectiveness_low, "high": rows.effectiveness_high}
    medians = {key: np.median(values[begin:end], axis=0) for key, values in columns.items()}
    return {
        "from_s": float(rows.t_s[begin]),
        "to_s": float(rows.t_s[end - 1]),
        "brief": _is_brief(rows, begin, end),
        "named": most_frequent,
        "probability": float(rows.fault_probability[begin:end].max()),
        "effectiveness": {
            name: {key: float(median[i]) for key, median in medians.items()}
            for i, name in enumerate(surfaces)
            if name in shown_surfaces
        },
    }


def events_to_show(events: list[Document]) -> list[Document]:
    """The events that are not brief; all of them where every one is."""
    return [event for event in events if not event["brief"]] or events


def as_text(verdict: Document) -> str:
    """The verdict as lines of text."""
    shown = events_to_show(verdict["events"])
    summary = f"{len(shown)} event{'s' if len(shown) > 1 else ''}" if shown else _no_event_text(verdict)
    lines = [f"{verdict['flight']}: {summary} in {duration_text(verdict)}", *map(_event_text, shown)]
    lines += credibility_lines(verdict)
    if n := len(verdict["events"]) - len(shown):
        lines.append(f"  and {n} brief alarm{'s' if n > 1 else ''} of under {MAX_BRIEF_EVENT_S:g} s")
    lines += [f"  {text}" for text in (*verdict["can_separate"], *verdict["notes"])]
    for key, value in verdict.get("score", {}).items():
        lines.append(f"  {key}: {value:.3f}" if isinstance(value, float) else f"  {key}: {value}")
    if "folder" in verdict:
        lines.append(f"  report: {verdict['folder']}/report.html")
    return "\n".join(lines)


def _no_event_text(verdict: Document) -> str:
    """The words for a flight without events: no fault shows, or too few rows are credible for a verdict."""
    share = verdict["credible"]["share"]
    if share < MIN_CREDIBLE_SHARE:
        return "no verdict"
    return "no fault shows" if share >= 1.0 else "no fault shows where the model is credible,"


def credibility_lines(verdict: Document) -> list[str]:
    """Lines on the rows that are not credible, with the reasons; none if all rows are credible."""
    credible = verdict["credible"]
    if credible["share"] >= 1.0:
        return []
    head = f"  credible in {credible['share']:.1%} of the rows; in the others nothing is said, because"
    reasons = credible["reasons"]
    return [head, *(f"  {reason['says']}: {reason['share']:.1%} of the rows" for reason in reasons)]


def duration_text(verdict: Document) -> str:
    """Words for the duration of the diagnosed flight, without the gaps in the log."""
    if not (n_gaps := verdict["gaps"]):
        return f"{verdict['duration_s']:.0f} s"
    return f"{verdict['recorded_s']:.0f} s, {n_gaps} gap{'s' if n_gaps > 1 else ''} in the log left out"


def _event_text(event: Document) -> str:
    """The line of an event: begin and end, name, and effectiveness."""
    text = ", ".join(
        f"{name} {bounds['estimate']:.2f} ({bounds['low']:.2f} to {bounds['high']:.2f})"
        for name, bounds in event["effectiveness"].items()
    )
    brief = "  (brief)" if event["brief"] else ""
    return f"  {event['from_s']:.1f} to {event['to_s']:.1f} s  {event['named']}  effectiveness {text}{brief}"
