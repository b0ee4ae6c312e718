"""Rival detectors and laws, each after its source, plugged in as anybody's would be.

    rls-monitor         recursive least squares on input-output pairs       [Keipour2019]
    augmented-ekf       effectiveness as states, chi-square on them         [Jazwinski1970], [Simon2006]
    augmented-ukf       the same by sigma points, CUSUM on the innovation   [Julier2004], [Page1954]
    multiple-models     interacting multiple models                         [Blom1988], [Zhang1998]
    observer-constant   observer residual against a constant threshold      [Chen1999]
    indi                incremental nonlinear dynamic inversion             [Sieberling2010], [Smeur2016]
    l1-adaptive         piecewise-constant L1 adaptive control              [Hovakimyan2010]
    lqr                 linear quadratic regulator with integral action     [Anderson1990]

The keys are in REFERENCES.md. What a method leaves open is in its defaults; what is tuned is tuned by
`beaver-ftc compare --tune`, which writes tuned.json: see benchmark.md. Where errors of instruments, air
or model are declared, what was tuned for them takes the place of what was tuned without.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from beaver_ftc.design.context import Context
from beaver_ftc.documents.errors import BadInput, suggestion

TUNED = Path(__file__).with_name("tuned.json")
TUNED_FOR_ERRORS = Path(__file__).with_name("tuned_for_errors.json")


@cache
def tuned(path: Path = TUNED) -> dict[str, dict[str, float]]:
    """Rival -> parameters found by `beaver-ftc compare --tune`."""
    return json.loads(path.read_text(encoding="utf-8"))["options"] if path.exists() else {}


def options_of(name: str, defaults: Mapping[str, float], context: Context) -> dict[str, float]:
    """The parameters a rival flies with: its defaults, what the tuning found, what the scenario says.

    The last one counts. Raises BadInput for one it does not have.
    """
    for key in context.options:
        if key not in defaults:
            raise BadInput(f"{name}: options.{key}: unknown option{suggestion(key, defaults)}")
    found = tuned().get(name, {})
    if context.declared.errors:
        found = tuned(TUNED_FOR_ERRORS).get(name, found)
    return {**defaults, **found, **context.options}
