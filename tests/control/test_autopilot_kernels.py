"""Each loop of the autopilot by itself, one frame from a known state, against the equations of its page."""

import numpy as np
import pytest

from beaver_ftc.control.autopilot_setup import AUTOPILOT
from beaver_ftc.control.profile import SPEED
from beaver_ftc.control.vertical_loops import acceleration_per_power, path_angle_limits
from beaver_ftc.design.table import DPT, QDYN
from law_records import new_control

G, V, ALPHA_NOW = 9.8, 44.0, 0.08


def new_autopilot(*channels):
    pilot = np.zeros(1, AUTOPILOT).view(np.recarray)[0]
    pilot["gravity"], pilot["airspeed"], pilot["alpha"], pilot["slowest_mps"] = G, V, ALPHA_NOW, 35.0
    pilot["trim_power"], pilot["low_power"] = 20.0, 12.0
    pilot["thrust"], pilot["climb_in_trim"] = (0.2, 0.1), 0.01
    pilot["gain"]["spare_mps"], pilot["gain"]["path_per_mps"] = 2.0, 0.02
    for channel in channels:
        pilot["is_commanded"][channel] = 1
    return pilot


def test_thrust_per_inhg_is_the_slope_of_the_thrust():
    """Thrust over mass q (a dpt + b alpha dpt^2), dpt affine in the pressure."""
    pilot, power, y = new_autopilot(), new_control()["power"], np.zeros(8)
    power["config"]["dpt_factor"], y[QDYN], y[DPT] = 40.0, 0.55 * 46.0**2, 0.4
    slope = 40.0 / (2.0 * y[QDYN] * V)

    def thrust(inhg):
        dpt = y[DPT] + slope * inhg
        return y[QDYN] * (0.2 * dpt + 0.1 * ALPHA_NOW * dpt**2)

    numeric = (thrust(1e-4) - thrust(-1e-4)) / 2e-4
    assert acceleration_per_power(pilot, power, y) == pytest.approx(numeric, rel=1e-6)
    pilot["thrust"] = -1.0, 0.0
    assert acceleration_per_power(pilot, power, y) == 1e-3


PUSH = 0.2  # m/s2 per inHg


def test_paths_are_bounded_by_the_engine_and_the_airspeed_there_is():
    pilot = new_autopilot(SPEED)
    pilot["airspeed_to_fly"], pilot["full_power"] = 43.0, 28.0
    low, high = path_angle_limits(pilot, PUSH)
    # idle is 8 inHg below trim, full 8 above; 44 m/s is 1 below 45 and 3 above 41
    assert low == pytest.approx(max(0.01 - 8 * PUSH / G - 0.02 * 1.0, -0.15))
    assert high == pytest.approx(min(0.01 + 8 * PUSH / G + 0.02 * 3.0, 0.15))
    low, high = path_angle_limits(pilot, 0.01)
    assert low == pytest.approx(0.01 - 0.08 / G - 0.02)
    assert high == pytest.approx(0.01 + 0.08 / G + 0.06)


def test_without_an_airspeed_the_engine_stays_and_descents_are_free():
    low, high = path_angle_limits(new_autopilot(), PUSH)
    assert low == -0.15
    assert high == pytest.approx(min(0.01 + 0.02 * (V - 35.0), 0.15))
