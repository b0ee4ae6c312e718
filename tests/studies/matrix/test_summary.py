"""The matrix's summary against rows that differ in everything, so that no other choice gives the same."""

import pytest

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.studies.matrix.fault_matrix import FAULTS, as_text, beside_told, document_of

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


@pytest.mark.parametrize("order", [(0.2, 0.7, 0.4), (0.7, 0.4, 0.2), (0.4, 0.2, 0.7)])
def test_a_cells_delay_and_ratio_are_the_worst_of_its_airspeeds(order):
    cell, document = cell_of(*({"delay_s": d, "ratio": 3 * d} for d in order))
    assert cell["delay_s"] == 0.7
    assert cell["ratio"] == pytest.approx(2.1)
    assert "0.70 s" in as_text(document)


def test_never_detected_at_one_airspeed_is_the_worst_delay():
    cell, _ = cell_of({"delay_s": 0.2}, {"delay_s": None, "verdict": "unseen", "detected": False}, {})
    assert cell["delay_s"] is None
    assert cell["verdict"] == "unseen"


def test_the_worst_verdict_stands_for_the_cell_and_is_counted():
    cell, document = cell_of(
        {"verdict": "named"}, {"verdict": "WRONG", "false_alarm": True}, {"verdict": "open"}
    )
    assert cell["verdict"] == "WRONG"
    assert (document["wrong"], document["false_alarms"], document["passed"]) == (1, 1, False)


def test_losses_are_counted_and_told_from_the_oracles():
    lost = {"departure_s": 20.0, "departure_signal": "alpha_rad"}
    both = {**lost, "oracle_departure_s": 22.0, "oracle_beyond_s": 1.5}
    cell, document = cell_of(lost, both, {})
    assert (cell["lost"], cell["oracle_lost"], cell["flights"]) == (2, 1, 3)
    assert cell["remark"].startswith("lost in 2 of 3 flights, the oracle in 1: for 1.5 s no deflection")
    assert [r["airspeed_mps"] for r in document["lost_though_the_oracle_was_not"]] == [38.0]


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


LEFT = "the validated envelope was left at 9.2 s, the outer loops being open"
LOST = {"departure_s": 20.0, "departure_signal": "alpha_rad"}


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (
            {"oracle_left_envelope_s": 9.25},
            LEFT,
        ),
        ({}, "alpha_rad diverged"),
    ],
)
def test_why_not_even_the_oracle_kept_an_aircraft(found, why):
    cell, _ = cell_of({}, LOST, {**LOST, **found})
    assert cell["remark"] == f"lost in 2 of 3 flights, the oracle in 0: {why}"
    beyond, _ = cell_of({}, {**LOST, "oracle_beyond_s": 1.0, "axis": "p"}, {**LOST, "oracle_beyond_s": 0.5})
    assert beyond["remark"].endswith("for 1.0 s no deflection could hold the p rate")


def test_where_nothing_was_lost_the_remark_is_of_what_nobody_saw():
    assert cell_of({}, {}, {"detected": False})[0]["remark"] == ""
    unseen, _ = cell_of(*[{"detected": False}] * 3)
    assert unseen["remark"] == "no effect beyond the declared uncertainty: tracking is as before"


def told_of(*chances):
    rows = [
        row(fault, surface, V, told_chance=chance if (fault, surface) == (FAULT, SURFACE) else 0.9)
        for fault, _ in FAULTS
        for surface in SURFACES
        for V, chance in zip((38.0, 45.0, 52.0), chances, strict=True)
    ]
    document = document_of(rows)
    (cell,) = [c for c in document["cells"] if (c["fault"], c["surface"]) == (FAULT, SURFACE)]
    return cell, as_text(document)


def test_a_cell_that_not_even_a_told_test_sees_is_marked():
    cell, text = told_of(0.5, 0.1, 0.2)
    assert cell["told"] == 0
    marked = next(line for line in text.splitlines() if line.startswith(FAULT))
    assert marked.count("1.0xo") == 1
    assert "o: not even the informed test" in text
    seen, text = told_of(0.51, 0.1, 0.2)
    assert seen["told"] == 1
    assert "1.0xo" not in text
    n = 3 * len(FAULTS) * len(SURFACES)
    assert f"the informed test, which knows the fault, detects {n - 2} of {n}" in text
    assert f"the diagnosis detects {n - 2},\nnames the right surface in {n - 2} (100 %:" in text
    elevators = 3 * len(FAULTS)
    assert f"elevator {elevators - 2} of {elevators - 2}" in text


def test_where_a_told_test_sees_nothing_it_says_so():
    rows = [row(fault, s, 45.0, told_chance=0.1) for fault, _ in FAULTS for s in SURFACES]
    assert as_text(document_of(rows)).endswith(
        "the informed test, which knows the fault, detects none of them"
    )
    plain = as_text(document_of([row(fault, s, 45.0) for fault, _ in FAULTS for s in SURFACES]))
    assert "informed test" not in plain
    n = len(FAULTS) * len(SURFACES)
    none = "0 named wrongly, 0 false alarms, 0 aircraft lost although the law oracle kept it"
    assert plain.endswith(f"{n} faults flown: {none}")
