"""Elevator and flap lost: the report, its flights and its margins."""

import json

import numpy as np
import pytest

from beaver_ftc.scenario.diagnosis import EnginePower
from beaver_ftc.studies.matrix.command import Matrix
from beaver_ftc.studies.matrix.pitch_lost import (
    LAWS,
    LOST,
    PitchCase,
    about_trim,
    as_text,
    closed_loop,
    document_of,
    fly_case,
    loop_response,
    margins,
    run_pitch_lost,
)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pitch")
    return run_pitch_lost(folder, (45.0,)), folder / "pitch-lost"


def test_every_pair_is_flown_under_every_law(found):
    assert len(found[0]["flights"]) == len(LOST) * len(LAWS)
    assert {row["with"]["engine_power"] is None for row in found[0]["flights"]} == {False}
    assert {row["without"]["engine_power"] is None for row in found[0]["flights"]} == {True}


def test_power_loses_no_aircraft_and_keeps_some(found):
    assert found[0]["passed"]
    assert found[0]["harmed"] == 0
    assert found[0]["saved"] == len(LAWS)  # the flap 20 deg down


def test_up_to_four_degrees_off_trim_it_swings_less_and_never_banks_away(found):
    for row in found[0]["flights"]:
        assert row["with"]["departure"] is None, row
        assert row["with"]["bank_deg"] < 30.0, row
        if not row["lost"].startswith(("elevator -8", "flap 20")):
            assert row["with"]["q_rms_deg_s"] < row["without"]["q_rms_deg_s"], row
            assert row["with"]["theta_swing_deg"] < row["without"]["theta_swing_deg"], row


def test_what_is_written_is_what_was_found(found):
    document, folder = found
    assert json.loads((folder / "pitch-lost.json").read_text()) == json.loads(json.dumps(document))
    text = (folder / "pitch-lost.txt").read_text()
    assert text == as_text(document) + "\n"
    assert "flap 20 deg down          lost 19.5 s >" in text
    assert "0 lost that are kept without" in text


def test_it_can_be_written_again(found):
    assert {entry.name for entry in found[1].iterdir()} <= {*Matrix.FILES}


def test_a_row_is_the_same_flown_alone(found):
    case = PitchCase("elevator +1 deg", 45.0, "oracle-published")
    assert fly_case(case) in found[0]["flights"]


def test_an_aircraft_lost_by_power_fails_the_report():
    outcome = {"departure": None}
    row = {"without": outcome, "with": {"departure": {"time_s": 20.0, "signal": "alpha"}}}
    assert not document_of([row], ())["passed"]
    assert document_of([{"without": outcome, "with": outcome}], ())["passed"]


@pytest.mark.parametrize("airspeed_mps", [32.0, 34.0])
def test_the_gain_margin_is_where_the_closed_loop_leaves_stability(airspeed_mps):
    A, power = about_trim(airspeed_mps)[0].A, about_trim(airspeed_mps)[1]
    least_db = margins(airspeed_mps, EnginePower())["gain_margin_db"]

    def stable(gain_db):
        factor = 10 ** (gain_db / 20)
        return np.linalg.eigvals(closed_loop(A, factor * power, EnginePower())).real.max() < 0.0

    assert stable(0.98 * least_db)
    assert not stable(1.02 * least_db)


def test_the_phase_margin_is_the_rotation_that_meets_minus_one():
    model, power, _ = about_trim(32.0)
    response = loop_response(model.A, power, EnginePower())
    rotation = np.exp(1j * np.deg2rad(margins(32.0, EnginePower())["phase_margin_deg"]))
    assert min(np.abs(1.0 + response * turn).min() for turn in (rotation, rotation.conjugate())) < 0.01
    assert np.abs(1.0 + response).min() > 0.3


def test_margins_over_the_validated_envelope():
    for airspeed_mps in (34.0, 38.0, 45.0, 52.0, 55.0):
        found = margins(airspeed_mps, EnginePower())
        alone, damped = found["phugoid_damping"]
        assert alone < 0.1
        assert damped > 0.4
        assert found["gain_margin_db"] is None or found["gain_margin_db"] > 12.0
        assert found["phase_margin_deg"] > 60.0
        assert found["attitude_zero_rad_s"] > 0.05
