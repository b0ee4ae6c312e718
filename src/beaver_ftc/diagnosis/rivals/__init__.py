"""Rival detectors and laws, each after its source, plugged in as those of a third party are.

    rls-monitor         recursive least squares on input-output pairs       [Keipour2019]
    augmented-ekf       effectiveness as states, chi-square on them         [Jazwinski1970], [Simon2006]
    augmented-ukf       the same by sigma points, CUSUM on the innovation   [Julier2004], [Page1954]
    multiple-models     interacting multiple models                         [Blom1988], [Zhang1998]
    observer-constant   observer residual against a constant threshold      [Chen1999]
    indi                incremental nonlinear dynamic inversion             [Sieberling2010], [Smeur2016]
    l1-adaptive         piecewise-constant L1 adaptive control              [Hovakimyan2010]
    lqr                 linear quadratic regulator with integral action     [Anderson1990]

The keys are in REFERENCES.md. The parameters that a source leaves open are the defaults of the class.
plugins.yaml lists the `tunable` ones, of the rivals and of our own methods alike. `beaver-ftc compare --tune`
chooses their values for each grade of flights, and tuned.json has these values (benchmark.md).

A grade is a kind of flights: exact, with actuators that lag, or with errors of sensors or air.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from beaver_ftc.design.context import Context
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.plugins import DETECTORS, LAWS

TUNED_FILE = Path(__file__).with_name("tuned.json")
EXACT_GRADE, LAGGING_ACTUATORS_GRADE, SENSOR_OR_AIR_ERRORS_GRADE = "exact", "actuators", "errors"
FLIGHT_GRADES = (EXACT_GRADE, LAGGING_ACTUATORS_GRADE, SENSOR_OR_AIR_ERRORS_GRADE)
# key in TUNED_FILE of each group of plug-ins
TUNED_FILE_KEY_BY_PLUGIN_GROUP = {DETECTORS: "detectors", LAWS: "laws"}

TunedValuesByGrade = dict[str, Any]  # grade -> "detectors" or "laws" -> method -> parameter -> value


@cache
def load_tuned_values() -> TunedValuesByGrade:
    """The values that `beaver-ftc compare --tune` chose, as shipped."""
    grades: TunedValuesByGrade = json.loads(TUNED_FILE.read_text(encoding="utf-8"))["grades"]
    return grades


def flight_grade(has_sensor_or_air_errors: bool, has_ideal_actuators: bool) -> str:
    """Return the grade of a flight: with declared errors of sensors or air, with actuators that lag, or with
    neither."""
    if has_sensor_or_air_errors:
        return SENSOR_OR_AIR_ERRORS_GRADE
    return EXACT_GRADE if has_ideal_actuators else LAGGING_ACTUATORS_GRADE


def tuned_values(grades: TunedValuesByGrade, grade: str, group: str, name: str) -> dict[str, float]:
    """The values chosen for a method, of a group of plug-ins, on a grade of flights; none if nothing was
    chosen there."""
    methods = grades.get(grade, {}).get(TUNED_FILE_KEY_BY_PLUGIN_GROUP[group], {})
    values: dict[str, float] = methods.get(name, {})
    return values


def rival_options(name: str, defaults: Mapping[str, float], context: Context) -> dict[str, float]:
    """The parameters with which a rival flies. A value of the scenario comes before one of the tuning, and
    this before a default. Raises BadInput for an option that the rival does not have.
    """
    for option in context.options:
        if option not in defaults:
            raise BadInput(f"{name}: options.{option}: unknown option{suggestion(option, defaults)}")
    declared = context.declared
    options = dict(defaults)
    has_ideal_actuators = not declared.bandwidth_rad_s.any() and not declared.rate_limit_rad_s.any()
    grade = flight_grade(declared.noisy, has_ideal_actuators)
    for group in TUNED_FILE_KEY_BY_PLUGIN_GROUP:
        options |= tuned_values(load_tuned_values(), grade, group, name)
    return {**options, **context.options}
