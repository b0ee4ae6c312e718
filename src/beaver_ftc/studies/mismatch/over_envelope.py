"""The map of a scenario: its mismatch without faults at each airspeed and altitude."""

from functools import partial

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.metrics import as_json
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.study import Study
from beaver_ftc.studies.mismatch.charts import largest_sources, map_figure
from beaver_ftc.studies.mismatch.documents import OF_BOUND, document
from beaver_ftc.studies.mismatch.split import split_flight
from beaver_ftc.studies.present.page import Files
from beaver_ftc.studies.present.tables import as_csv

MAP = "mismatch-map"
AIRSPEEDS_MPS = (30.0, 35.0, 40.0, 45.0, 50.0, 55.0)  # the validated envelope
ALTITUDES_M = (0.0, 1000.0, 2000.0, 3000.0, 4000.0)


def map_study(scenario: Scenario, report: bool = True) -> Study:
    """The map of a scenario: an entry for each altitude, airspeed and axis, with the largest share of the
    bound, the smallest constant that covers it, the source with the largest peak, and whether there is a
    false alarm. report: whether a figure is drawn."""

    def drawn(document: Document) -> Files | None:
        return {f"{MAP}.png": map_figure(document["map"], scenario.name)} if report else None

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
        nothing = dict.fromkeys((*OF_BOUND, "dominant", "false_alarm"))
        return [{**place, "axis": axis, **nothing} for axis in AXES]
    result = document(scenario, flight_split, flight)
    return [
        {
            **place,
            "axis": axis,
            **{key: result["bound"][axis][key] for key in OF_BOUND},
            "dominant": largest_sources(result, axis)[0],
            "false_alarm": result["false_alarm"],
        }
        for axis in AXES
    ]
