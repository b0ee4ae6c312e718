"""The table of benchmark.md: what a second tuning brings."""

from pathlib import Path
from typing import Any

from beaver_ftc.documents.files import read_json
from beaver_ftc.studies.compare.tune import LEAST_GAIN
from tools.docs.tables import aside, head_and_rows

Document = dict[str, Any]

TUNING = Path(__file__).parents[3] / "benchmarks" / "tuning.json"  # how the values in tuned.json were found


def _judged_on(again: Document) -> str:
    """The draws on which a second tuning is judged: those after the ones that it flew."""
    first = again["draw"] + again.get("draws", 1)
    return f"{first} to {first + again['judged'] - 1}"


GAINS = {
    "method": "name", "grade": "grade", "draw": "draw",
    "judged on": _judged_on,
    "flights": "flights", "cost, before": "built_in .3f", "cost, after": "retuned .3f",
    "gain, %": "gain *100 .1f", "from, %": "gain_low *100 .1f", "to, %": "gain_high *100 .1f",
    "adopted": lambda again: "yes" if again.get("gain", 0.0) > LEAST_GAIN else "no",
}  # fmt: skip


def benchmark_gains() -> str:
    """By how much the cost of a method falls that is tuned again, on flights of its own: of every search that
    finds other values, as the record of the searches has it."""
    rows = read_json(TUNING)["methods"]
    found = [{**row, **again} for row in rows for again in row["again"] if again.get("gain")]
    last = {
        _pair(row): row["again"][-1]
        for row in rows
        if row["again"] and row["again"][-1]["draw"] != row.get("draw")
    }
    kept = sum(again.get("gain") == 0.0 for again in last.values())
    none = [pair for pair, again in last.items() if "gain" not in again]
    drawn = [f"{_pair(row)} (draw {row['draw']})" for row in rows if "draw" in row]
    says = (
        f"The table leaves out searches that found no better values. Of {len(rows)} pairs of method and "
        f"grade, {len(last)} were tuned again after their last change. The last search found no better "
        f"values for {kept}, no admissible values for {', '.join(none)}, and values that were not adopted "
        f"for {len(last) - kept - len(none)}. A second tuning found the values of {', '.join(drawn)}."
    )
    table = head_and_rows(found, GAINS)
    return f"{aside('benchmark-gains', 'Gain of a second tuning', table)}\n\n{says}"


def _pair(row: Document) -> str:
    """What was tuned, and on what: a scheme and a law may have one name."""
    return f"{'the law ' if row['kind'] == 'laws' else ''}`{row['name']}` on `{row['grade']}`"
