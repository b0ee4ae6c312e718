"""The comparison as one document: what the table, the figure, the page and `--format json` are made from."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from beaver_ftc.results.metrics import versions
from beaver_ftc.studies.compare.tally import Line, Point, lines_of, matched, trade_off
from beaver_ftc.studies.compare.trial import LAW, ORACLE, SCHEME, Entry, Trial
from beaver_ftc.studies.present.tables import finite

Document = dict[str, Any]

# (key of a line, what it is called, whether more is better); what is held against ours in `verdicts`
COMPARED = (
    ("false_alarms_per_h", "false alarms per hour", False),
    ("detection_rate", "detection rate", True),
    ("delay_median_s", "median detection delay, s", False),
    ("delay_90_s", "90 % detection delay, s", False),
    ("isolation_rate", "isolation accuracy", True),
)
MATCHED = (("detection_rate", "detection rate", True), ("delay_median_s", "median detection delay, s", False))
TRACKING = (
    ("ratio_median", "median tracking ratio to the oracle", False),
    ("ratio_90", "90 % tracking ratio to the oracle", False),
    ("departures", "departures", False),
)
EFFORT = (
    ("before_median", "median error before the fault, deg/s", False),
    ("before_90", "90 % error before the fault, deg/s", False),
    ("after_median", "median error after the fault, deg/s", False),
    ("after_90", "90 % error after the fault, deg/s", False),
    ("travel_median", "median travel of the surfaces, deg/s", False),
    ("energy_median", "median energy of the surfaces, deg2/s2", False),
)


def document_of(trials: Sequence[Trial], entries: Sequence[Entry]) -> Document:
    """Tally every set; numbers that do not exist are null."""
    names = list(dict.fromkeys(trial.set for trial in trials))
    sets = {name: _set([t for t in trials if t.set == name], entries) for name in names}
    return {"sets": sets, "versions": dict(versions())}


def _set(trials: Sequence[Trial], entries: Sequence[Entry]) -> Document:
    schemes = list(dict.fromkeys(scheme for trial in trials for scheme in trial.traces))
    traces = {s: [t.traces[s] for t in trials if s in t.traces] for s in schemes}
    lines = [_plain(line) for line in lines_of(trials, entries)]
    free = {s: _point(matched(of)) for s, of in traces.items()}
    return {
        "flights": len(trials),
        "lines": lines,
        "trade_off": {s: [_point(p) for p in trade_off(of)] for s, of in traces.items()},
        "without_false_alarm": free,
        "better_than_ours": better_than_ours(lines, free if any(line["faults"] for line in lines) else {}),
        "errors": sorted({error for trial in trials for error in _errors(trial)}),
    }


def _errors(trial: Trial) -> list[str]:
    return [*trial.failures, *(result.error for result in trial.results if result.error)]


def _plain(line: Line) -> Document:
    row = asdict(line)
    entry = row.pop("entry")
    return {"scheme": entry["scheme"], "law": entry["law"], **{k: finite(v) for k, v in row.items()}}


def _point(point: Point) -> Document:
    return {key: finite(value) for key, value in asdict(point).items()}


def better_than_ours(lines: Sequence[Document], free: Document) -> list[str]:
    """Where a rival does better than our scheme or our law: one sentence each.

    free: of each scheme, the most sensitive level without a false alarm.
    """
    ours = next(row for row in lines if (row["scheme"], row["law"]) == (SCHEME, LAW))
    schemes = [row for row in lines if row["law"] == LAW and row["scheme"] not in (SCHEME, "none")]
    laws = [row for row in lines if row["scheme"] == SCHEME and row["law"] not in (LAW, ORACLE)]
    said = [s for row in schemes for s in _better(row, ours, COMPARED + TRACKING, row["scheme"])]
    said += [
        f"with no false alarm, {sentence}"
        for scheme, point in free.items()
        if scheme != SCHEME and SCHEME in free
        for sentence in _better(point, free[SCHEME], MATCHED, scheme)
    ]
    return said + [s for row in laws for s in _better(row, ours, TRACKING + EFFORT, row["law"])]


def _better(row: Document, ours: Document, compared: Sequence[tuple[str, str, bool]], name: str) -> list[str]:
    return [
        f"{name} has the better {what}: {_shown(row.get(key))} against {_shown(ours.get(key))}"
        for key, what, more in compared
        if _is_better(row.get(key), ours.get(key), more)
    ]


def _is_better(value: float | None, than: float | None, more: bool) -> bool:
    """None is the worst there is: a delay that never ends, a rate of nothing."""
    if value is None:
        return False
    if than is None:
        return True
    return value > than + 1e-9 if more else value < than - 1e-9


def _shown(value: float | None) -> str:
    return "never" if value is None else f"{value:.3g}"
