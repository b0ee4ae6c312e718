"""Tables of docs/explanation/fault-types.md."""

from statistics import median
from typing import Any

import beaver_ftc as bf
from beaver_ftc.studies.matrix.cells import informed_counts
from beaver_ftc.studies.matrix.fault_matrix import cases, fly_case, matrix_study
from beaver_ftc.studies.matrix.matrix_shown import SHOWN
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import studied

Document = dict[str, Any]
EXAMPLE, AFTER_S = "elevator-stuck", 4.0  # of the candidates over time
PROBED = 3  # one in so many flights: no multiple of the number of surfaces, so that each has its turn


def candidates_over_time() -> str:
    """Types of the named surface that are left, each time since the fault at which one is excluded."""
    scenario = bf.load(EXAMPLE)
    simulation, began_s = bf.Simulation(scenario), scenario.faults[0].at_s
    before: set[str] = set()
    rows = []
    while simulation.t_s < began_s + AFTER_S:
        simulation.step()
        left = dict.fromkeys(one.replace("_", " ") for one in simulation.verdict.candidates)
        if left and set(left) != before:
            gone = sorted(before - set(left))
            after = f"{simulation.t_s - began_s:.2f}"
            rows.append((after, str(len(left)), _types(gone), _types(sorted(left))))
            before = set(left)
    return markdown_table(("time since the fault, s", "types left", "excluded", "still possible"), rows)


def _types(names: list[str]) -> str:
    """Their names; of types of several surfaces only how many there are."""
    if any(":" in name for name in names):
        return f"{len(names)} types, of every surface"
    return ", ".join(names) or "-"


def fault_matrix() -> str:
    """What `beaver-ftc matrix` finds, with exact instruments."""
    return _matrix(declared=False)


def fault_matrix_probe() -> str:
    """A third of these flights at one airspeed: each fault, and each surface, in some of them."""
    return "\n".join(map(_closely, _probed(declared=False)))


def fault_matrix_light() -> str:
    """The same in light turbulence, in words."""
    return _matrix(declared=True, turbulence="light")


def fault_matrix_light_probe() -> str:
    """As many of these flights, and what the informed test tells of them."""
    rows = _probed(declared=True, turbulence="light")
    return "\n".join((*map(_closely, rows), _told(informed_counts(rows))))


def _probed(**instruments: Any) -> list[Document]:
    return [fly_case(case) for case in cases((45.0,), **instruments)[::PROBED]]


def _closely(row: Document) -> str:
    """What became of one flight, to more digits than the table has."""
    ratio = "lost" if row["ratio"] is None else f"{row['ratio']:.6g}"
    told = f" {row['told_chance']:.6g}" if "told_chance" in row else ""  # with declared instruments alone
    return f"{row['surface']} {row['fault']}: {row['verdict']} {row['delay_s']} {ratio}{told}"


def _matrix(declared: bool, turbulence: str = "none") -> str:
    """The table of verdicts by fault and surface, and a summary; in moving air the summary alone."""
    document, _ = studied(matrix_study(declared=declared, turbulence=turbulence))
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
        f"{len(document['flights'])} faults were flown. The diagnosis named {document['wrong']} of them "
        f"wrongly and raised {document['false_alarms']} false alarms. The number of aircraft that were lost "
        f"although the law oracle kept them is {lost}. Half of the {len(delays)} alarms came within "
        f"{median(delays):.2f} s of the fault."
    )


def _told(told: Document) -> str:
    each = ", ".join(f"{name} {one['named']} of {one['seen']}" for name, one in told["by_surface"].items())
    return (
        f"The informed test receives the fault and detects {told['seen']} of the {told['flights']} faults. "
        f"Of these {told['seen']} faults, the diagnosis detects {told['detected']}. It names the right "
        f"surface for {told['named']}: {each}."
    )
