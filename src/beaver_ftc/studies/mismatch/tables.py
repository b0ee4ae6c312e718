"""The mismatch as tables and sentences, for the terminal and as a section of `report.html`."""

from functools import partial
from pathlib import Path

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import read_json
from beaver_ftc.results.model import Document
from beaver_ftc.results.terminal import printed
from beaver_ftc.results.words import value_text, without_underscores
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.present import page
from beaver_ftc.studies.present.tables import number, plain, seconds, tabulated

WIDTH = 150

PICTURES = {
    "mismatch-sources": "What the mismatch is made of, in time",
    "mismatch-bound": "How much of the bound each source uses",
    "mismatch-linear": "Poles and frequency responses: truth, FDC equations, design model",
}
Table = tuple[str, list[str], list[list[str]]]  # caption, head, rows


def share_text(share: float | None) -> str:
    """A share in per cent, with two digits below 10 %. None: the bound is zero where the share is largest."""
    if share is None:
        return "no bound"
    value = 100.0 * share
    if 0.0 < value < 0.001:
        return "<0.001 %"
    return f"{value:.0f} %" if value >= 9.95 else f"{value:.2g} %"


def mismatch_text(document: Document, folder: str, colour: bool) -> str:
    """The results of one flight for the terminal: tables of sources, bound and modes, then sentences."""
    text = printed([plain(*table) for table in tables(document)], WIDTH, colour)
    return "\n".join([text, "", *findings(document), f"results      {folder}", ""])


def findings(document: Document) -> list[str]:
    """The results in sentences, for the terminal and the page."""
    worst = document["dominant"]
    dominant = "nothing: truth and design agree"
    if worst is not None:
        source = without_underscores(worst["source"])
        dominant = f"{source}: {share_text(worst['bound_share'])} of the bound on {worst['axis']}"
    lines = [f"dominant     {dominant}"]
    if document["false_alarm"]:
        detection = document["detection"]
        lines.append(f"FALSE ALARM  at {detection['time_s']:.2f} s on {detection['axis'] or 'no axis'}")
    return [*lines, *_advice(document)]


def _advice(document: Document) -> list[str]:
    """The recommended bound, and the published elevator case with the declared and the recommended bound."""
    recommended = document["recommended"]
    guarantee = document["guarantee"]
    constant = "  ".join(f"{axis} {recommended['constant_rad_s2'][axis]:g}" for axis in AXES)
    doubt = "" if recommended["settled"] else ", still exceeded when flown"
    advised = f"recommended  constant bound {constant} rad/s2, from {recommended['runs']} run(s){doubt}"
    with_declared, with_recommended = (_case(guarantee[bound]) for bound in ("declared", "recommended"))
    if with_declared == with_recommended:
        return [advised, f"published elevator case with either bound: {with_declared}"]
    return [
        advised,
        f"published elevator case with the declared bound: {with_declared}",
        f"published elevator case with the recommended bound: {with_recommended}",
    ]


def _case(case: Document) -> str:
    """The outcome of the published elevator case."""
    if case["false_alarm"]:
        return "FALSE ALARM before the fault"
    detected, certain = case["detection_delay_s"], case["guaranteed_delay_s"]
    alarm = "not detected" if detected is None else f"detected after {detected:.2f} s"
    latest = "never certain" if certain is None else f"certain within {certain:.2f} s"
    return f"{alarm}, {latest}"


def _reason(exceedances: list[Document]) -> str:
    """The source of the largest of the listed exceedances (MAX_EXCEEDANCES of split.py). A ratio that is None
    is infinite: the bound is 0."""
    if not exceedances:
        return "-"
    largest = max(exceedances, key=lambda exceedance: or_never(exceedance["peak_ratio"]))
    return without_underscores(largest["source"])


def _needed(axis: str, entry: Document) -> str:
    """The largest share of the bound on an axis, and the smallest constant that covers the flight, rad/s2."""
    return f"{share_text(entry[f'{axis}_worst_ratio'])} / {entry[f'{axis}_smallest_constant_rad_s2']:.3g}"


_4_DIGITS = "{:.4g}".format
# Columns of an axis: its constant bound, the smallest one that covers the flight, the largest share of the
# bound, and exceedances.
BOUNDS = (
    ("axis", "axis"), ("constant", "constant_rad_s2", _4_DIGITS),
    ("smallest", "smallest_constant_rad_s2", _4_DIGITS), ("worst", "worst_ratio", share_text),
    ("at", "worst_at_s", seconds), ("exceeded", "exceeded_s", seconds), ("times", "exceeded_times"),
    ("because of", "exceedances", _reason),
)  # fmt: skip
# Columns of a mode: frequency and damping of the truth, and deviations of the other models.
MODES = (
    ("mode", "mode", without_underscores), ("truth rad/s", "truth.frequency_rad_s", _4_DIGITS),
    ("damping", "truth.damping", "{:.3g}".format), ("FDC off by", "deviation.fdc", share_text),
    ("design off by", "deviation.design", share_text),
    ("JSBSim's own off by", "jsbsim_own_deviation", share_text),
)  # fmt: skip
# Columns of a run: largest share of the bound and smallest constant of each axis, source, alarm and
# guarantee.
RUNS = (
    ("run", "scenario"), *((axis, partial(_needed, axis)) for axis in AXES),
    ("dominant", "dominant", lambda source: without_underscores(source or "-")),
    ("false alarm", "false_alarm", value_text),
    (
        "certain within",
        lambda entry: "void" if entry["guarantee_void"] else seconds(entry["guaranteed_delay_s"]),
    ),
)  # fmt: skip


def tables(document: Document) -> list[Table]:
    """The sources, the bound and the modes, for the terminal and the page."""
    linear = document["linear"]
    bounds = [{"axis": axis} | numbers for axis, numbers in document["bound"].items()]
    modes = [{"mode": name} | numbers for name, numbers in linear["modes"].items()]
    place = "modes at trim, {airspeed_mps:g} m/s and {altitude_m:g} m".format(**linear)
    return [
        _sources(document),
        ("the bound, without the fault (constants in rad/s2)", *tabulated(BOUNDS, bounds)),
        (place, *tabulated(MODES, modes)),
    ]


def _sources(document: Document) -> Table:
    """RMS, largest value and share of the bound of every source that is not zero, and of its parts."""
    caption = f"{document['scenario']}: truth less design (1e-3 rad/s2; share of the bound)"
    head = ["source", *(f"{axis} {quantity}" for axis in AXES for quantity in ("rms", "max", "bound"))]
    rows = []
    for name in document["axes"]["p"]:  # as on every axis
        per_axis = [document["axes"][axis][name] for axis in AXES]
        if any(numbers["max"] > 0.0 for numbers in per_axis):
            rows.append(_row(without_underscores(name), per_axis))
        for part in per_axis[0].get("parts", {}):
            rows.append(_row(f"  {part}", [numbers["parts"][part] for numbers in per_axis]))
    return caption, head, rows


def _row(name: str, per_axis: list[Document]) -> list[str]:
    """A row of a source or part, three cells for each axis."""
    row = [name]
    for numbers in per_axis:
        cells = number(1e3 * numbers["rms"]), number(1e3 * numbers["max"]), share_text(numbers["bound_share"])
        row += ["-"] * len(cells) if numbers["max"] == 0.0 else cells
    return row


def comparison_text(entries: list[Document], recommended: Document, folder: str, colour: bool) -> str:
    """Several flights side by side, and the bound that covers all of them."""
    caption = "worst share of the bound / smallest constant bound in rad/s2"
    table = printed([plain(caption, *tabulated(RUNS, entries))], WIDTH, colour)
    return "\n".join([table, "", *_advice(recommended), f"results      {folder}", ""])


def mismatch_section(folder: Path) -> str:
    """The section of a result folder as HTML; empty if the folder has no mismatch.json."""
    path = folder / "mismatch.json"
    if not path.exists():
        return ""
    document = read_json(path)
    images = page.drawn_in(folder, PICTURES)
    parts = [part for caption, head, rows in tables(document) for part in (caption, page.Table(head, rows))]
    heading = page.Heading(f"Truth against design: {document['scenario']}")
    pictures = page.Pictures([(PICTURES[name], name) for name in images])
    body = page.html_of([heading, *findings(document), *parts, pictures], images)
    return f"<section><style>.figures img {{ max-width: 100% }}</style>{body}</section>"
