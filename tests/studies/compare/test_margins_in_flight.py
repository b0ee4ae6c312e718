"""Margins measured in flight against the default law's loop in closed form; unstable loops have none."""

import numpy as np
import pytest

from beaver_ftc.studies.compare.margins_in_flight import _measured
from beaver_ftc.studies.margins import at
from flying import loss, scenario


@pytest.mark.parametrize("actuators", ["ideal", "servo"])
def test_margins_in_flight_are_those_of_the_loop_in_closed_form(actuators):
    """Two flights of JSBSim, and the linearised aircraft with the law's equations."""
    flown = scenario(control={"law": "fault-tolerant"}, actuators=actuators, faults=[loss("rudder", 0.5)])
    closed = {margin.surface: margin for margin in at(flown) if margin.fault == "none"}
    for measured in _measured(flown):
        expected = closed[measured.surface]
        assert measured.up_db == pytest.approx(expected.up_db, abs=0.6)
        assert measured.down_db == expected.down_db == np.inf
        assert measured.phase_deg == pytest.approx(expected.phase_deg, abs=1.5)


def test_a_law_that_is_plugged_in_is_measured_as_well():
    """Less gain, more margin; an unstable loop has none."""

    def least(deflection_deg):
        options = {"deflection_deg": deflection_deg, "integral_deg": 0.5}
        found = _measured(scenario(control={"law": "lqr", "options": options}))
        return min(margin.up_db for margin in found)

    gains_db = [least(deflection_deg) for deflection_deg in (0.3, 1.0, 3.0)]
    assert gains_db[0] > gains_db[1] > gains_db[2] > 3.0
    assert least(1e4) == 0.0
