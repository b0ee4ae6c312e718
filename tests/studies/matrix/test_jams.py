"""Aileron and rudder jammed far off neutral: what each gives the other, and that nothing runs away."""

import numpy as np
import pytest

from beaver_ftc.results.metrics import metrics
from beaver_ftc.studies.matrix.fault_matrix import REFERENCE, trimmed_deg
from flying import flown

AT_S = 12.0


def jammed(surface, off_deg, airspeed_mps, law="fault-tolerant-published"):
    """(flight, log) of sixty seconds with a surface jammed so far off its trim."""
    position_deg = trimmed_deg(airspeed_mps, surface) + off_deg
    return flown(
        duration_s=AT_S + 60.0,
        initial={"airspeed_mps": airspeed_mps},
        reference=REFERENCE,
        faults=[{"actuator": surface, "type": "stuck", "position_deg": position_deg, "at_s": AT_S}],
        fdi={"fault_class": "all"},
        control={"law": law},
    )


def largest_deg(log, column):
    return float(np.rad2deg(np.abs(log[column][log["t_s"] > AT_S])).max())


@pytest.mark.parametrize("airspeed_mps", [38.0, 45.0, 52.0])
@pytest.mark.parametrize("off_deg", [-10.0, -7.5, -5.0, 5.0, 7.5, 10.0])
class TestJams:
    def test_ailerons_the_rudder_keeps_the_yaw_and_the_dihedral_the_bank(self, off_deg, airspeed_mps):
        flight, log = jammed("aileron", off_deg, airspeed_mps)
        assert (flight.departure, flight.isolated) == (None, "aileron")
        assert np.isfinite(log.rows[:, : log.columns.index("p_measured_rad_s")]).all()
        assert log.rms_deg_s("r", AT_S + 1.0) < 0.2
        assert log.rms_deg_s("q", AT_S + 1.0) < 0.3
        assert largest_deg(log, "p_rad_s") < 20.0
        assert largest_deg(log, "phi_rad") < (25.0 if abs(off_deg) == 5.0 else 40.0)
        assert largest_deg(log, "beta_rad") < 33.0
        assert np.abs(np.rad2deg(log["p_rad_s"][-1000:])).max() < 4.0  # it has come to rest

    def test_rudder_the_ailerons_keep_the_roll_and_the_sideslip_stays_bounded(self, off_deg, airspeed_mps):
        flight, log = jammed("rudder", off_deg, airspeed_mps)
        assert (flight.departure, flight.isolated) == (None, "rudder")
        assert np.isfinite(log.rows[:, : log.columns.index("p_measured_rad_s")]).all()
        assert log.rms_deg_s("p", AT_S + 1.0) < 0.3
        assert log.rms_deg_s("q", AT_S + 1.0) < 0.3
        assert largest_deg(log, "r_rad_s") < 25.0
        assert largest_deg(log, "phi_rad") < 20.0
        assert largest_deg(log, "beta_rad") < 33.0
        assert metrics(flight)["authority"]["r"]["beyond_s"] > 1.0  # no law could have held the yaw rate

    @pytest.mark.parametrize("surface", ["aileron", "rudder"])
    def test_being_told_would_have_been_no_help(self, surface, off_deg, airspeed_mps):
        """Bank, sideslip and rates as large under the law that is told the fault at once."""
        (_, ours), (_, told) = (
            jammed(surface, off_deg, airspeed_mps, law)
            for law in ("fault-tolerant-published", "oracle-published")
        )
        for column in ("phi_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s"):
            assert largest_deg(ours, column) < 1.05 * largest_deg(told, column) + 0.5
