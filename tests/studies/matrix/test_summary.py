"""The matrix's summary against rows that differ in everything, so that no other choice gives the same."""

import pytest

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.studies.matrix.fault_matrix import FAULTS, beside_told, document_of

FAULT, SURFACE = FAULTS[0][0], "elevator"


def row(fault, surface, airspeed_mps, **found):
    nothing = {
        "verdict": "named", "delay_s": 0.1, "false_alarm": False, "candidates": [], "ratio": 1.0,
        "departure_s": None, "oracle_departure_s": None, "departure_signal": None, "oracle_beyond_s": 0.0,
        "oracle_left_envelope_s": None, "axis": "q", "detected": True,
    }  # fmt: skip
    return {"fault": fault, "surface": surface, "airspeed_mps": airspeed_mps, **nothing, **found}


def cell_of(*three):
    """The cell of the first fault on the elevator, flown so; every other cell is plain."""
    rows = [
        row(fault, surface, V, **(found if (fault, surface) == (FAULT, SURFACE) else {}))
        for fault, _ in FAULTS
        for surface in SURFACES
        for V, found in zip((38.0, 45.0, 52.0), three, strict=True)
    ]
    document = document_of(rows)
    (cell,) = [c for c in document["cells"] if (c["fault"], c["surface"]) == (FAULT, SURFACE)]
    return cell, document


def test_the_worst_verdict_stands_for_the_cell_and_is_counted():
    cell, document = cell_of(
        {"verdict": "named"}, {"verdict": "WRONG", "false_alarm": True}, {"verdict": "open"}
    )
    assert cell["verdict"] == "WRONG"
    assert (document["wrong"], document["false_alarms"], document["passed"]) == (1, 1, False)


@pytest.mark.parametrize("bad", [{"verdict": "WRONG"}, {"false_alarm": True}])
def test_one_wrong_name_or_one_false_alarm_fails_the_matrix(bad):
    assert cell_of({}, {}, {})[1]["passed"]
    assert not cell_of({}, bad, {})[1]["passed"]


def test_what_is_told_counts_by_what_a_test_more_often_than_not_sees():
    told = [
        row(FAULT, "elevator", 38.0, told_chance=0.5),
        row(FAULT, "elevator", 45.0, told_chance=0.6, verdict="WRONG"),
        row(FAULT, "rudder", 45.0, told_chance=0.9, verdict="surface"),
        row(FAULT, "rudder", 52.0, told_chance=0.9, verdict="unseen", detected=False),
    ]
    found = beside_told(told)
    assert (found["flights"], found["seen"], found["detected"], found["named"]) == (4, 3, 2, 1)
    assert found["share"] == pytest.approx(1 / 3)
    assert (found["type_kept"], found["detected_but_not_told"]) == (1, 1)
    assert found["by_surface"] == {
        "elevator": {"seen": 1, "named": 0},
        "rudder": {"seen": 2, "named": 1},
    }
    assert beside_told(told[:1])["share"] is None
