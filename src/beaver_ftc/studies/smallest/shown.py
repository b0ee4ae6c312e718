"""The answer in sentences, and as files."""

from collections.abc import Iterator, Sequence

from beaver_ftc.results.metrics import NEAR_THRESHOLD_SHARE
from beaver_ftc.results.model import Document
from beaver_ftc.studies.present.page import Part, Table, study_files
from beaver_ftc.studies.present.tables import aligned, percent

HEAD = ("", "found in 90 %", "95 % interval", "flights", "certain")


def as_text(document: Document) -> str:
    """What is certain, what is found, what limits it, and what would help."""
    return "\n".join([*sentences(document), "", aligned([HEAD, *map(_cells, _answers(document))])])


def _answers(document: Document) -> list[Document]:
    return [document, *document["compared"]]


def sentences(document: Document) -> Iterator[str]:
    """The answers, a sentence each."""
    yield _certain(document)
    yield _found(document)
    yield from (
        f"Nothing can be concluded in part of these flights: {why}." for why in document["inconclusive"]
    )
    if document["bound_used"] >= NEAR_THRESHOLD_SHARE:
        yield (
            f"Half of these flights use {percent(document['bound_used'])} of the bound or more before the "
            f"loss: the size found "
            "then measures the uncertainty that the scenario flies with, not the diagnosis."
        )
    if document["false_alarms"]:
        yield (
            f"In {document['false_alarms']} of {document['total_loss']['of']} flights an alarm came before "
            f"the loss: "
            "these count as not found."
        )
    if document["failed"]:
        yield f"{document['failed']} flights could not be flown to the end: these count as not found."
    yield _limit(document)
    yield _help(document)


def _what(document: Document) -> str:
    return f"of the effectiveness of {document['surface']}"


def _certain(document: Document) -> str:
    certain, within = document["certain"], f"within {document['within_s']:g} s"
    n = certain["flights"]
    if certain["size"] is None:
        return (
            f"Not even a total loss of {document['surface']} is certain to be detected {within}: "
            f"it was in {certain['at_total_loss']} of {n} flights."
        )
    return (
        f"A loss of {percent(certain['size'])} {_what(document)} and more is certain to be detected "
        f"{within}: in each "
        f"of {n} flights, whatever the declared uncertainty does."
    )


def _found(document: Document) -> str:
    found, total, within = document["found"], document["total_loss"], f"within {document['within_s']:g} s"
    if found["size"] is None:
        limits = f"{100 * total['low']:.0f} to {percent(total['high'])}"
        return (
            f"Not even a total loss of {document['surface']} is found {within} in "
            f"{percent(document['share'])} of flights: "
            f"it is in {percent(total['value'])} (95 % interval {limits}; {total['count']} of "
            f"{total['of']})."
        )
    return (
        f"A loss of {percent(found['size'])} {_what(document)} is found {within} in "
        f"{percent(document['share'])} of "
        f"flights (95 % interval {_interval(found)}; {found['flights']} flights)."
    )


def _is_better(other: Document, document: Document) -> bool:
    """Whether a variant finds smaller losses, by intervals that do not overlap; where no loss is found often
    enough, whether a total one is found more often."""
    found, base = other["found"], document["found"]
    if base["size"] is None:
        return bool(other["total_loss"]["low"] > document["total_loss"]["high"])
    return found["high"] is not None and base["low"] is not None and bool(found["high"] < base["low"])


def _best(document: Document, references: bool) -> Document | None:
    """The variant that helps most, of those that change a reference, or of the others."""
    some = [
        row
        for row in document["compared"]
        if ("reference" in row["variant"]) is references and _is_better(row, document)
    ]
    return min(some, key=lambda row: (row["found"]["size"] or 2.0, -row["total_loss"]["value"]), default=None)


def _limit(document: Document) -> str:
    best = _best(document, references=False)
    if best is None:
        return "What limits it: nothing that was left out alone makes a difference outside of the intervals."
    return f"What limits it most: {_effect(best)}."


def _help(document: Document) -> str:
    best = _best(document, references=True)
    if best is None:
        return (
            "Which reference would help: none of those that were tried makes a difference outside of the "
            "intervals."
        )
    return f"Which reference would help: {_effect(best)}."


def _effect(row: Document) -> str:
    found, total = row["found"], row["total_loss"]
    if found["size"] is None:
        return f"{row['variant']}, a total loss is found in {percent(total['value'])} of flights"
    return f"{row['variant']}, it would be {percent(found['size'])} ({_interval(found)})"


def _cells(row: Document) -> Sequence[str]:
    found, certain = row["found"], row["certain"]
    return (
        row["variant"], percent(found["size"]), _interval(found), str(found["flights"]),
        percent(certain["size"]),
    )  # fmt: skip


def _interval(found: Document) -> str:
    if found["low"] is None:
        return "more than a total loss"
    if found["low"] == found["high"]:
        return percent(found["low"])
    low = f"{100.0 * found['low']:.0f}"
    return f"{low} % or more" if found["high"] is None else f"{low} to {percent(found['high'])}"


def page_of(document: Document) -> tuple[str, Sequence[Part]]:
    """The title; the answers and the table."""
    title = f"How small: {document['surface']} of {document['scenario']}"
    return title, [*sentences(document), Table(HEAD, list(map(_cells, _answers(document))))]


def rows_of(document: Document) -> list[Document]:
    """The rows of the CSV file."""
    return [
        {"variant": row["variant"], "found": row["found"], "certain": row["certain"],
         "total_loss_found": row["total_loss"]["value"]}
        for row in _answers(document)
    ]  # fmt: skip


FILES = study_files("smallest", page_of, {"smallest": rows_of}, {})
