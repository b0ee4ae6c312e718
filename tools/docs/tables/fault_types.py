"""Tables of docs/explanation/fault-types.md."""

from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from beaver_ftc.studies.matrix.fault_matrix import SHOWN, run_matrix
from beaver_ftc.studies.present.tables import markdown_table

Document = dict[str, Any]


def fault_matrix() -> str:
    """What `beaver-ftc matrix` finds, with exact instruments."""
    return _matrix(declared=False)


def fault_matrix_light() -> str:
    """The same in light turbulence, in words."""
    return _matrix(declared=True, turbulence="light")


def _matrix(declared: bool, turbulence: str = "none") -> str:
    with TemporaryDirectory() as folder:
        document = run_matrix(Path(folder), declared=declared, turbulence=turbulence)
    cells = {(cell["fault"], cell["surface"]): cell for cell in document["cells"]}
    surfaces = list(dict.fromkeys(surface for _, surface in cells))
    table = markdown_table(
        ("fault", *surfaces),
        [
            (fault, *(_verdict(cells[fault, surface]) for surface in surfaces))
            for fault in dict.fromkeys(name for name, _ in cells)
        ],
    )
    says = " ".join((_summary(document), *([_told(document["told"])] if declared else [])))
    return says if turbulence != "none" else f"{table}\n\n{says}"


def _verdict(cell: Document) -> str:
    return f"{SHOWN[cell['verdict']]}{'*' if cell['lost'] else ''}"


def _summary(document: Document) -> str:
    delays = [row["delay_s"] for row in document["flights"] if row["delay_s"] is not None]
    lost = len(document["lost_though_the_oracle_was_not"])
    return (
        f"{len(document['flights'])} faults flown: {document['wrong']} named wrongly, "
        f"{document['false_alarms']} false alarms, {lost} lost that the oracle kept. Half of {len(delays)} "
        f"alarms came within {median(delays):.2f} s."
    )


def _told(told: Document) -> str:
    each = ", ".join(f"{name} {one['named']} of {one['seen']}" for name, one in told["by_surface"].items())
    return (
        f"The informed test, which knows the fault, detects {told['seen']} of them. Of these the diagnosis "
        f"detects {told['detected']}, and names the right surface in {told['named']}: {each}."
    )
