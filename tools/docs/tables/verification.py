"""The table of docs/results/validation.md: how small a loss is certain to be found."""

from typing import Any

from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.studies.detectability.places import places_study
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import studied


def verification_map() -> str:
    """The smallest losses that are certain to be found, over the envelope."""
    return _surveyed()


def verification_map_probe() -> str:
    """The same at one point of the envelope."""
    return _surveyed(speeds_mps=(44.0,), altitudes_m=(1000.0,))


COUNTED = ("conditions", "best condition, %", "worst condition, %")
SCALES = (0.5, 2.0)  # of the references of `fault-free`


def _surveyed(**where: Any) -> str:
    """The smallest losses that are found, by size of the references."""
    found, _ = studied(places_study(load_scenario("fault-free"), excitations=SCALES, **where))
    rows = found["points"]
    head = (
        "loss of", "references times", "conditions",
        *(f"{when}: {of}" for when in ("every instant", "half of the instants") for of in COUNTED),
    )  # fmt: skip
    faults = dict.fromkeys(row["fault"] for row in rows)
    return markdown_table(head, [
        (fault, f"{scale:g}", str(len(_of(rows, fault, scale))), *_smallest(rows, fault, scale, "isolated"),
         *_smallest(rows, fault, scale, "isolated_median"))
        for fault in faults for scale in SCALES
    ])  # fmt: skip


def _of(rows: list[dict[str, Any]], fault: str, scale: float) -> list[dict[str, Any]]:
    """The points of the envelope of one fault, with references of one scale."""
    return [row for row in rows if (row["fault"], row["excitation"]) == (fault, scale)]


def _smallest(rows: list[dict[str, Any]], fault: str, scale: float, key: str) -> tuple[str, str, str]:
    """At how many points there is such a loss, and from which to which, %."""
    found = [row[key] for row in _of(rows, fault, scale) if row[key] is not None]
    ends = (f"{100 * end:.0f}" for end in (min(found), max(found))) if found else ("-", "-")
    return str(len(found)), *ends
