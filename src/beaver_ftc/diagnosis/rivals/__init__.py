"""Rival detectors and laws, each after its source, plugged in as anybody's would be.

    rls-monitor         recursive least squares on input-output pairs       [Keipour2019]
    augmented-ekf       effectiveness as states, chi-square on them         [Jazwinski1970], [Simon2006]
    augmented-ukf       the same by sigma points, CUSUM on the innovation   [Julier2004], [Page1954]
    multiple-models     interacting multiple models                         [Blom1988], [Zhang1998]
    observer-constant   observer residual against a constant threshold      [Chen1999]
    indi                incremental nonlinear dynamic inversion             [Sieberling2010], [Smeur2016]
    l1-adaptive         piecewise-constant L1 adaptive control              [Hovakimyan2010]
    lqr                 linear quadratic regulator with integral action     [Anderson1990]

The keys are in REFERENCES.md. What a method leaves open is in its defaults. `beaver-ftc compare --tune`
chooses those that plugins.yaml lists as `tunable`, of these and of our own methods alike, for each grade of
flights by itself; tuned.json has what it chose: see benchmark.md.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from beaver_ftc.design.context import Context
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.plugins import DETECTORS, LAWS

TUNED = Path(__file__).with_name("tuned.json")
EXACT, ACTUATORS, ERRORS = "exact", "actuators", "errors"
GRADES = (EXACT, ACTUATORS, ERRORS)
KINDS = {DETECTORS: "detectors", LAWS: "laws"}

Tuned = dict[str, Any]  # grade -> "detectors" or "laws" -> method -> its values


@cache
def tuned() -> Tuned:
    """What `beaver-ftc compare --tune` chose, as shipped."""
    found: Tuned = json.loads(TUNED.read_text(encoding="utf-8"))["grades"]
    return found


def grade(noise: bool, ideal_actuators: bool) -> str:
    """Of a flight: with declared errors of sensors or air, with actuators that lag, or with neither."""
    if noise:
        return ERRORS
    return EXACT if ideal_actuators else ACTUATORS


def values_of(chosen: Tuned, of_grade: str, group: str, name: str) -> dict[str, float]:
    """The values chosen for a method on a grade of flights; none if it was not tuned there."""
    found: dict[str, float] = chosen.get(of_grade, {}).get(KINDS[group], {}).get(name, {})
    return found


def options_of(name: str, defaults: Mapping[str, float], context: Context) -> dict[str, float]:
    """The parameters a rival flies with: its defaults, what the tuning found, what the scenario says.

    The last one counts. Raises BadInput for one it does not have.
    """
    for key in context.options:
        if key not in defaults:
            raise BadInput(f"{name}: options.{key}: unknown option{suggestion(key, defaults)}")
    declared = context.declared
    flown = grade(declared.noisy, not declared.bandwidth_rad_s.any() and not declared.rate_limit_rad_s.any())
    found = {key: value for group in KINDS for key, value in values_of(tuned(), flown, group, name).items()}
    return {**defaults, **found, **context.options}
