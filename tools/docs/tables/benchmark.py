"""The tables of benchmark.md: what schemes find, how laws track, and where a rival does better."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from beaver_ftc.plugins import DETECTORS, LAWS, registered
from beaver_ftc.studies.compare.leaderboard import run_comparison
from beaver_ftc.studies.compare.trial import LAW, SCHEME, entries_of, of_set, set_names
from beaver_ftc.studies.present.tables import markdown_table

Document = dict[str, Any]
EXACT = ("published", "envelope", "fault-types", "realism", "healthy")
SHOWN = (*EXACT, "air-still", "air-light", "air-moderate")
HIDDEN = ("none", "oracle", "fault-tolerant-published", "oracle-published")  # what nobody would choose
PROBED = ("published", "air-light")


def benchmark() -> str:
    """All standard sets, flown by every scheme with our law and every law with our scheme."""
    return _tables(_compared(set_names()))


def benchmark_probe() -> str:
    """One flight of each sweep of two sets: a change of any number of theirs shows here first."""
    return _tables(_compared(PROBED, most=1))


def _compared(names: tuple[str, ...] | list[str], most: int | None = None) -> Document:
    """The document that `beaver-ftc compare --benchmark` writes."""
    cases = [case for name in names for case in of_set(name, most)]
    entries = entries_of(list(registered(DETECTORS)), list(registered(LAWS)))
    with TemporaryDirectory() as folder:
        return run_comparison(Path(folder), "benchmark", cases, entries, 2, None)


def _tables(document: Document) -> str:
    """The tables of the page, and in words where a rival is better than ours."""
    sets = {name: document["sets"][name] for name in SHOWN if name in document["sets"]}
    faulted = {name: part for name, part in sets.items() if part["lines"][0]["faults"]}
    return "\n\n".join((
        "Schemes: faults detected / rightly isolated, %, and median delay, s.",
        _schemes(sets, faulted),
        "Laws: tracking error after the fault over the oracle's, median / 90 % of flights.",
        _laws(faulted),
        "Where a rival is better than our default:",
        "\n".join(f"- {sentence}" for sentence in _better(faulted)) or "- nowhere",
    ))  # fmt: skip


def _schemes(sets: dict[str, Document], faulted: dict[str, Document]) -> str:
    head = ("scheme", *faulted, "false alarms/h: exact sensors", "in air")
    of = {name: _rows(part, "law", LAW, "scheme") for name, part in sets.items()}
    return markdown_table(head, [
        (scheme, *(_found(of[name][scheme]) for name in faulted), *_alarms(scheme, of))
        for scheme in of[next(iter(of))]
        if scheme not in HIDDEN
    ])  # fmt: skip


def _found(row: Document) -> str:
    shares = f"{100 * row['detection_rate']:.0f}/{100 * row['isolation_rate']:.0f}"
    delay = row["delay_median_s"]
    return f"{shares}, never" if delay is None else f"{shares}, {delay:.2f}"


def _alarms(scheme: str, of: dict[str, dict[str, Document]]) -> tuple[str, str]:
    """Per hour flown without a fault, with exact sensors and with declared errors."""
    found = []
    for in_air in (False, True):
        rows = [rows[scheme] for name, rows in of.items() if (name not in EXACT) == in_air]
        alarms, hours = (sum(row[key] for row in rows) for key in ("false_alarms", "healthy_h"))
        found.append(f"{alarms / hours:.3g}" if hours else "-")
    return found[0], found[1]


def _laws(sets: dict[str, Document]) -> str:
    of = {name: _rows(part, "scheme", SCHEME, "law") for name, part in sets.items()}
    laws = [law for law in of[next(iter(of))] if law not in HIDDEN]
    return markdown_table(("law", *sets), [
        (law, *(_tracked(rows[law]) for rows in of.values())) for law in laws
    ])  # fmt: skip


def _tracked(row: Document) -> str:
    shares = (row["ratio_median"], row["ratio_90"])
    return "/".join("lost" if share is None else f"{share:.2f}" for share in shares)


def _rows(part: Document, key: str, ours: str, of: str) -> dict[str, Document]:
    return {row[of]: row for row in part["lines"] if row[key] == ours}


BETTER = (  # (what, key, whether more is better, whose)
    ("detects more", "detection_rate", True, "scheme"),
    ("isolates more", "isolation_rate", True, "scheme"),
    ("is sooner in the median", "delay_median_s", False, "scheme"),
    ("raises fewer false alarms", "false_alarms", False, "scheme"),
    ("has the smaller median tracking error", "ratio_median", False, "law"),
    ("has the smaller 90 % tracking error", "ratio_90", False, "law"),
)


def _better(sets: dict[str, Document]) -> list[str]:
    """A sentence for each rival and the same sets: in what it is better there."""
    found: dict[tuple[str, str], list[str]] = {}
    for what, key, more, of in BETTER:
        other, ours = ("law", SCHEME) if of == "scheme" else ("scheme", LAW)
        beside = LAW if of == "scheme" else SCHEME
        shown = {name: _rows(part, other, beside, of) for name, part in sets.items()}
        for rival in (each for each in shown[next(iter(shown))] if each not in (ours, *HIDDEN)):
            where = [
                f"`{name}`" for name, rows in shown.items() if _less(rows[ours][key], rows[rival][key], more)
            ]
            if where:
                found.setdefault((rival, ", ".join(where)), []).append(what)
    return [f"`{rival}` {' and '.join(whats)} in {where}." for (rival, where), whats in found.items()]


def _less(ours: float | None, theirs: float | None, more: bool) -> bool:
    """Whether theirs is better; what never comes, or is lost, is None and the worst."""
    if theirs is None or ours is None:
        return theirs is not None
    return theirs > ours if more else theirs < ours
