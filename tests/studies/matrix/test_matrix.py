"""The fault matrix: the bars of every fault type, flown."""

import json
from types import SimpleNamespace

import pytest

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.studies.matrix.fault_matrix import (
    AIRSPEEDS_MPS,
    FAULTS,
    as_text,
    cases,
    fly_case,
    run_matrix,
    verdict,
)
from samples import AT_NIGHT

SPEEDS_MPS = AIRSPEEDS_MPS if AT_NIGHT else AIRSPEEDS_MPS[1:2]
ALLOWED_S = {"aileron": 0.5, "elevator": 0.5, "rudder": 1.0}
PERIODS_S = {"1 rad/s": 6.283, "5 rad/s": 1.257, "10 rad/s": 0.628}


@pytest.fixture(scope="module")
def matrix(tmp_path_factory):
    folder = tmp_path_factory.mktemp("matrix")
    return run_matrix(folder, SPEEDS_MPS), folder / "fault-matrix"


def flights(matrix, *words, surfaces=tuple(ALLOWED_S)):
    rows = [
        row
        for row in matrix[0]["flights"]
        if row["surface"] in surfaces and any(row["fault"].startswith(word) for word in words)
    ]
    assert rows
    return rows


def test_every_type_on_every_surface_at_every_speed_is_flown(matrix):
    assert len(matrix[0]["flights"]) == len(FAULTS) * len(SURFACES) * len(SPEEDS_MPS)
    assert {cell["surface"] for cell in matrix[0]["cells"]} == set(SURFACES)


def test_no_false_alarm_no_wrong_surface_no_wrong_type(matrix):
    assert matrix[0]["false_alarms"] == 0
    assert [row for row in matrix[0]["flights"] if row["verdict"] == "WRONG"] == []
    assert matrix[0]["passed"]


def test_detected_in_time(matrix):
    for row in flights(matrix, "40 %", "total", "stuck", "hardover", "float", "bias"):
        assert row["delay_s"] <= ALLOWED_S[row["surface"]], row


def test_an_oscillation_is_detected_within_three_periods(matrix):
    """The published Airbus benchmark's demand [Goupil2010]."""
    for row in flights(matrix, "oscillation", surfaces=SURFACES):
        period_s = next(period for name, period in PERIODS_S.items() if row["fault"].endswith(f" {name}"))
        assert row["delay_s"] <= 3 * period_s, row


def test_the_surface_is_named_for_aileron_and_rudder_jams_and_biases(matrix):
    for row in flights(matrix, "stuck", "bias", "hardover", "float", surfaces=("aileron", "rudder")):
        assert row["isolated"] == row["surface"], row


def test_nothing_is_lost_that_the_oracle_keeps(matrix):
    assert matrix[0]["lost_though_the_oracle_was_not"] == []


def test_tracking_is_at_most_twice_the_oracles(matrix):
    for row in flights(matrix, "40 %", "stuck", "float", "bias", "oscillation", surfaces=SURFACES):
        assert row["ratio"] <= 2.0, row


def test_where_the_aircraft_is_lost_the_report_says_why(matrix):
    for cell in matrix[0]["cells"]:
        assert ("lost in" in cell["remark"]) == (cell["lost"] > 0)


def test_what_is_written_is_what_was_found(matrix):
    document, folder = matrix
    assert json.loads((folder / "fault-matrix.json").read_text()) == json.loads(json.dumps(document))
    assert (folder / "fault-matrix.txt").read_text() == as_text(document) + "\n"
    assert (folder / "fault-matrix.png").stat().st_size > 10_000


def test_a_row_is_the_same_flown_alone(matrix):
    case = cases((45.0,))[9]
    assert fly_case(case) in matrix[0]["flights"]


class TestVerdict:
    def of(self, fault, kind, candidates=(), detected=True, false_alarm=False, true_type="stuck"):
        type_correct = None if kind is None else kind == true_type
        isolation = SimpleNamespace(
            fault=fault,
            type=kind,
            candidates=tuple(candidates),
            correct=fault == "elevator",
            type_correct=type_correct,
        )
        detection = SimpleNamespace(detected=detected)
        found = SimpleNamespace(detection=detection, false_alarm=false_alarm, isolation=isolation)
        return verdict(found, "elevator", true_type)

    def test_each(self):
        assert self.of("elevator", "stuck", ["stuck"]) == "named"
        assert self.of("elevator", None, ["stuck", "float"]) == "surface"
        assert self.of(None, None, ["elevator:stuck", "flap:stuck"]) == "open"
        assert self.of(None, None, detected=False) == "unseen"

    def test_what_is_wrong(self):
        assert self.of("rudder", "stuck", ["stuck"]) == "WRONG"
        assert self.of("elevator", "bias", ["bias"]) == "WRONG"
        assert self.of("elevator", None, ["bias"]) == "WRONG"
        assert self.of(None, None, ["flap:stuck"]) == "WRONG"
        assert self.of("elevator", "stuck", ["stuck"], false_alarm=True) == "WRONG"
