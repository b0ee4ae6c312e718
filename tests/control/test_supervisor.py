"""Every law in every situation: the whole table, written out."""

import itertools

import pytest

from beaver_ftc.control.accommodation import MODES, mode_of, next_mode
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from law_records import new_control

SITUATIONS = {  # detected, isolated, whether another surface can relieve it
    "healthy": (0, NOT_ISOLATED, False),
    "detected": (1, NOT_ISOLATED, False),
    "aileron": (1, 0, False),
    "elevator": (1, 1, True),
    "rudder": (1, 2, False),
    "flap": (1, 3, False),
    "unanticipated": (1, UNANTICIPATED, False),
}
EXPECTED = {
    "nominal": dict.fromkeys(SITUATIONS, "nominal"),
    "adaptive": {
        "healthy": "nominal", "detected": "adaptive", "aileron": "adaptive", "elevator": "adaptive",
        "rudder": "adaptive", "flap": "adaptive", "unanticipated": "unanticipated",
    },
    "fault-tolerant": {
        "healthy": "nominal", "detected": "adaptive", "aileron": "adaptive", "elevator": "reallocated",
        "rudder": "adaptive", "flap": "adaptive", "unanticipated": "unanticipated",
    },
}  # fmt: skip


@pytest.mark.parametrize(("law", "situation"), list(itertools.product(EXPECTED, SITUATIONS)))
def test_mode(law, situation):
    config = new_control(law=law)["config"]
    assert MODES[mode_of(config, *SITUATIONS[situation])] == EXPECTED[law][situation]


@pytest.mark.parametrize(("now", "wanted"), list(itertools.product(MODES, MODES)))
def test_the_way_out_of_nominal_leads_through_adaptive(now, wanted):
    reached = MODES[next_mode(MODES.index(now), MODES.index(wanted))]
    assert reached == ("adaptive" if now == "nominal" and wanted != "nominal" else wanted)
