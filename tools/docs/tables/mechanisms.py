"""What docs/results/mechanisms.md shows of the study of `beaver-ftc sensitivity --mechanisms`."""

from typing import Any

from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table, number
from beaver_ftc.studies.sensitivity import mechanisms_shown as shown
from beaver_ftc.studies.sensitivity.command import mechanisms_study
from beaver_ftc.studies.sensitivity.mechanisms import DRAWS, Flight, fly_one
from beaver_ftc.studies.sensitivity.systems import DIAGNOSIS, LAW
from tools.docs.tables import aside, picture, shared, studied

Document = dict[str, Any]
SEED = 1
SEEDS = (SEED,)  # of all results on the pages
PROBED = (
    Flight("loss 40 %", "high", 0.0, "exact sensors", 1),
    Flight("unanticipated", "low", 0.02, "real sensors", 0),
)
GROUPS = {  # some criterion is worse, some is better without the mechanism: title
    (True, False): "Mechanisms that help",
    (True, True): "Mechanisms that help by one criterion and cost by another",
    (False, True): "Mechanisms that cost",
    (False, False): "Mechanisms that change no criterion beyond chance",
}
NO_CRITERION = ", and no criterion changes beyond chance"  # the title of the last group says it
_PICTURED = (
    "Net share of flights that are worse without each mechanism, by four criteria, with 95 % intervals"
)


@shared
def _flown() -> tuple[Document, dict[str, bytes]]:
    return studied(mechanisms_study(DRAWS, SEED), 2)


def mechanisms_findings() -> str:
    """What each mechanism is worth, in sentences; and the figure."""
    document, drawn = _flown()
    flown, *_, explained = shown.mechanism_sentences(document)
    pictured = picture("mechanisms.png", _PICTURED, drawn[f"{shown.NAME}.png"])
    return f"{flown}\n\n{_grouped(document)}\n\n{explained}\n\n{pictured}"


def _grouped(document: Document) -> str:
    """The sentence of each mechanism, below the title of its group."""
    groups: dict[str, list[str]] = {title: [] for title in GROUPS.values()}
    for row in document["mechanisms"]:
        found = shown.mechanism_sentence(row)
        groups[GROUPS[_signs(row)]].append(f"- {found[0].upper()}{found[1:]}".replace(NO_CRITERION, ""))
    return "\n\n".join("\n".join([f"{title}:", "", *says]) for title, says in groups.items() if says)


def _signs(row: Document) -> tuple[bool, bool]:
    """Whether a criterion is worse without the mechanism beyond chance, and whether one is better."""
    found = [row[name] for name in shown.CRITERION_WORDS]
    return any(one["low"] > 0.0 for one in found), any(one["high"] < 0.0 for one in found)


def mechanisms_systems() -> str:
    """Both systems with all of their mechanisms."""
    systems = shown.tables(_flown()[0])["systems"]
    return markdown_table(systems.head, systems.rows)


ASIDES = {
    "net": "T0: net share by each criterion, points, with intervals",
    "same": "T1: flights in which a mechanism changes nothing",
    "medians": "T2: medians of delay and tracking error, with and without each mechanism",
    "by-instruments": "T3: net share of late alarms by instruments, points",
    "by-error": "T4: net share of lost names by undeclared error, points",
    "by-fault": "T5: net share of worse tracking by fault, points",
    "by-bandwidth": "T6: net share of worse tracking by bandwidth, points",
    "margins": "T7: stability margins of the healthy loop",
    "alarms": "T8: false alarms, complete and without each mechanism",
}
LEVELS = {
    "by-instruments": ("instruments", "late", DIAGNOSIS), "by-error": ("error", "names", DIAGNOSIS),
    "by-fault": ("fault", "tracking", LAW), "by-bandwidth": ("bandwidth", "tracking", LAW),
}  # fmt: skip


def mechanisms_asides() -> str:
    """Further tables, as CSV."""
    document = _flown()[0]
    tables = shown.tables(document) | {name: _by_level(document, *of) for name, of in LEVELS.items()}
    return "\n".join(aside(f"mechanisms-{name}", says, tables[name]) for name, says in ASIDES.items())


def _by_level(document: Document, factor: str, criterion: str, serves: str) -> Table:
    """By level of a factor, the net share by a criterion, of the mechanisms that serve diagnosis or law."""
    levels = document["factors"][factor]
    names = [f"error {100 * level:g} %" if factor == "error" else str(level) for level in levels]
    rows = [
        [shown.label(row), *(c for of in row["by"][factor].values() for c in shown.net_points(of[criterion]))]
        for row in document["mechanisms"]
        if row["serves"] == serves
    ]
    return Table(("mechanism", *(head for name in names for head in (name, shown.INTERVAL))), rows)


def mechanisms_probe() -> str:
    """A few flights of the survey, to more digits."""
    return "\n".join(
        f"{key}: {outcome['verdict']} {number(outcome['tracking_deg_s'], none='lost', digits=6)}"
        for flight in PROBED
        for key, outcome in fly_one(SEED, flight).items()
    )
