"""The matrix for the terminal."""

from typing import Any

from beaver_ftc.studies.matrix.cases import FAULTS
from beaver_ftc.studies.matrix.summary import surfaces_of

Document = dict[str, Any]
LEGEND = (
    "cell: verdict, delay of the alarm, tracking RMS of the surface's own axis over the oracle's; the worst\n"
    "of all airspeeds. named: surface and type. surface: type still open. open: surface still open. unseen:\n"
    "no alarm, no effect beyond the admitted uncertainty. *: aircraft lost (remarks)."
)


def as_text(document: Document) -> str:
    """Table, legend, remarks and totals."""
    width = max(len(fault) for fault, _ in FAULTS)
    surfaces = surfaces_of(document)
    by_place = {(cell["fault"], cell["surface"]): cell for cell in document["cells"]}
    head = " " * width + "".join(f"  {surface:21}" for surface in surfaces)
    lines = [
        f"{fault:{width}}" + "".join(f"  {_cell(by_place[fault, surface]):21}" for surface in surfaces)
        for fault, _ in FAULTS
    ]
    lines = [line.rstrip() for line in (head, *lines)]
    return "\n".join([*lines, "", LEGEND, "", *_remarks(document), _totals(document)])


def _cell(cell: Document) -> str:
    delay = "     -" if cell["delay_s"] is None else f"{cell['delay_s']:4.2f} s"
    ratio = "" if cell["ratio"] is None else f"{cell['ratio']:.1f}x"
    return f"{cell['verdict']:7} {delay} {ratio:>5}{'*' if cell['lost'] else ''}"


def _remarks(document: Document) -> list[str]:
    said = [cell for cell in document["cells"] if cell["lost"]]
    lines = [f"* {cell['surface']} {cell['fault']}: {cell['remark']}" for cell in said]
    return [*lines, ""] if lines else []


def _totals(document: Document) -> str:
    return (
        f"{len(document['flights'])} faults flown: {document['wrong']} named wrongly, "
        f"{document['false_alarms']} false alarms, "
        f"{len(document['lost_though_the_oracle_was_not'])} lost that the oracle kept"
    )
