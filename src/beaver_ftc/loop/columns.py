"""Which columns the log of a flight has. They stay as they are, whatever changes in flight."""

import numpy as np

from beaver_ftc.control.outer.state import COLUMNS
from beaver_ftc.loop.assembly import estimator_names
from beaver_ftc.loop.instrument_records import comes_to_be_watched
from beaver_ftc.plant.channels import log_columns
from beaver_ftc.scenario.schema import Scenario


def lay_out(frame: np.void, scenario: Scenario, diagnoses_itself: bool) -> tuple[str, ...]:
    """Note in a flight's record what there are columns for; returns their names."""
    fdi, logged, profile = frame["fdi"], frame["logged"], bool(frame["autopilot"]["enabled"])
    tested = bool(fdi["statistical"]["tests"]["enabled"])
    logged["estimators"] = fdi["isolation"]["n"] if diagnoses_itself else 0
    logged["watch"] = comes_to_be_watched(scenario)
    logged["power"] = frame["control"]["power"]["enabled"] or profile
    logged["tests"] = fdi["statistical"]["tests"]["n_columns"] if tested else 0
    return log_columns(
        estimator_names(scenario.fdi.fault_class, scenario.airframe) if diagnoses_itself else (),
        bool(logged["power"]),
        tested,
        scenario.airframe,
        profile=COLUMNS if profile else (),
        watch=bool(logged["watch"]),
    )
