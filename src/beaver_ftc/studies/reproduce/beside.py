"""The published cases with the scheme and law of the paper, and with our default ones, side by side.

Flights, declared bounds and references are the same. Ours also sets `fdi.thresholds` and `fdi.sharpen`.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

from beaver_ftc.results.model import Document
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.present.tables import number, percent
from beaver_ftc.studies.reproduce.cases import CASES, EDGES, HEALTHY, OURS, Changed, fly_case
from beaver_ftc.studies.reproduce.flown import AXIS, Flown

FAULTY = ("elevator", "aileron", "rudder", "unanticipated")  # names of cases
SHOWN = (HEALTHY, *(CASES[name] for name in FAULTY))
# Who flies a case, and the changes of its scenario.
FLOWN_BY: Mapping[str, Mapping[str, object]] = {"paper": {}, "ours": OURS}
MATTERS = 0.01  # a difference by a smaller share does not count
BETTER = f"Where the paper's is better, by more than {percent(MATTERS)}:"
# Numbers whose smaller value is better: key in a row, name, unit.
QUANTITIES = (
    ("detected_s", "detection after", "s"), ("isolated_s", "isolation after", "s"),
    ("before_deg_s", "RMS before the fault", "deg/s"), ("after_deg_s", "RMS after the fault", "deg/s"),
    ("travel_deg", "surface travel", "deg"), ("work_deg2_per_s", "surface work", "deg²/s"),
)  # fmt: skip


def fly_both() -> dict[tuple[str, str], Flown]:
    """The flights of each case of SHOWN with both schemes, by (case, flown_by)."""
    return {
        (case.name, flown_by): fly_case(case, changes)
        for case in SHOWN
        for flown_by, changes in FLOWN_BY.items()
    }


def healthy_settings() -> list[tuple[str, Changed]]:
    """(flown_by, setting) for each of EDGES."""
    return [
        (flown_by, Changed(corner.name, {**changes, **corner.changes}))
        for flown_by, changes in FLOWN_BY.items()
        for corner in EDGES
    ]


def false_alarm_of(setting: Changed) -> float:
    """1 if a healthy flight in this setting raises an alarm."""
    return float(fly_case(HEALTHY, setting.changes).metrics.false_alarm)


def document_of(flights: Mapping[tuple[str, str], Flown], alarms: Sequence[float]) -> Document:
    """The document: a row for each case and scheme, and the false alarms of each scheme. alarms: 1 or 0 for
    each of `healthy_settings`, in their order."""
    rows = {place: _row(*place, flight) for place, flight in flights.items()}
    settings = zip(healthy_settings(), alarms, strict=True)
    alarmed = Counter(flown_by for (flown_by, _), alarm in settings if alarm)
    return {
        "rows": list(rows.values()),
        "healthy_flights": len(EDGES),
        "false_alarms": {flown_by: alarmed[flown_by] for flown_by in FLOWN_BY},
        "paper_better": _better(rows),
    }


def _row(case: str, flown_by: str, flight: Flown) -> Document:
    """The row of a flight. case: its name; the healthy case has no axis of its own and is shown in pitch."""
    metrics = flight.metrics
    axis = AXIS.get(case, "q")
    tracking = metrics.tracking
    return {
        "case": case,
        "flown_by": flown_by,
        "scheme": metrics.flight.scheme,
        "law": metrics.flight.law,
        "detected_s": metrics.detection.delay_s,
        "named": metrics.isolation.fault,
        "isolated_s": metrics.isolation.delay_s,
        "axis": axis,
        "before_deg_s": metrics.at(f"tracking.pre_fault_rms_deg_s.{axis}"),
        "after_deg_s": metrics.at(f"tracking.post_fault_rms_deg_s.{axis}"),
        "travel_deg": sum(tracking.surface_travel_deg.values()),
        "work_deg2_per_s": sum(tracking.surface_energy_deg2_s.values()),
        "departed": metrics.departure is not None,
    }


def _better(rows: Mapping[tuple[str, str], Document]) -> list[Document]:
    """The numbers that are better with the scheme and law of the paper, unless the aircraft is lost with
    these. rows: by (case, flown_by)."""
    return [
        {
            "case": paper["case"],
            "quantity": name,
            "unit": unit,
            "paper": paper[key],
            "ours": ours[key],
        }
        for paper, ours in ((rows[case.name, "paper"], rows[case.name, "ours"]) for case in SHOWN)
        for key, name, unit in QUANTITIES
        if not paper["departed"] and or_never(paper[key]) < (1.0 - MATTERS) * or_never(ours[key])
    ]


def _after(row: Document) -> str:
    """The RMS error after the fault, or that the aircraft is lost."""
    return "aircraft lost" if row["departed"] else number(row["after_deg_s"], "deg/s")


COLUMNS = (  # a row a flight
    ("Case", "case"), ("Flown by", "flown_by"), ("Detected after", "detected_s", "s"),
    ("Isolated as", "named"), ("after", "isolated_s", "s"), ("RMS before", "before_deg_s", "deg/s"),
    ("RMS after", _after), ("Surface travel", "travel_deg", "deg"),
    ("Surface work", "work_deg2_per_s", "deg²/s"),
)  # fmt: skip


def sentences(document: Document) -> list[str]:
    """A sentence for each number that is better with the scheme and law of the paper."""
    return [
        f"{row['case']}: {row['quantity']} {number(row['paper'], row['unit'])}, ours "
        f"{number(row['ours'], row['unit'], none='never')}"
        for row in document["paper_better"]
    ]


def alarms_sentence(document: Document) -> str:
    """The false alarms in a sentence."""
    return (
        "False alarms in {healthy_flights} healthy flights at the corners and edges of the published "
        "uncertainty: {false_alarms[paper]} with the scheme of the paper, {false_alarms[ours]} with ours."
    ).format(**document)
