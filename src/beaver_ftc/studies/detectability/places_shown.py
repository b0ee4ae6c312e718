"""The losses that are certain to be found, by places: as sentences, a table and files."""

from collections.abc import Iterator, Sequence
from math import ceil
from operator import itemgetter

import numpy as np

from beaver_ftc.results.model import Document
from beaver_ftc.results.words import MOTION_OF_AXIS
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.certain import AMPLITUDES, DETECT_WITHIN_S, ISOLATE_WITHIN_S, axis_of
from beaver_ftc.studies.detectability.figures import draw_pairs
from beaver_ftc.studies.detectability.isolability import DISTINGUISHED_LOSS
from beaver_ftc.studies.detectability.shown import NAME, Line, span, table, times_reference
from beaver_ftc.studies.present.page import Makers, Page, Pictures, study_files
from beaver_ftc.studies.present.tables import grouped, known_values, percent, seconds

Rows = Sequence[Document]
CERTAIN = (
    "From the smallest loss at the best place to that at the worst, of so many places where some loss is\n"
    "certain to be detected and isolated in time, whenever it starts and at half of the start times.\n"
    "Taken for: the same until the other surface alone is excluded. Delay: until a total loss excludes it.\n"
    f"Doublet: the smallest that distinguishes losses of {percent(DISTINGUISHED_LOSS)} in straight flight."
)


def page_of(document: Document) -> Page:
    """The title, and the parts of the page: sentences, table, notes and picture."""
    points, pairs = document["points"], document["pairs"]
    picture = Pictures([("smallest loss that is distinguished from each other surface", NAME)])
    lines = [*_lines_of_faults(points), *_lines_of_pairs(pairs)]
    title = f"Detectability: {document['scenario']}"
    return title, [*conclusions(points), table(lines), CERTAIN, picture]


def _lines_of_faults(points: Rows) -> Iterator[Line]:
    """A line for each fault and excitation."""
    by_fault = sorted(points, key=itemgetter("fault"))
    for (fault, scale), rows in grouped(by_fault, "fault", "excitation").items():
        yield {"loss of": fault, "flown": times_reference(scale)} | _certain_from(rows, "isolated")


def _lines_of_pairs(pairs: Rows) -> Iterator[Line]:
    """A line for each fault, other fault and excitation."""
    by_fault = sorted(pairs, key=itemgetter("fault", "other"))
    for (fault, other, scale), rows in grouped(by_fault, "fault", "other", "excitation").items():
        yield {
            "loss of": fault, "taken for": other, "flown": times_reference(scale),
            **_certain_from(rows, "magnitude"),
            "delay": span(rows, "longest_s", seconds), "half: delay": span(rows, "median_s", seconds),
            "doublet": span(rows, "doublet_deg", "{:.1f} deg".format),
            "doublet time": span(rows, "doublet_s", seconds),
        }  # fmt: skip


def _certain_from(rows: Rows, key: str) -> Line:
    """The cells of a size at every instant, and at half of the instants."""
    return {"certain from": span(rows, key), "half of onsets from": span(rows, f"{key}_median")}


def conclusions(rows: Rows) -> list[str]:
    """One sentence for each fault, at the excitation nearest to the references of the scenario."""
    scale = min((row["excitation"] for row in rows), key=lambda value: abs(value - 1.0))
    chosen = [row for row in rows if row["excitation"] == scale]
    return [_conclusion(fault, scale, group) for (fault,), group in grouped(chosen, "fault").items()]


def _conclusion(fault: str, scale: float, rows: Rows) -> str:
    """The loss that is certain at all places where some loss is, and how many these are."""
    certain = known_values(rows, "isolated")
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


FILES: Makers = study_files(
    NAME, page_of, {NAME: itemgetter("points"), "isolability": itemgetter("pairs")}, {NAME: draw_pairs}
)
