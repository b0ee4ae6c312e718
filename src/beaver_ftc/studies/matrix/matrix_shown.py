"""The fault matrix as a text and as a heat map: a row for each fault, a column for each surface."""

import numpy as np

from beaver_ftc.results.metrics import as_json
from beaver_ftc.results.model import Document
from beaver_ftc.results.style import VERMILION
from beaver_ftc.studies.present.figures import Figure, heat_map, label_edges, panels
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import grouped, percent, values_of

NAME = "fault-matrix"
SHOWN = {
    "WRONG": "WRONG", "unseen": "not detected", "open": "ambiguous", "surface": "surface", "named": "named"
}  # fmt: skip
"""Words for the verdicts of the document."""

LOOKS = {  # symbol and colour of each verdict; in grey, the lightness orders them
    "WRONG": ("\u2718", VERMILION), "unseen": ("\u2013", "#c9c9c9"), "open": ("?", "#f3d27f"),
    "surface": ("\u25d1", "#c3e1f4"), "named": ("\u2714", "#d3f0e5"),
}  # fmt: skip
VERDICTS = tuple(LOOKS)  # the worst first

LEGEND = (
    "Cell: verdict, delay of the alarm, ratio of the tracking RMS of the surface's own axis to that of the\n"
    "informed law; the worst of all airspeeds. named: surface and type are right. surface: the surface is\n"
    "right, its type not determined. ambiguous: several surfaces remain. not detected: no alarm, the effect\n"
    "stays within the declared uncertainty. WRONG: a wrong name or a false alarm. *: aircraft lost (remarks)."
)
TOLD_LEGEND = (
    "\no: not even the informed test, which knows surface, course and time of the fault, detects it at any\n"
    "airspeed at the same rate of false alarms."
)


def as_text(document: Document) -> str:
    """Table, legend, remarks and totals."""
    surfaces, rows = _table(document)
    width = max(map(len, rows))
    texts = {"": surfaces} | {fault: map(_cell_text, cells) for fault, cells in rows.items()}
    table = [
        f"{name:{width}}" + "".join(f"  {text:26}" for text in texts_of_row)
        for name, texts_of_row in texts.items()
    ]
    lost = [cell for cell in document["cells"] if cell["lost"]]
    remarks = ["* {surface} {fault}: {remark}".format(**cell) for cell in lost]
    totals = (
        "{} faults flown: {wrong} named wrongly, {false_alarms} false alarms, {} aircraft lost although the "
        "law oracle kept it"
    ).format(len(document["flights"]), len(document["lost_though_the_oracle_was_not"]), **document)
    informed = document.get("told")
    legend, share = (LEGEND + TOLD_LEGEND, [_informed_text(informed)]) if informed else (LEGEND, [])
    remark_lines = [*remarks, ""] if remarks else []
    return "\n".join([*map(str.rstrip, table), "", legend, "", *remark_lines, totals, *share])


def _table(document: Document) -> tuple[list[str], dict[str, list[Document]]]:
    """The surfaces; and by fault, its cells in the order of the surfaces."""
    rows = {fault: cells for (fault,), cells in grouped(document["cells"], "fault").items()}
    return values_of(next(iter(rows.values())), "surface"), rows


def _cell_text(cell: Document) -> str:
    """Verdict, delay, tracking ratio and marks of a cell, as LEGEND says."""
    delay = "     -" if cell["delay_s"] is None else f"{cell['delay_s']:4.2f} s"
    ratio = "" if cell["ratio"] is None else f"{cell['ratio']:.1f}x"
    unseen = "o" if cell.get("told") == 0 else ""
    return f"{SHOWN[cell['verdict']]:12} {delay} {ratio:>5}{'*' if cell['lost'] else ''}{unseen}"


def _informed_text(test: Document) -> str:
    """How many faults the informed test detects, and how many of these the diagnosis detects and names."""
    if not test["seen"]:
        return "the informed test, which knows the fault, detects none of them"
    surfaces = ", ".join("{} {named} of {seen}".format(s, **n) for s, n in test["by_surface"].items())
    return (
        "the informed test, which knows the fault, detects {seen} of {flights}. Of these the diagnosis "
        "detects {detected},\nnames the right surface in {named} ({}: {}), and keeps the right type in "
        "{type_kept}"
    ).format(percent(test["share"]), surfaces, **test)


def heat_map_of(document: Document) -> Figure:
    """Colour and symbol show the verdict; the line below them has delay and tracking ratio."""
    from matplotlib.colors import ListedColormap

    surfaces, rows = _table(document)
    grid = np.array([[VERDICTS.index(cell["verdict"]) for cell in cells] for cells in rows.values()])
    labels = {(i, j): _label(cell) for i, cells in enumerate(rows.values()) for j, cell in enumerate(cells)}
    figure, panel = panels(1, 1, 11.0, 0.5 * len(rows) + 1.8)
    colours = ListedColormap([LOOKS[verdict][1] for verdict in VERDICTS])
    upper = len(VERDICTS) - 0.5
    heat_map(panel[0, 0], grid, labels, surfaces, [*rows], cmap=colours, vmin=-0.5, vmax=upper)
    label_edges(panel, titles=["Each fault on each surface: alarm delay, tracking RMS / the informed law's"])
    return figure


def _label(cell: Document) -> tuple[str, str]:
    """The text of a cell, and its colour."""
    verdict = cell["verdict"]
    lost = ", LOST" if cell["lost"] else ""
    delay = "" if cell["delay_s"] is None else f"{cell['delay_s']:.2f} s"
    ratio = "" if cell["ratio"] is None else f"tracking {cell['ratio']:.1f}"
    small = ", ".join(filter(None, (delay, ratio)))
    ink = "white" if verdict == "WRONG" else "black"
    return f"{LOOKS[verdict][0]} {SHOWN[verdict]}{lost}\n{small}", ink


FILES: Makers = {
    f"{NAME}.json": as_json,
    f"{NAME}.txt": lambda document: as_text(document) + "\n",
    f"{NAME}.png": heat_map_of,
}
