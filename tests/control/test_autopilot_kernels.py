"""Each loop of the autopilot by itself, one frame from a known state, against the equations of its page."""

import numpy as np
import pytest

import law_records
from beaver_ftc.control import autopilot as loops
from beaver_ftc.control.autopilot import AUTOPILOT, SPEED
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, DPT, QDYN
from law_records import put

DT, G, V, ALPHA_NOW = 0.05, 9.8, 44.0, 0.08
GAINS = {
    "altitude": 0.7, "altitude_i": 0.04, "attitude": 3.0, "speed": 0.3, "speed_i": 0.015, "bank": 1.1,
    "bank_i": 0.2, "heading": 0.25, "heading_i": 0.04, "sideslip": 0.5, "alpha_s": 2.0, "airspeed_s": 3.0,
    "jammed_s": 1.5, "authority_s": 1.2, "bank_s": 6.0, "spare_mps": 2.0, "path_per_mps": 0.02, "loose": 0.4,
    "protection": 2.0,
}  # fmt: skip


def record(dtype):
    return np.zeros(1, dtype).view(np.recarray)[0]


def new_autopilot(*channels, **fields):
    pilot = record(AUTOPILOT)
    pilot["dt"], pilot["gravity"], pilot["airspeed"], pilot["alpha"] = DT, G, V, ALPHA_NOW
    pilot["dihedral"], pilot["slowest_mps"], pilot["steepest_alpha"] = 0.02, 35.0, 0.26
    pilot["trim_power"], pilot["low_power"], pilot["high_power"] = 20.0, 12.0, 28.0
    pilot["allowed_power"] = 28.0
    pilot["max_healthy_rate"], pilot["rate_limit"], pilot["max_healthy_bank"], pilot["bank_limit"] = (
        (0.2, 0.1, 0.15),
        10.0,
        0.5,
        0.5,
    )
    pilot["flying"], pilot["thrust"], pilot["climb_in_trim"] = 1, (0.2, 0.1), 0.01
    for name, gain in GAINS.items():
        pilot["gain"][name] = gain
    for channel in channels:
        pilot["is_commanded"][channel] = 1
    for name, value in fields.items():
        pilot[name] = value
    return pilot


def new_control(**fields):
    control = law_records.new_control(main=(0, 1, 2), effectiveness=1.0, least_effectiveness=0.1)
    control["power"]["config"]["dpt_factor"], control["power"]["config"]["highest_dpt"] = 40.0, 0.9
    return put(control, **fields)


def new_y(dpt=0.4):
    y = np.zeros(8)
    y[[ALPHA, BETA, AIRSPEED, QDYN, DPT]] = 0.1, 0.03, 46.0, 0.55 * 46.0**2, dpt
    return y


def test_thrust_per_inhg_is_the_slope_of_the_thrust():
    """Thrust over mass q (a dpt + b alpha dpt^2), dpt affine in the pressure."""
    pilot, control, y = new_autopilot(), new_control(), new_y()
    slope = 40.0 / (2.0 * y[QDYN] * V)

    def thrust(inhg):
        dpt = y[DPT] + slope * inhg
        return y[QDYN] * (0.2 * dpt + 0.1 * ALPHA_NOW * dpt**2)

    numeric = (thrust(1e-4) - thrust(-1e-4)) / 2e-4
    assert loops.acceleration_per_power(pilot, control["power"], y) == pytest.approx(numeric, rel=1e-6)
    pilot["thrust"] = -1.0, 0.0
    assert loops.acceleration_per_power(pilot, control["power"], y) == 1e-3


PUSH = 0.2  # m/s2 per inHg


def test_paths_are_bounded_by_the_engine_and_the_airspeed_there_is():
    pilot = new_autopilot(SPEED)
    pilot["airspeed_to_fly"], pilot["full_power"] = 43.0, 28.0
    low, high = loops.path_angle_limits(pilot, PUSH)
    # idle is 8 inHg below trim, full 8 above; 44 m/s is 1 below 45 and 3 above 41
    assert low == pytest.approx(max(0.01 - 8 * PUSH / G - 0.02 * 1.0, -0.15))
    assert high == pytest.approx(min(0.01 + 8 * PUSH / G + 0.02 * 3.0, 0.15))
    low, high = loops.path_angle_limits(pilot, 0.01)
    assert low == pytest.approx(0.01 - 0.08 / G - 0.02)
    assert high == pytest.approx(0.01 + 0.08 / G + 0.06)


def test_without_an_airspeed_the_engine_stays_and_descents_are_free():
    low, high = loops.path_angle_limits(new_autopilot(), PUSH)
    assert low == -0.15
    assert high == pytest.approx(min(0.01 + 0.02 * (V - 35.0), 0.15))


@pytest.mark.parametrize("angle", [-9.0, -3.2, -3.1, 0.0, 2.0, 3.2, 9.0])
def test_a_direction_is_given_within_half_a_turn(angle):
    assert loops.wrap_to_half_turn(angle) == pytest.approx(np.arctan2(np.sin(angle), np.cos(angle)))
