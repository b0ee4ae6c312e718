"""The fault matrix: the bars of every fault type, flown."""

from types import SimpleNamespace

import pytest

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.studies.engine.study import run_study
from beaver_ftc.studies.matrix.fault_matrix import AIRSPEEDS_MPS, cases, fly_case, matrix_study, verdict
from samples import AT_NIGHT

SPEEDS_MPS = AIRSPEEDS_MPS if AT_NIGHT else AIRSPEEDS_MPS[1:2]
ALLOWED_S = {"aileron": 0.5, "elevator": 0.5, "rudder": 1.0}
PERIODS_S = {"1 rad/s": 6.283, "5 rad/s": 1.257, "10 rad/s": 0.628}


@pytest.fixture(scope="module")
def matrix(tmp_path_factory):
    folder = tmp_path_factory.mktemp("matrix")
    return run_study(matrix_study(SPEEDS_MPS), folder), folder / "fault-matrix"


def flights(matrix, *words, surfaces=tuple(ALLOWED_S)):
    rows = [
        row
        for row in matrix[0]["flights"]
        if row["surface"] in surfaces and any(row["fault"].startswith(word) for word in words)
    ]
    assert rows
    return rows


def test_no_false_alarm_no_wrong_surface_no_wrong_type(matrix):
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


def test_a_row_is_the_same_flown_alone(matrix):
    case = cases((45.0,))[9]
    assert fly_case(case) in matrix[0]["flights"]


def isolated(fault, kind, candidates=()):
    correct = {"correct": fault == "elevator", "type_correct": None if kind is None else kind == "stuck"}
    return SimpleNamespace(fault=fault, type=kind, candidates=tuple(candidates), **correct)


@pytest.mark.parametrize(
    ("isolation", "detected", "false_alarm", "said"),
    [
        (isolated("elevator", "stuck", ["stuck"]), True, False, "named"),
        (isolated("elevator", None, ["stuck", "float"]), True, False, "surface"),
        (isolated(None, None, ["elevator:stuck", "flap:stuck"]), True, False, "open"),
        (isolated(None, None), False, False, "unseen"),
        (isolated("rudder", "stuck", ["stuck"]), True, False, "WRONG"),
        (isolated("elevator", "bias", ["bias"]), True, False, "WRONG"),
        (isolated("elevator", None, ["bias"]), True, False, "WRONG"),
        (isolated(None, None, ["flap:stuck"]), True, False, "WRONG"),
        (isolated("elevator", "stuck", ["stuck"]), True, True, "WRONG"),
    ],
)
def test_a_verdict_on_a_stuck_elevator(isolation, detected, false_alarm, said):
    detection = SimpleNamespace(detected=detected)
    found = SimpleNamespace(detection=detection, false_alarm=false_alarm, isolation=isolation)
    assert verdict(found, "elevator", "stuck") == said
