"""Every law in every situation: the whole table, written out."""

import itertools
from types import SimpleNamespace

import pytest

from beaver_ftc.control.accommodation import MODES, mode_from, next_mode
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from law_records import new_control

SITUATIONS = {  # detected, isolated
    "healthy": (0, NOT_ISOLATED), "detected": (1, NOT_ISOLATED), "aileron": (1, 0), "elevator": (1, 1),
    "unanticipated": (1, UNANTICIPATED),
}  # fmt: skip
TOLERANT = {
    "healthy": "nominal", "detected": "adaptive", "aileron": "adaptive", "elevator": "reallocated",
    "unanticipated": "unanticipated",
}  # fmt: skip
EXPECTED = {
    "nominal": dict.fromkeys(SITUATIONS, "nominal"), "adaptive": TOLERANT | {"elevator": "adaptive"},
    "fault-tolerant": TOLERANT,
}  # fmt: skip


@pytest.mark.parametrize(("law", "situation"), list(itertools.product(EXPECTED, SITUATIONS)))
def test_mode(law, situation):
    control, (detected, isolated) = new_control(law=law, main=(0, 1, 2), stand_in=3), SITUATIONS[situation]
    verdict = SimpleNamespace(detected=detected, isolated_estimator=isolated)
    assessment = SimpleNamespace(diagnoses_all_types=0, isolated_surface=max(isolated, -1))
    mode = mode_from(control["config"], control["layout"], verdict, assessment)
    assert MODES[mode] == EXPECTED[law][situation]


@pytest.mark.parametrize(("now", "wanted"), list(itertools.product(MODES, MODES)))
def test_the_way_out_of_nominal_leads_through_adaptive(now, wanted):
    reached = MODES[next_mode(MODES.index(now), MODES.index(wanted))]
    assert reached == ("adaptive" if now == "nominal" and wanted != "nominal" else wanted)
