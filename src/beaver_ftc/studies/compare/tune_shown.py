"""The searches of `compare --tune` as text: a table, and remarks about searches that need one."""

from collections.abc import Callable, Iterator

from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.criteria import FAILED, INADMISSIBLE
from beaver_ftc.studies.present.tables import Columns, aligned, tabulated


def as_text(document: Document) -> str:
    """A line for each method and grade; then remarks about widened ranges, searches that found nothing
    better, and searches that the budget ended."""
    columns = (*COLUMNS, *(GAINS if document["draw"] else ()), VALUES)
    table, rows = tabulated(columns, document["methods"])
    remarks = [sentence for row in document["methods"] for sentence in _remarks(row)]
    head = (
        "up to {trials} trials a search, seed {seed}, up to {restarts} restarts for each method and grade"
    ).format(**document)
    return "\n".join([head, "", aligned([table, *rows]), *remarks])


def _remarks(row: Document) -> Iterator[str]:
    """What a reader should know about a search, a sentence each."""
    who = "{name}, {grade}".format(**row)
    if row["widened"]:
        yield f"{who}: on the edge of its range, widened: {', '.join(row['widened'])}"
    if row["cost"] >= row["start_cost"]:
        yield f"{who}: no better values were found in {row['trials']} trials"
    if not row["settled"]:
        yield f"{who}: the budget ended the search; more --restarts may find a lower cost"


def _cost_text(cost: float) -> str:
    """A cost as text; in words for a candidate that is inadmissible or cannot be flown."""
    if cost >= FAILED:
        return "cannot fly"
    if cost >= INADMISSIBLE:
        return "inadmissible"
    return f"{cost:.3f}"


def _if_any(form: Callable[[Document], str], key: str) -> Callable[[Document], str]:
    """The cell of a row that has this key; `-` in another row."""
    return lambda row: form(row) if key in row else "-"


def _cost(key: str) -> Callable[[Document], str]:
    """The cell of a cost."""
    return _if_any(lambda row: _cost_text(row[key]), key)


def _percent(key: str) -> Callable[[Document], str]:
    """The cell of a share in per cent."""
    return _if_any(lambda row: f"{100.0 * row[key]:.1f}", key)


COLUMNS: Columns = (
    ("grade", "grade"), ("method", "name"), ("cost at the start", _cost("start_cost")),
    ("cost found", _cost("cost")),
    ("margins dB, deg", _if_any("{gain_margin_db:.1f}, {phase_margin_deg:.0f}".format_map, "gain_margin_db")),
)  # fmt: skip
# Columns of methods that were tuned again: both costs on other flights, and the gain with its interval.
GAINS: Columns = (
    ("cost, built in", _cost("built_in")), ("cost, retuned", _cost("retuned")),
    ("gain, %", _percent("gain")), ("from, %", _percent("gain_low")), ("to, %", _percent("gain_high")),
)  # fmt: skip
VALUES = ("values", lambda row: ", ".join(f"{key} {value:.4g}" for key, value in row["values"].items()))
