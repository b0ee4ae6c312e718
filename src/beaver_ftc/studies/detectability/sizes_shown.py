"""The size found in a share of flights, by variants of a scenario: as sentences, a table and files."""

from collections.abc import Iterator, Sequence
from math import inf

from beaver_ftc.results.hints import NEAR_THRESHOLD_SHARE
from beaver_ftc.results.model import Document
from beaver_ftc.studies.detectability.shown import NAME, table
from beaver_ftc.studies.present.page import Makers, Page, study_files
from beaver_ftc.studies.present.tables import bare_percent, percent

NOT_FOUND = {  # key of a number of flights: why one of them counts as not found, and why several do
    "false_alarms": ("has an alarm before the loss", "have an alarm before the loss"),
    "failed": ("cannot be flown to the end", "cannot be flown to the end"),
}


def page_of(document: Document) -> Page:
    """The title, and the parts of the page: sentences and table."""
    lines = [
        {
            "loss of": document["surface"], "flown": row["variant"],
            "certain from": percent(row["certain"]["size"]),
            f"found in {percent(document['share'])} from": percent(row["found"]["size"]),
            "95 % interval": _interval(row["found"]),
            "flights": str(row["found"]["flights"]),
        }
        for row in _variants(document)
    ]  # fmt: skip
    title = "Detectability: {surface} of {scenario}".format(**document)
    return title, [*_sentences(document), table(lines)]


def _variants(document: Document) -> list[Document]:
    """The answers for all variants; the document itself is the answer for the scenario as it is."""
    return [document, *document["compared"]]


def _sentences(document: Document) -> Iterator[str]:
    """Sentences about the sizes, about doubts, about the largest limit, and about a reference that would
    help."""
    yield from _sizes(document)
    yield from _doubts(document)
    better = [row for row in document["compared"] if _is_better(row, document)]
    # variants.py has this word in the names of references alone
    references = [row for row in better if "reference" in row["variant"]]
    left_out = [row for row in better if row not in references]
    no_difference = "makes a difference outside of the intervals"
    limit = _effect(left_out, f"nothing that was left out alone {no_difference}")
    yield f"What limits it most: {limit}."
    helpful = _effect(references, f"none of those that were tried {no_difference}")
    yield f"Which reference would help: {helpful}."


def _sizes(document: Document) -> Iterator[str]:
    """A sentence about the size that is certain, and one about the size that a share of the flights find."""
    surface, certain, found, total = (document[key] for key in ("surface", "certain", "found", "total_loss"))
    within = f"within {document['within_s']:g} s"
    nothing = f"not even a total loss of {surface}"
    of_it = f"of the effectiveness of {surface}"
    size = nothing if certain["size"] is None else f"a loss of {percent(certain['size'])} {of_it} and more"
    yield (
        f"Certain to be detected {within}, whatever the declared uncertainty does: {size} (a total loss: in "
        f"{certain['at_total_loss']} of {certain['flights']} flights)."
    )
    size = nothing
    if found["size"] is not None:
        size = f"a loss of {percent(found['size'])} ({_interval(found)}) {of_it}"
    yield (
        f"Found {within} in {percent(document['share'])} of flights: {size} (a total loss: in "
        f"{percent(total['value'])}, {bare_percent(total['low'])} to {percent(total['high'])}; "
        f"{total['count']} of {total['of']} flights). Intervals: 95 %."
    )


def _doubts(document: Document) -> Iterator[str]:
    """Sentences about inconclusive flights, and about those that count as not found."""
    for reason in document["inconclusive"]:
        yield f"Nothing can be concluded in part of these flights: {reason}."
    if document["bound_used"] >= NEAR_THRESHOLD_SHARE:
        yield (
            f"Half of these flights use {percent(document['bound_used'])} of the bound or more before the "
            "loss: the size found then measures the uncertainty that the scenario flies with, not the "
            "diagnosis."
        )
    for key, (of_one, of_several) in NOT_FOUND.items():
        if count := document[key]:
            flights, counts = ("1 flight", "it counts") if count == 1 else (f"{count} flights", "these count")
            reason = of_one if count == 1 else of_several
            yield f"{flights} with a total loss {reason}: {counts} as not found."


def _is_better(variant: Document, document: Document) -> bool:
    """Whether a variant finds smaller losses than the scenario as it is: its interval ends below that of the
    scenario. If the scenario finds no loss often enough, the shares in which a total loss is found are
    compared instead: the interval of the variant begins above that of the scenario."""
    size = variant["found"]
    base = document["found"]
    if base["size"] is None:
        return bool(variant["total_loss"]["low"] > document["total_loss"]["high"])
    return size["high"] is not None and base["low"] is not None and bool(size["high"] < base["low"])


def _effect(variants: Sequence[Document], none: str) -> str:
    """The name of the variant with the smallest size, and this size; `none` without variants. Where no loss
    is found often enough, the variant that finds most total losses counts as the smallest."""
    if not variants:
        return none
    row = min(variants, key=lambda row: (row["found"]["size"] or inf, -row["total_loss"]["value"]))
    size = row["found"]
    total = row["total_loss"]
    if size["size"] is None:
        return f"{row['variant']}, a total loss is found in {percent(total['value'])} of flights"
    return f"{row['variant']}, it would be {percent(size['size'])} ({_interval(size)})"


def _interval(size: Document) -> str:
    """The interval of a size in words; None is beyond a total loss."""
    if size["low"] is None:
        return "more than a total loss"
    if size["low"] == size["high"]:
        return percent(size["low"])
    low = bare_percent(size["low"])
    return f"{low} % or more" if size["high"] is None else f"{low} to {percent(size['high'])}"


def rows_of_sizes(document: Document) -> list[Document]:
    """The rows of the CSV file."""
    return [
        {
            "variant": row["variant"], "found": row["found"], "certain": row["certain"],
            "total_loss_found": row["total_loss"]["value"],
        }
        for row in _variants(document)
    ]  # fmt: skip


FILES: Makers = study_files(NAME, page_of, {NAME: rows_of_sizes}, {})
