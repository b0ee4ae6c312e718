"""Elevator and flap lost: the report, its flights and its margins."""

import numpy as np
import pytest

from beaver_ftc.studies.engine.study import run_study
from beaver_ftc.studies.matrix import pitch_lost
from beaver_ftc.studies.matrix.pitch_lost import LAWS, LOST, pitch_lost_study
from beaver_ftc.studies.matrix.power_margins import about_trim, loop_response, margins, with_law
from samples import AT_NIGHT

BY_DAY = ("elevator +1 deg", "elevator -4 deg", "elevator floats", "flap 20 deg down")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    some = LOST if AT_NIGHT else {name: LOST[name] for name in BY_DAY}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pitch_lost, "LOST", some)
        return run_study(pitch_lost_study((45.0,)), tmp_path_factory.mktemp("pitch"))


def test_power_loses_no_aircraft_and_keeps_some(found):
    assert found["passed"]
    assert found["harmed"] == 0
    assert found["saved"] == len(LAWS)  # the flap 20 deg down


def test_up_to_four_degrees_off_trim_it_swings_less_and_never_banks_away(found):
    for row in found["flights"]:
        assert row["with"]["departure"] is None, row
        assert row["with"]["bank_deg"] < 30.0, row
        if not row["lost"].startswith(("elevator -8", "flap 20")):
            assert row["with"]["q_rms_deg_s"] < row["without"]["q_rms_deg_s"], row
            assert row["with"]["theta_swing_deg"] < row["without"]["theta_swing_deg"], row


@pytest.mark.parametrize("airspeed_mps", [32.0, 34.0])
def test_the_gain_margin_is_where_the_closed_loop_leaves_stability(airspeed_mps):
    A, power = about_trim(airspeed_mps)[0].A, about_trim(airspeed_mps)[1]
    least_db = margins(airspeed_mps)["gain_margin_db"]

    def stable(gain_db):
        factor = 10 ** (gain_db / 20)
        F, b, k = with_law(A, factor * power)
        return np.linalg.eigvals(F + np.outer(b, k)).real.max() < 0.0

    assert stable(0.98 * least_db)
    assert not stable(1.02 * least_db)


def test_the_phase_margin_is_the_rotation_that_meets_minus_one():
    model, power, _ = about_trim(32.0)
    response = loop_response(*with_law(model.A, power))
    rotation = np.exp(1j * np.deg2rad(margins(32.0)["phase_margin_deg"]))
    assert min(np.abs(1.0 + response * turn).min() for turn in (rotation, rotation.conjugate())) < 0.01
    assert np.abs(1.0 + response).min() > 0.3


def test_margins_over_the_validated_envelope():
    for airspeed_mps in (34.0, 38.0, 45.0, 52.0, 55.0):
        found = margins(airspeed_mps)
        alone, damped = found["phugoid_damping"]
        assert alone < 0.1
        assert damped > 0.4
        assert found["gain_margin_db"] is None or found["gain_margin_db"] > 12.0
        assert found["phase_margin_deg"] > 60.0
        assert found["attitude_zero_rad_s"] > 0.05
