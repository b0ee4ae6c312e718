"""The split of a flight as a document, as rows of a CSV file, and as an entry of a comparison.

share          RMS of a source over the RMS of the total; sources may cancel: shares need not add up to 1
bound_share    largest share of the bound eta_bar that a source has used in any frame
"""

from collections.abc import Iterator

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.mismatch.charts import largest_sources
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import CAUSES, TOTAL, UNEXPLAINED, Split
from beaver_ftc.studies.present.tables import finite

OF_BOUND = ("worst_ratio", "smallest_constant_rad_s2")  # in the entries of the comparison and of the map


def document(scenario: Scenario, flight: Split, metrics: Metrics) -> Document:
    """The document of the split of a flight."""
    return {
        "scenario": scenario.name,
        "frames": len(flight.t_s),
        "unit": "rad/s2",
        "design_model": scenario.design_model.model_dump(mode="json"),
        "axes": {axis: _axis(flight, i) for i, axis in enumerate(AXES)},
        "dominant": dominant(flight),
        "bound": {axis: flight.bound(i) for i, axis in enumerate(AXES)},
        "closure": float(np.abs(flight.named[UNEXPLAINED]).max()),
        "false_alarm": metrics.false_alarm,
        "detection": metrics.detection.document(),
        "isolation": {key: getattr(metrics.isolation, key) for key in ("fault", "delay_s", "correct")},
    }


def _axis(flight: Split, i: int) -> Document:
    """The numbers of each source on one axis, with those of its parts."""
    named = flight.named
    numbers = {name: flight.magnitudes(named[name], i) for name in (*SOURCES, UNEXPLAINED, TOTAL)}
    for source, details in flight.details.items():
        if details:
            numbers[source]["parts"] = {
                name: flight.magnitudes(values, i) for name, values in details.items()
            }
    return numbers


def dominant(flight: Split) -> Document | None:
    """The source, without faults, with the largest share of the bound in any frame, and its axis; None if all
    are zero."""
    used = np.array([flight.shares(flight.contributions[name]).max(axis=0) for name in CAUSES])
    if not used.any():
        return None
    cause, i = np.unravel_index(int(used.argmax()), used.shape)
    return {"source": CAUSES[cause], "axis": AXES[i], "bound_share": finite(float(used[cause, i]))}


# Columns of mismatch.csv: those of the place, and those with numbers, each with its key in the document.
PLACE = ("scenario", "axis", "source", "part")
FIGURES = {"rms_rad_s2": "rms", "max_rad_s2": "max", "share": "share", "bound_share": "bound_share"}


def csv_rows(document: Document) -> Iterator[Document]:
    """A row for each axis, source and part of a document; a whole source has an empty part."""
    for axis, sources in document["axes"].items():
        for source, figures in sources.items():
            for part, numbers in [("", figures), *figures.get("parts", {}).items()]:
                place = dict(zip(PLACE, (document["scenario"], axis, source, part), strict=True))
                yield place | {column: numbers[key] for column, key in FIGURES.items()}


def entry(document: Document) -> Document:
    """The entry of one flight in the comparison. `dominant`: the source with the largest share of the bound.
    `AXIS_dominant`: the source with the largest peak on the axis."""
    recommended = document["guarantee"]["recommended"]
    return {
        "scenario": document["scenario"],
        **{
            f"{axis}_{key}": document["bound"][axis][key]
            for key in (*OF_BOUND, "exceeded_s")
            for axis in AXES
        },
        **{f"{axis}_dominant": largest_sources(document, axis)[0] for axis in AXES},
        "dominant": document["dominant"]["source"] if document["dominant"] else None,
        "false_alarm": document["false_alarm"],
        "guarantee_void": recommended["false_alarm"],
        "guaranteed_delay_s": recommended["guaranteed_delay_s"],
    }
