"""From rows to a verdict: the events of a flight, and which faults the flight can and cannot separate.

A loss of effectiveness d of group g changes the rates of a sample by -d F_g, so a sample has the information
F_g' F_g about d. `_own_information` is the part of it that neither trim nor other groups explain. On average,
a loss shows after the time T for which d^2 J T / 2 exceeds the prior odds against this loss.

    F       response of each group in standard deviations of the noise (n, G, 3), n samples, G groups
    J       information about one group, 1/s
    d, T    loss of effectiveness, and time in which it shows, s
"""

from itertools import combinations

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import trust
from beaver_ftc_logs.bank import HypothesisBank, build_bank
from beaver_ftc_logs.energy import ENGINE, UNKNOWN_SURFACE
from beaver_ftc_logs.least_squares import left_by
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.regression import innovations
from beaver_ftc_logs.runs import Runs, constant_stretches
from beaver_ftc_logs.samples import Samples

MAX_BRIEF_EVENT_S = 3.0  # a shorter alarm is brief
DETECTION_HORIZONS_S = (5.0, 20.0, 60.0)  # values of T for which the smallest loss is stated
_ALIKE_COSINE = 0.9  # two effects with a larger cosine are not separable
# Share of credible rows below which there is no verdict.
MIN_CREDIBLE_SHARE = 0.1
_ONE_GROUP_NOTE = (
    "{} get proportional commands while they are healthy: no fit of healthy flight tells their effects "
    "apart. A loss in any of them is named as all of them, and the effectiveness given is that of all "
    "together."
)


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

    A period of less than MAX_BRIEF_EVENT_S joins the event before it. If there is none, it is an event of its
    own, marked as brief. Events use later samples, which rows do not.
    """
    _, index = np.unique(rows.isolated_surfaces.astype(str), return_inverse=True)
    columns = np.column_stack([index, rows.faulty, rows.faulty[:, None] * rows.effectiveness])
    runs = _join_runs(rows, constant_stretches(columns))
    return [_fault_event_entry(rows, begin, end, surfaces) for begin, end in runs if rows.faulty[begin]]


def _join_runs(rows: LogRows, runs: Runs) -> Runs:
    """The runs of rows, in which an alarm that follows another one directly joins it if

        the alarm is brief, or
        both have the same name and effectiveness, or
        the other one is brief and its name is `unknown`.

    before: the last run of those joined so far, which begins at row `first`; empty for the first run.
    """
    joined: Runs = []
    for begin, end in runs:
        before = joined[-1] if joined else (begin, begin)
        first = before[0]
        names = rows.isolated_surfaces
        a = rows.effectiveness
        unnamed = first < begin and names[first] == UNKNOWN_SURFACE and _is_brief(rows, *before)
        alike = names[first] == names[begin] and (a[first] == a[begin]).all()
        joins = _is_brief(rows, begin, end) or unnamed or alike
        if first < begin and rows.faulty[first] and rows.faulty[begin] and joins:
            joined[-1] = (first, end)
        else:
            joined.append((begin, end))
    return joined


def _is_brief(rows: LogRows, begin: int, end: int) -> bool:
    """Whether a run of rows lasts for less than MAX_BRIEF_EVENT_S."""
    return bool(rows.t_s[end - 1] - rows.t_s[begin] < MAX_BRIEF_EVENT_S)


def _fault_event_entry(rows: LogRows, begin: int, end: int, surfaces: list[str]) -> Document:
    """One event, with its most frequent name and the medians of the effectiveness."""
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
    lines += [f"  report: {verdict['folder']}/report.html"] if "folder" in verdict else []
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
    """The line of an event: when it lasted, what was named, and the effectiveness."""
    text = ", ".join(
        f"{name} {bounds['estimate']:.2f} ({bounds['low']:.2f} to {bounds['high']:.2f})"
        for name, bounds in event["effectiveness"].items()
    )
    brief = "  (brief)" if event["brief"] else ""
    return f"  {event['from_s']:.1f} to {event['to_s']:.1f} s  {event['named']}  effectiveness {text}{brief}"


def isolability_document(samples: Samples, model: Model) -> Document:
    """Which groups this flight can separate, and the smallest loss of each that would show within each of
    DETECTION_HORIZONS_S."""
    bank = build_bank(model)
    flight = innovations(samples, model)
    F = flight.F[flight.is_known] @ flight.W * np.sqrt(model.settings.power)
    return {
        "together": [
            {"surfaces": group, "says": _ONE_GROUP_NOTE.format(", ".join(group))}
            for group in model.groups
            if len(group) > 1
        ],
        "groups": [
            {"surfaces": group, **_group_entry(F, g, model, bank, samples.dt_s)}
            for g, group in enumerate(model.groups)
        ],
        "alike": _alike_pairs(F, model),
        "columns_held_s": {name: round(age_s, 4) for name, age_s in samples.held_age_s.items()},
    }


def _group_entry(F: Floats, g: int, model: Model, bank: HypothesisBank, dt_s: float) -> Document:
    """Information about one group's effectiveness, 1/s, and its smallest losses; both also by
    `_own_information` (`..._of_its_motion`, `..._by_motion_alone`)."""
    odds = _alarm_odds(model, bank, g, dt_s)
    if not len(F):
        return {"information_per_s": 0.0, "smallest_loss": _smallest_losses(0.0, odds)}
    J = float((F[:, g] ** 2).sum(axis=1).mean()) / dt_s
    J_own = _own_information(F, g) / dt_s
    return {
        "information_per_s": J,
        "information_per_s_of_its_motion": J_own,
        "smallest_loss": _smallest_losses(J, odds),
        "smallest_loss_by_motion_alone": _smallest_losses(J_own, odds),
    }


def _own_information(F: Floats, g: int) -> float:
    """Information of a sample about one group that neither trim (a constant for each axis) nor other groups
    explain: r' r / n, with the residual r of least squares of f_g on the regressors N."""
    n, G, _ = F.shape
    f = F.transpose(1, 0, 2).reshape(G, -1)
    N = np.column_stack([np.tile(np.eye(3), (n, 1)), *np.delete(f, g, axis=0)])
    r = left_by(N, f[g])
    return float(r @ r) / n


def _alarm_odds(model: Model, bank: HypothesisBank, g: int, dt_s: float) -> float:
    """Log odds that the evidence for a loss of this group must exceed to reach the alarm's probability, for
    the median of its levels; inf if the bank has no such loss.

    log(alarm / (1 - alarm)) - log(p),    p: probability that a sample begins a loss of the median level
    """
    settings = model.settings
    shares = bank.transition_share[bank.is_fault_of_group(g)]
    if not len(shares):
        return float("inf")
    p = settings.changes_per_hour * dt_s / 3600.0 * float(np.median(shares))
    return float(np.log(settings.alarm / (1.0 - settings.alarm)) - np.log(p))


def _smallest_losses(J: float, odds: float) -> dict[str, float | None]:
    """The smallest loss d with d^2 J T / 2 >= odds, for each T in s; None if not even d = 1 is enough."""
    losses: dict[str, float | None] = {}
    for T in DETECTION_HORIZONS_S:
        d = np.sqrt(2.0 * odds / (J * T)) if J * T > 0.0 else np.inf
        losses[f"{T:g}"] = float(d) if d <= 1.0 else None
    return losses


def _alike_pairs(F: Floats, model: Model) -> list[Document]:
    """Each pair of groups with the cosine between their effects in this flight, f_g.f_h / |f_g| |f_h|, and
    whether it is far enough from +-1 to distinguish the two. F (n, G, 3)."""
    pairs = []
    for g, h in combinations(range(len(model.groups)), 2):
        f_g = F[:, g].ravel()
        f_h = F[:, h].ravel()
        cosine = float(f_g @ f_h) / max(float(np.sqrt((f_g @ f_g) * (f_h @ f_h))), MIN_DIVISOR)
        surfaces = [model.groups[g], model.groups[h]]
        pairs.append({"surfaces": surfaces, "cosine": cosine, "separable": abs(cosine) < _ALIKE_COSINE})
    return pairs


def isolability_sentences(isolable: Document) -> list[str]:
    """The sentences of `isolability_document`."""
    lines = [entry["says"] for entry in isolable["together"]]
    for entry in isolable["groups"]:
        lines.append(f"{', '.join(entry['surfaces'])}: {_smallest_loss_text(entry['smallest_loss'])}")
    for pair in isolable["alike"]:
        if not pair["separable"]:
            first, second = (" and ".join(names) for names in pair["surfaces"])
            lines.append(
                f"In this flight the effects of {first} and of {second} were "
                f"nearly proportional (cosine {pair['cosine']:.2f}): one may be named for the other."
            )
    return lines


def _smallest_loss_text(losses: dict[str, float | None]) -> str:
    """Words for the smallest loss of a group within each horizon."""
    texts = [f"{loss:.0%} within {horizon} s" for horizon, loss in losses.items() if loss is not None]
    if not texts:
        within = f"within {DETECTION_HORIZONS_S[-1]:g} s by the mean of this flight's commands"
        return f"not even a complete loss would show {within}."
    return f"the smallest loss that shows on average is {', '.join(texts)}."
