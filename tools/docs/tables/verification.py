"""The table of docs/results/verification.md: how small a loss is certain to be found."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from beaver_ftc.scenario.loader import load_scenario
from beaver_ftc.studies.detectability import run_survey
from beaver_ftc.studies.present.tables import markdown_table


def verification_map() -> str:
    """The smallest losses that are certain to be found, over the envelope."""
    return _surveyed()


def verification_map_probe() -> str:
    """The same at one point of the envelope."""
    return _surveyed(speeds_mps=(44.0,), altitudes_m=(1000.0,))


SCALES = (0.5, 2.0)  # of the references of `fault-free`


def _surveyed(**where: Any) -> str:
    with TemporaryDirectory() as folder:
        found = run_survey(Path(folder), load_scenario("fault-free"), excitations=SCALES, **where)
    return _map_of(found["points"])


def _map_of(rows: list[dict[str, Any]]) -> str:
    head = ("loss of", "references times", "certain at", "from", "half the time at", "from")
    faults = dict.fromkeys(row["fault"] for row in rows)
    return markdown_table(head, [
        (fault, f"{scale:g}", *_smallest(rows, fault, scale, "isolated"),
         *_smallest(rows, fault, scale, "isolated_median"))
        for fault in faults for scale in SCALES
    ])  # fmt: skip


def _smallest(rows: list[dict[str, Any]], fault: str, scale: float, key: str) -> tuple[str, str]:
    """At how many points there is such a loss, and from which to which."""
    here = [row[key] for row in rows if (row["fault"], row["excitation"]) == (fault, scale)]
    found = [magnitude for magnitude in here if magnitude is not None]
    return f"{len(found)}/{len(here)}", f"{min(found):.2f}-{max(found):.2f}" if found else "-"
