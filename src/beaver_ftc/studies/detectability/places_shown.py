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
    points_by_fault = sorted(document["points"], key=itemgetter("fault"))
    points = grouped(points_by_fault, "fault", "excitation").items()
    lines = [
        {"loss of": fault, "flown": _times(scale)} | _spans(rows, "isolated")
        for (fault, scale), rows in points
    ]
    pairs = sorted(document["pairs"], key=itemgetter("fault", "other"))
    for (fault, other, scale), rows in grouped(pairs, "fault", "other", "excitation").items():
        cells = _spans(rows, "magnitude") | {
            "delay": _span(rows, "longest_s", seconds), "half: delay": _span(rows, "median_s", seconds),
            "doublet": _span(rows, "doublet_deg", lambda deg: f"{deg:.1f} deg"),
            "doublet time": _span(rows, "doublet_s", seconds),
        }  # fmt: skip
        lines.append({"loss of": fault, "taken for": other, "flown": _times(scale), **cells})
    picture = Pictures([("smallest loss that is distinguished from each other surface", NAME)])
    sentences = conclusions(document["points"])
    return f"Detectability: {document['scenario']}", [*sentences, table(lines), CERTAIN, picture]


def _times(scale: float) -> str:
    """The excitation in words."""
    return f"{scale:g} x reference"


def _spans(rows: Rows, key: str) -> Line:
    """The cells of a size at every instant, and at half of the instants."""
    return {"certain from": _span(rows, key), "half of onsets from": _span(rows, f"{key}_median")}


def _span(rows: Rows, key: str, form: Callable[[float], str] = percent) -> str:
    """The smallest and the largest value over the places that have one; then (places with a value / all
    places)."""
    values = [row[key] for row in rows if row[key] is not None]
    ends = dict.fromkeys(map(form, (min(values), max(values)))) if values else ["-"]
    return f"{' to '.join(ends)} ({len(values)}/{len(rows)})"


def conclusions(rows: Rows) -> list[str]:
    """One sentence for each fault, at the excitation nearest to the references of the scenario."""
    scale = min((row["excitation"] for row in rows), key=lambda value: abs(value - 1.0))
    chosen = [row for row in rows if row["excitation"] == scale]
    return [_conclusion(fault, scale, group) for (fault,), group in grouped(chosen, "fault").items()]


def _conclusion(fault: str, scale: float, rows: Rows) -> str:
    """The loss that is certain at all places where some loss is, and how many these are."""
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
    """The smallest loss that is certain to be detected, and isolated, at a place, in words."""
    axis = axis_of(scenario, row["fault"])
    shapes = (signal.shape for signal in getattr(scenario.reference, axis))
    sizes = (np.abs(getattr(shape, key, 0.0)).max() for shape in shapes for key in AMPLITUDES)
    reference = f"{row['excitation'] * float(sum(sizes)):g} deg/s of {MOTION_OF_AXIS[axis]}"
    place = f"at {row['airspeed_mps']:g} m/s and {row['altitude_m']:g} m, {reference}"
    fault = row["fault"]
    detected = row["detected"]
    isolated = row["isolated"]
    in_time = f"is certain to be detected within {DETECT_WITHIN_S:g} s"
    if detected is None:
        return f"{place}: not even a total loss of {fault} {in_time} ({row['why']})"
    isolation = "none is certain to be isolated"
    if isolated is not None:
        isolation = f"isolated within {ISOLATE_WITHIN_S:g} s from {upwards(isolated)} on"
    return f"{place}: a loss of {fault} of {upwards(detected)} and more {in_time}, {isolation}"


def upwards(magnitude: float) -> str:
    """A magnitude in per cent, rounded up, so that a sentence guarantees no more than was found. Tables round
    to the nearest."""
    return f"{ceil(100.0 * magnitude - 1e-9)} %"


def draw_pairs(document: Document) -> "Figure":
    """A panel for each excitation. Rows: the surface that loses effectiveness; columns: the other surface."""
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
        for (fault, other), places in grouped(rows, "fault", "other").items():
            at = (faults.index(fault), faults.index(other))
            at_half = [row["magnitude_median"] for row in places]
            values[at] = np.nan if None in at_half else max(at_half)
            texts[at] = "\n".join(reversed(_spans(places, "magnitude").values())), "black"
        look: dict[str, Any] = {"cmap": "viridis_r", "vmin": 0.0, "vmax": 1.0, "alpha": 0.6}
        image = heat_map(axes, values, texts, faults, faults, fontsize=7, **look)
        axes.set_title(_times(scale), fontsize=9)
    label_edges(grid, "taken for", ["loss of"])
    figure.colorbar(image, ax=grid, label="smallest loss (half), share", shrink=0.6)
    return figure


FILES: Makers = study_files(
    NAME, page_of, {NAME: itemgetter("points"), "isolability": itemgetter("pairs")}, {NAME: draw_pairs}
)
