"""Table of docs/explanation/what-cannot-be-found.md: flights in which something stays hidden, or open.

limits.yaml has the flights.
"""

from typing import Any

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table
from tools.data import beside

AT_S, DURATION_S = 12.0, 30.0
CASES = beside(__file__)


def hidden_faults() -> str:
    """A flight each: when the alarm comes, what is named, and what is left."""
    rows = []
    for number, case in enumerate(CASES, 1):
        faults = [fault | {"at_s": AT_S} for fault in case["faults"]]
        given = {**case.get("changes", {}), "faults": faults, "expect": {}, "duration_s": DURATION_S}
        metrics = bf.fly(bf.load(case["scenario"]).with_(given), log=False).metrics
        rows.append((str(number), case["says"], *_outcome(metrics)))
    return markdown_table(("case", "fault and flight", "alarm after, s", "named", "still possible"), rows)


def _outcome(metrics: dict[str, Any]) -> tuple[str, str, str]:
    """Delay of the alarm, name, and what is left."""
    detection, isolation = metrics["detection"], metrics["isolation"]
    if not detection["detected"]:
        return "no alarm", "-", "-"
    named = isolation["fault"] or "no name"
    left = ", ".join(one.replace("_", " ") for one in isolation["candidates"])
    return f"{detection['delay_s']:.2f}", named, left or "none"
