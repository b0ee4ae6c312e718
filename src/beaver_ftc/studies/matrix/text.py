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
TOLD_LEGEND = (
    " o: not even a test that\nis told surface, course and instant sees it at any airspeed, at the same rate "
    "of false alarms."
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
    told = document.get("told")
    legend, share = (LEGEND + TOLD_LEGEND, [_told(told)]) if told else (LEGEND, [])
    return "\n".join([*lines, "", legend, "", *_remarks(document), _totals(document), *share])


def _cell(cell: Document) -> str:
    delay = "     -" if cell["delay_s"] is None else f"{cell['delay_s']:4.2f} s"
    ratio = "" if cell["ratio"] is None else f"{cell['ratio']:.1f}x"
    unseen = "o" if cell.get("told") == 0 else ""
    return f"{cell['verdict']:7} {delay} {ratio:>5}{'*' if cell['lost'] else ''}{unseen}"


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


def _told(told: Document) -> str:
    """How many of the faults that can be seen are named."""
    if not told["seen"]:
        return "a test that is told the fault sees none of them"
    surfaces = ", ".join(f"{s} {of['named']} of {of['seen']}" for s, of in told["by_surface"].items())
    return (
        f"a test that is told the fault sees {told['seen']} of {told['flights']}; {told['detected']} "
        f"of these are detected,\nthe right surface is named in {told['named']} "
        f"({100 * told['share']:.0f} %: {surfaces}), the right type is kept in {told['type_kept']}"
    )
