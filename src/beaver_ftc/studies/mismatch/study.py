"""Fly scenarios, split their mismatch, and write the results: one flight, several flights compared, or a map.

mismatch.json, .csv    accelerations in rad/s2
share                  RMS of a source over the RMS of the total; sources may cancel, so that shares need
                       not add up to 1
bound_share            largest share of the bound eta_bar that a source has used in any frame
map                    the scenario without faults, flown at each airspeed and altitude
"""

from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.folder import result_folder
from beaver_ftc.results.log import ParquetLog, StoredLog
from beaver_ftc.results.metrics import as_json, measure
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.results.result_files import write_documents, write_report_files
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.study import Progress, Study
from beaver_ftc.studies.mismatch import charts
from beaver_ftc.studies.mismatch.bound import recommended_for
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import (
    CAUSES,
    COLUMNS,
    TOTAL,
    UNEXPLAINED,
    Split,
    split,
    split_flight,
)
from beaver_ftc.studies.mismatch.states import LOGGED, Unlogged
from beaver_ftc.studies.mismatch.tables import mismatch_section
from beaver_ftc.studies.present.page import Files, write_files
from beaver_ftc.studies.present.tables import as_csv, finite

COMPARISON = "mismatch-comparison"
MAP = "mismatch-map"
AIRSPEEDS_MPS = (30.0, 35.0, 40.0, 45.0, 50.0, 55.0)  # the validated envelope
ALTITUDES_M = (0.0, 1000.0, 2000.0, 3000.0, 4000.0)
_OF_BOUND = ("worst_ratio", "smallest_constant_rad_s2")  # in the entries of the comparison and of the map


def run_mismatch(
    scenario: Scenario, out: Path, report: bool, progress: Progress | None
) -> tuple[Document, np.ndarray]:
    """Fly `scenario` and write `out/<name>/`: a run's result folder with the mismatch in it. Return its
    document, and the constant part (3,) rad/s2 of a bound that would have covered the flight.

    Raises BadInput for a flight that cannot be trimmed, SimulationFailed for one not completed or kept.
    """
    with result_folder(out, scenario.name) as folder:
        unlogged = Unlogged()
        with ParquetLog(folder / "log.parquet") as log:
            flight = fly(scenario, log, progress, watch=unlogged.watch)
        metrics = measure(flight)
        flight_split = split(scenario, StoredLog(folder / "log.parquet").read(LOGGED), unlogged)
        with ParquetLog(folder / "mismatch.parquet") as frames:
            frames.open(COLUMNS)
            frames.write(flight_split.rows())
        analysis = analyse(scenario)
        recommended = recommended_for([scenario], [flight_split.smallest_constant])
        result = (
            document(scenario, flight_split, metrics) | recommended | {"linear": linear_document(analysis)}
        )
        write_documents(folder, scenario, metrics.document())
        write_files(folder, _as_files(result, csv_rows(result)))
        if report:
            write_files(folder / "figures", charts.figures(folder, result, metrics, analysis))
            write_report_files(folder, metrics.document(), sections=[mismatch_section])
    return result, flight_split.smallest_constant


def refuse_other_aircraft(scenarios: Iterable[Scenario]) -> None:
    """Raise BadInput for another aircraft than the built-in one, since only the latter has a second set of
    equations."""
    for scenario in scenarios:
        if scenario.airframe is not load():
            raise BadInput(
                f"{scenario.name}: aircraft: `mismatch` works for {load().name} only, allowed: "
                f"{load().name}; for other aircraft `beaver-ftc derive` measures the model error"
            )


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


def _as_files(document: Document, table: Iterable[Document]) -> Files:
    return {"mismatch.json": as_json(document), "mismatch.csv": as_csv(list(table))}


def entry(document: Document) -> Document:
    """The entry of one flight in the comparison. `dominant`: the source with the largest share of the bound.
    `AXIS_dominant`: the source with the largest peak on the axis."""
    recommended = document["guarantee"]["recommended"]
    return {
        "scenario": document["scenario"],
        **{
            f"{axis}_{key}": document["bound"][axis][key]
            for key in (*_OF_BOUND, "exceeded_s")
            for axis in AXES
        },
        **{f"{axis}_dominant": charts.largest_sources(document, axis)[0] for axis in AXES},
        "dominant": document["dominant"]["source"] if document["dominant"] else None,
        "false_alarm": document["false_alarm"],
        "guarantee_void": recommended["false_alarm"],
        "guaranteed_delay_s": recommended["guaranteed_delay_s"],
    }


def write_comparison(out: Path, entries: list[Document], recommended: Document, report: bool) -> Path:
    """Write `out/mismatch-comparison/`: the table as JSON and CSV, and a figure. Whole or not at all."""
    drawn = {f"{COMPARISON}.png": charts.comparison_figure(entries)} if report else None
    with result_folder(out, COMPARISON) as folder:
        write_files(folder, {**_as_files({"runs": entries} | recommended, entries), "figures": drawn})
    return out / COMPARISON


def map_study(scenario: Scenario, report: bool = True) -> Study:
    """The map of a scenario: an entry for each altitude, airspeed and axis, with the largest share of the
    bound, the smallest constant that covers it, the source with the largest peak, and whether there is a
    false alarm. report: whether a figure is drawn."""

    def drawn(document: Document) -> Files | None:
        return {f"{MAP}.png": charts.map_figure(document["map"], scenario.name)} if report else None

    conditions = [(V, h) for h in ALTITUDES_M for V in AIRSPEEDS_MPS]
    return Study(
        f"{scenario.name}-{MAP}", conditions, partial(_cell, scenario),
        lambda cells: {"scenario": scenario.name, "map": [entry for cell in cells for entry in cell]},
        {"mismatch.json": as_json, "mismatch.csv": lambda found: as_csv(found["map"]), "figures": drawn},
        row=list[Document], follows_from=scenario,
    )  # fmt: skip


def _cell(scenario: Scenario, condition: tuple[float, float]) -> list[Document]:
    """The entries of one condition, one for each axis, for a flight without faults; without a trim, all
    values are None."""
    airspeed_mps, altitude_m = condition
    place = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m}
    changes = {"initial": scenario.initial.model_copy(update=place), "faults": ()}
    try:
        flight_split, flight = split_flight(scenario.model_copy(update=changes))
    except BadInput:
        nothing = dict.fromkeys((*_OF_BOUND, "dominant", "false_alarm"))
        return [{**place, "axis": axis, **nothing} for axis in AXES]
    result = document(scenario, flight_split, flight)
    return [
        {
            **place,
            "axis": axis,
            **{key: result["bound"][axis][key] for key in _OF_BOUND},
            "dominant": charts.largest_sources(result, axis)[0],
            "false_alarm": result["false_alarm"],
        }
        for axis in AXES
    ]
