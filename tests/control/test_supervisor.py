"""Every law in every situation: the whole table, written out."""

import itertools

import numpy as np
import pytest

from beaver_ftc.control.accommodation import MODES, mode_from, next_mode
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from law_records import new_control

NAMES = "detected isolated_estimator target accommodation_mode diagnoses_all_types isolated_surface"
SAID = np.dtype([(name, int) for name in NAMES.split()])  # of verdict and assessment

SITUATIONS = {  # detected, isolated
    "healthy": (0, NOT_ISOLATED), "detected": (1, NOT_ISOLATED), "elevator": (1, 1),
    "unanticipated": (1, UNANTICIPATED),
}  # fmt: skip
TOLERANT = {
    "healthy": "nominal", "detected": "adaptive", "elevator": "reallocated",
    "unanticipated": "unanticipated",
}  # fmt: skip
EXPECTED = {
    "nominal": dict.fromkeys(SITUATIONS, "nominal"), "adaptive": TOLERANT | {"elevator": "adaptive"},
    "fault-tolerant": TOLERANT,
}  # fmt: skip


@pytest.mark.parametrize(("law", "situation"), list(itertools.product(EXPECTED, SITUATIONS)))
def test_mode(law, situation):
    control, said = new_control(law=law, main=(0, 1, 2), stand_in=3), np.zeros(1, SAID).view(np.recarray)[0]
    said["detected"], said["isolated_estimator"] = SITUATIONS[situation]
    said["isolated_surface"] = max(said["isolated_estimator"], -1)
    assert MODES[mode_from(control["config"], control["layout"], said, said)] == EXPECTED[law][situation]


@pytest.mark.parametrize(("now", "wanted"), list(itertools.product(MODES, MODES)))
def test_the_way_out_of_nominal_leads_through_adaptive(now, wanted):
    reached = MODES[next_mode(MODES.index(now), MODES.index(wanted))]
    assert reached == ("adaptive" if now == "nominal" and wanted != "nominal" else wanted)
