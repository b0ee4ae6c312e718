"""Flights of two seconds, each of much at once, and all that is left of one: its log in short, its metrics,
and what every stage remembers at the end.
"""

from typing import Any

import numpy as np

from beaver_ftc.loop.loop import Loop
from beaver_ftc.plugins import SERVICES, entries
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.schema import load
from given import documents
from kept import Fields, in_short, of_record

_DERIVES = "derive" in entries(SERVICES)  # without, no aircraft of the jsbsim package flies
_ALL = documents("short_flights")
SCENARIOS = [one for one in _ALL if _DERIVES or not str(one.get("aircraft")).startswith("jsbsim:")]
# Where JSBSim has its numbers: compiled code reads them there. Rounding decides whether a regressor is 0, and
# so how often P forgets.
OF_THE_MACHINE = (".native", ".executive", ".run", "getter", "setter", "pointer", "pointers", "estimator.P")


def flown(document: dict[str, Any]) -> dict[str, Any]:
    """What is left of the flight of a scenario."""
    loop = Loop(load(document))
    log = np.concatenate([rows.copy() for rows in loop.chunks()])
    record = of_record(loop.frames[0])
    measured = metrics(loop.land())
    del measured["versions"]  # of the packages, not of the flight: a release would change every kept one
    return {
        "metrics": measured,
        "log": {name: in_short(column) for name, column in zip(loop.columns, log.T, strict=True)},
        "record": Fields(
            (path, value) for path, value in record.items() if not path.endswith(OF_THE_MACHINE)
        ),
    }
