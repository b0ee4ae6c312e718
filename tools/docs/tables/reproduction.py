"""What docs/results/reproduction.md shows of the study that `beaver-ftc reproduce` flies."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from beaver_ftc.studies.engine.study import fly_all
from beaver_ftc.studies.present.page import Summary, Table, write_files
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc.studies.present.tables import number as plain_number
from beaver_ftc.studies.reproduce import beside
from beaver_ftc.studies.reproduce.claims import BORNE_OUT, CANNOT_BE_JUDGED, MEASURED, NOT_BORNE_OUT
from beaver_ftc.studies.reproduce.published_figures import FIGURES, SENSITIVITY, figures_of
from beaver_ftc.studies.reproduce.reproduction import STUDIED, document_of, fly_published, row_of
from beaver_ftc.studies.reproduce.words import (
    adaptation_sentence,
    headline,
    limit,
    measured,
    number,
)
from tools.docs.tables import aside, shared, table_of

Document = dict[str, Any]
IN_WORDS = {  # names of settings and of ablations that the document has, as the page says them
    "Kp halved, Ki to match": "Kp halved and Ki matched",
    "Kp doubled, Ki to match": "Kp doubled and Ki matched",
    "control network_gain halved": "learning gain of the law's network halved",
    "control parametric_gain halved": "learning gain of the law's effectiveness estimate halved",
    "square references, which jump themselves": "square references, which jump",
    "the health (an elevator fault instead)": "nothing is removed; an elevator fault is added",
}
CAPTIONS = {  # of each figure: what it shows, and what to see
    "fig-2a": "Nominal law, no fault. The pitch rate follows its reference",
    "fig-2b": "Nominal law, elevator fault. The pitch rate no longer follows its reference",
    "fig-3": "Detection of the elevator fault. The residual of the pitch rate exceeds its threshold",
    "fig-4a": "Isolation estimator of the aileron, elevator fault. The aileron is excluded",
    "fig-4b": "Isolation estimator of the elevator, elevator fault. The elevator remains the only candidate",
    "fig-4c": "Isolation estimator of the rudder, elevator fault. The rudder is excluded",
    "fig-5": "Fault-tolerant law, elevator fault. After isolation the flap moves in place of the elevator",
    "fig-6": "Nominal law, unanticipated fault. The aircraft departs",
    "fig-7": "Fault-tolerant law, unanticipated fault. The pitch rate follows its reference again",
    "aileron": "Fault-tolerant law, aileron fault. The error of the roll rate grows",
    "rudder": "Fault-tolerant law, rudder fault. The alarm comes later than after the other faults",
    "unanticipated-detection": "Detection of the unanticipated fault after one frame",
    "as-printed": "Detection with equation (2) as printed, no fault. The alarm comes at once",
    SENSITIVITY: "Ratio of number and limit of each testable statement. Left of 1 the number keeps its limit",
}


@shared
def _document() -> Document:
    return dict(document_of(fly_all(row_of, STUDIED, 2)))


def reproduction_headline() -> str:
    """What became of the statements, and what adaptation changes."""
    return f"{headline(_document())}\n\n{adaptation_sentence(_document())}"


def reproduction_not_borne_out() -> str:
    """The statements that do not hold, and why."""
    shown = [claim for claim in measured(_document()) if claim["verdict"] == NOT_BORNE_OUT]
    return markdown_table(("row", "published", "statement", "ours", "limit", "why"), [
        (str(row), claim["where"], claim["statement"], _ours(claim), limit(claim), claim["because"])
        for row, claim in enumerate(shown, 1)
    ])  # fmt: skip


def _ours(claim: Document) -> str:
    """Quantity and number, with a colon between: a cell has no heading that names the quantity."""
    return f"{claim['quantity']}: {number(claim['number'], claim['unit'], claim['none'])}"


def _both(claim: Document) -> tuple[str, str, str, str]:
    """The number as published, its limit, what is removed, and the number then."""
    as_flown, without = (
        number(claim[key], claim["unit"], claim["none"]) for key in ("number", "number_without")
    )
    return as_flown, limit(claim), IN_WORDS.get(claim["without"], claim["without"]), without


def reproduction_not_everywhere() -> str:
    """The testable statements that hold as published, but not in every other setting: in how many, and where
    not."""
    document = _document()
    table = Table(("published", "statement", "settings", "not in"), [
        (claim["where"], claim["statement"].rstrip("."), f"{claim['borne_out_in']} of {claim['elsewhere']}",
         "; ".join(_where_not(document, claim)))
        for claim in measured(document) if claim["verdict"] == BORNE_OUT and not claim["construction"]
    ])  # fmt: skip
    return aside("reproduction-settings", "Statements that hold in some settings", table)


def _where_not(document: Document, claim: Document) -> Iterator[str]:
    for row in document["sensitivity"]:
        for one in (*row["missed"], *row["also_without"]):
            if one["statement"] == claim["statement"]:
                said = IN_WORDS.get(row["variant"], row["variant"])
                yield said + (" (holds without it)" if one in row["also_without"] else "")


def reproduction_unsettled() -> str:
    """The testable statements that hold without their mechanism as well."""
    return markdown_table(("published", "statement", "ours", "limit", "removed", "ours without it"), [
        (claim["where"], claim["statement"].rstrip("."), *_both(claim))
        for claim in measured(_document()) if claim["verdict"] == CANNOT_BE_JUDGED
    ])  # fmt: skip


def reproduction_beside() -> str:
    """The published cases by the paper's scheme and law, and by our defaults."""
    both = _document()["beside"]
    table = table_of(both["rows"], {
        "case": "case", "flown by": "flown_by",
        "isolated after, s": lambda row: plain_number(row["isolated_s"]),
        "RMS before, deg/s": lambda row: plain_number(row["before_deg_s"]),
        "RMS after, deg/s": lambda row: plain_number(row["after_deg_s"]),
        "travel, deg": "travel_deg .0f", "work, deg²/s": "work_deg2_per_s .0f",
    })  # fmt: skip
    return f"{table}\n\n{beside.alarms_sentence(both)}"


def reproduction_figures() -> str:
    """One figure for each published one, and how far each number stays from its limit."""
    write_files(Path("images"), {"reproduction": figures_of(Summary(_document(), fly_published()))})
    titles = [(view.title.partition(":")[0], view.name) for view, _, _ in FIGURES]
    shown = [*titles, ("Numbers and limits", SENSITIVITY)]
    return "\n\n".join(
        f"![{title}](images/reproduction/{name}.png)\n\n*Figure {count}. {_caption(title, name)}.*"
        for count, (title, name) in enumerate(shown, 1)
    )


def _caption(title: str, name: str) -> str:
    """What a figure shows; of a figure of the paper, also its number there."""
    return CAPTIONS[name] + (f" ({title} of the paper)" if title.startswith("Fig.") else "")


def reproduction_probe() -> str:
    """The number of every measured statement in the published flights alone, and ours beside them."""
    published = fly_published()
    said = [f"{claim.statement} {claim.number(published):.6g}" for claim in MEASURED]
    for (case, whose), flown in beside.fly_both().items():
        travel = flown.metrics.tracking.surface_travel_deg
        said.append(f"{case}, {whose}: {sum(travel.values()):.6g} deg")
    return "\n".join(said)
