"""The losses that are certain to be found, by places: as sentences, a table, a figure and files."""

from collections.abc import Callable, Sequence
from math import ceil
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.expectations import MOTION_OF_AXIS
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.certain import AMPLITUDES, DETECT_WITHIN_S, ISOLATE_WITHIN_S, axis_of
from beaver_ftc.studies.detectability.isolability import DISTINGUISHED_LOSS
from beaver_ftc.studies.detectability.shown import NAME, Line, table
from beaver_ftc.studies.present.figures import heat_map, label_edges, panels
from beaver_ftc.studies.present.page import Makers, Part, Pictures, study_files
from beaver_ftc.studies.present.tables import grouped, percent, seconds

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Rows = Sequence[Document]
CERTAIN = (
    "From the smallest loss at the best place to that at the worst, of so many places where some loss is\n"
    "certain to be detected and isolated in time, whenever it starts and at half of the start times.\n"
    "Taken for: the same until the other surface alone is excluded. Delay: until a total loss excludes it.\n"
    f"Doublet: the smallest that distinguishes losses of {percent(DISTINGUISHED_LOSS)} in straight flight."
)


def page_of(document: Document) -> tuple[str, Sequence[Part]]:
    """The title, and the parts of the page: sentences, table, notes and picture."""
    of_faults = sorted(document["points"], key=itemgetter("fault"))
    points = grouped(of_faults, "fault", "excitation").items()
    lines = [
        {"loss of": fault, "flown": _times(scale)} | _spans(of, "isolated") for (fault, scale), of in points
    ]
    of_pairs = sorted(document["pairs"], key=itemgetter("fault", "other"))
    for (fault, other, scale), of in grouped(of_pairs, "fault", "other", "excitation").items():
        shown = _spans(of, "magnitude") | {
            "delay": _span(of, "longest_s", seconds), "half: delay": _span(of, "median_s", seconds),
            "doublet": _span(of, "doublet_deg", lambda deg: f"{deg:.1f} deg"),
            "doublet time": _span(of, "doublet_s", seconds),
        }  # fmt: skip
        lines.append({"loss of": fault, "taken for": other, "flown": _times(scale), **shown})
    drawn = Pictures([("smallest loss that is distinguished from each other surface", NAME)])
    said = conclusions(document["points"])
    return f"Detectability: {document['scenario']}", [*said, table(lines), CERTAIN, drawn]


def _times(scale: float) -> str:
    return f"{scale:g} x reference"


def _spans(rows: Rows, key: str) -> Line:
    return {"certain from": _span(rows, key), "half of onsets from": _span(rows, f"{key}_median")}


def _span(rows: Rows, key: str, form: Callable[[float], str] = percent) -> str:
    """From the least to the largest value over the places that have one, and how many these are."""
    known = [row[key] for row in rows if row[key] is not None]
    ends = dict.fromkeys(map(form, (min(known), max(known)))) if known else ["-"]
    return f"{' to '.join(ends)} ({len(known)}/{len(rows)})"


def conclusions(rows: Rows) -> list[str]:
    """One sentence a fault, at the excitation nearest to the scenario's own references."""
    scale = min((row["excitation"] for row in rows), key=lambda of: abs(of - 1.0))
    chosen = [row for row in rows if row["excitation"] == scale]
    return [_conclusion(fault, scale, of) for (fault,), of in grouped(chosen, "fault").items()]


def _conclusion(fault: str, scale: float, rows: Rows) -> str:
    certain = [row["isolated"] for row in rows if row["isolated"] is not None]
    reference = "the scenario's references" if scale == 1.0 else f"{scale:g} times the scenario's references"
    if not certain:
        worst = min(rows, key=lambda row: (row["detected"] is not None, row["why"]))
        return f"{fault}: at {reference} no loss is certain to be detected and isolated ({worst['why']})."
    places = "all" if len(certain) == len(rows) else f"{len(certain)} of"
    return (
        f"{fault}: at {reference} a loss of {upwards(max(certain))} or more is certain to be detected and "
        f"isolated at {places} {len(rows)} places."
    )


def answer(scenario: Scenario, row: Document) -> str:
    """The loss from which on a surface's fault is certain to be found at a place, in words."""
    axis = axis_of(scenario, row["fault"])
    shapes = (signal.shape for signal in getattr(scenario.reference, axis))
    sizes = (np.abs(getattr(shape, key, 0.0)).max() for shape in shapes for key in AMPLITUDES)
    asked = f"{row['excitation'] * float(sum(sizes)):g} deg/s of {MOTION_OF_AXIS[axis]}"
    place = f"at {row['airspeed_mps']:g} m/s and {row['altitude_m']:g} m, {asked}"
    fault = row["fault"]
    detected = row["detected"]
    isolated = row["isolated"]
    soon = f"is certain to be detected within {DETECT_WITHIN_S:g} s"
    if detected is None:
        return f"{place}: not even a total loss of {fault} {soon} ({row['why']})"
    named = "none is certain to be isolated"
    if isolated is not None:
        named = f"isolated within {ISOLATE_WITHIN_S:g} s from {upwards(isolated)} on"
    return f"{place}: a loss of {fault} of {upwards(detected)} and more {soon}, {named}"


def upwards(magnitude: float) -> str:
    """A magnitude for which the promise holds: rounded up to per cent."""
    return f"{ceil(100.0 * magnitude - 1e-9)} %"


def geometry(pairs: Rows) -> list[str]:
    """A sentence a pair of surfaces, of those that `in_trim.alike` finds."""
    lines = []
    for pair in pairs:
        apart = {name: x for name, x in pair["told_apart_from_deg"].items() if x is not None}
        told = " or ".join(f"{name} is at least {x:.2g} deg off its command" for name, x in apart.items())
        never = "never distinguish them" + (", accelerometers do" if pair["by_forces"] else "")
        says = f"distinguish them if {told}" if told else never
        lines.append(f"{' and '.join(pair['surfaces'])} have similar effects on the rates: the rates {says}")
    return lines


def of_engines(failures: Rows) -> list[str]:
    """A sentence an engine, of those of `in_trim.engine_failures`."""
    return [
        f"{of['engine']} failed to idle accelerates the aircraft by {max(of['turns_rad_s2']):.2g} rad/s2, "
        f"{of['shows']:.2g} times the detection limit of one frame"
        + ("; the design model knows its moment" if of["known"] else "")
        + (" and monitors it against the thrust" if of["held"] else "")
        for of in failures
    ]


def draw_pairs(document: Document) -> "Figure":
    """A panel an excitation: rows what loses effectiveness, columns what it could be taken for."""
    pairs = grouped(document["pairs"], "excitation")
    faults = [*dict.fromkeys(row["fault"] for row in document["pairs"])]
    title = (
        f"{document['scenario']}: smallest loss distinguished from that of another surface, and places\n"
        "(upper numbers: at half of the instants; lower numbers: at every instant; hatched: no loss)"
    )
    size = len(pairs) * (1.55 * len(faults) + 0.3) + 1.2, 0.65 * len(faults) + 1.6
    figure, grid = panels(1, len(pairs), *size, title, sharey=True)
    for axes, ((scale,), rows) in zip(grid[0], pairs.items(), strict=True):
        values = np.full((len(faults), len(faults)), np.nan)
        texts = {}
        for (fault, other), of in grouped(rows, "fault", "other").items():
            at = (faults.index(fault), faults.index(other))
            half = [row["magnitude_median"] for row in of]
            values[at] = np.nan if None in half else max(half)
            texts[at] = "\n".join(reversed(_spans(of, "magnitude").values())), "black"
        look: dict[str, Any] = {"cmap": "viridis_r", "vmin": 0.0, "vmax": 1.0, "alpha": 0.6}
        image = heat_map(axes, values, texts, faults, faults, 7, **look)
        axes.set_title(_times(scale), fontsize=9)
    label_edges(grid, "taken for", ["loss of"])
    figure.colorbar(image, ax=grid, label="smallest loss (half), share", shrink=0.6)
    return figure


FILES: Makers = study_files(
    NAME, page_of, {NAME: itemgetter("points"), "isolability": itemgetter("pairs")}, {NAME: draw_pairs}
)
