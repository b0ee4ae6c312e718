"""Envelope protection a kernel at a time, on the table of a made-up aircraft."""

import numpy as np
import pytest

from beaver_ftc.control import autopilot
from beaver_ftc.control.autopilot import AUTOPILOT, SPEED
from beaver_ftc.design.model import AIRSPEED, QDYN
from law_records import new_control, put

DT, AILERON, ELEVATOR, RUDDER, FLAP = 0.05, 0, 1, 2, 3
DENSITY = 0.9


def needed(V, flap):
    """Elevator of level flight, rad, at an airspeed in air of 1 kg/m3."""
    return np.radians(-20.0 + 0.4 * V) + 0.3 * flap


def record(dtype):
    return np.zeros(1, dtype).view(np.recarray)[0]


def new(command=45.0, **fields):
    """(autopilot, layout, surfaces, y) with an elevator of which 0.6 is left."""
    pilot = record(AUTOPILOT)
    hold = pilot["holding"]
    speeds = np.linspace(30.0, 55.0, hold["qdyn"].size)
    hold["qdyn"], hold["flap"] = 0.5 * speeds**2, np.linspace(-0.1, 1.0, hold["flap"].size)
    hold["elevator"] = [[needed(V, flap) for flap in hold["flap"]] for V in speeds]
    hold["has_table"], hold["max_airspeed_rate_mps2"], hold["flap_reserve"], hold["from_s"] = (
        1,
        1.0,
        0.05,
        -1.0,
    )
    pilot["dt"], pilot["command"][SPEED], pilot["is_commanded"][SPEED] = DT, command, 1
    pilot["max_healthy_bank"] = pilot["bank_limit"] = hold["bank"] = 0.5
    control = new_control(main=(0, 1, 2), stand_in=FLAP, least_effectiveness=0.1)
    layout, surfaces = control["layout"], control["surfaces"]
    layout["low"], layout["high"] = (-0.5, -0.4, -0.3, -0.1), (0.5, 0.3, 0.3, 1.0)
    surfaces["output"]["effectiveness"] = 1.0, 0.6, 1.0, 1.0
    surfaces["output"]["offset"][ELEVATOR] = 0.02
    put(control, **fields)
    y = np.zeros(8)
    y[AIRSPEED], y[QDYN] = 44.0, 0.5 * DENSITY * 44.0**2
    return pilot, layout, surfaces, y


def at(elevator, flap):
    """Airspeed, m/s, at which level flight takes the elevator, in air of DENSITY."""
    return (np.degrees(elevator - 0.3 * flap) + 20.0) / 0.4 / np.sqrt(DENSITY)


@pytest.mark.parametrize(
    ("flap_left", "up", "down"), [(1.0, -0.05, 0.95), (0.1, -0.05, 0.95), (0.05, 0.12, 0.12)]
)
def test_the_airspeeds_are_those_of_flap_and_elevator_at_their_ends(flap_left, up, down):
    """What is left of the elevator's travel, about where it acts; of the flap all but a reserve."""
    pilot, layout, surfaces, y = new(effectiveness=(1.0, 0.05, 1.0, flap_left))
    surfaces["output"]["offset"][FLAP] = 0.12
    hold = pilot["holding"]
    hold["mean_acting_elevator"], hold["mean_commanded_elevator"] = -0.03, 0.005
    autopilot.find_airspeeds_that_can_be_held(pilot["holding"], layout, surfaces, y)
    assert hold["fastest"] == pytest.approx(at(-0.035 + 0.05 * 0.3, up), abs=0.05)
    slowest = at(-0.035 - 0.05 * 0.4, down)
    in_table = slowest * np.sqrt(DENSITY) > 30.0
    assert hold["slowest"] == pytest.approx(slowest if in_table else 0.0, abs=0.05)


@pytest.mark.parametrize("flap", [-0.2, -0.1, 0.3, 0.72, 0.725, 1.0, 1.1])
def test_the_table_is_straight_between_its_columns_and_goes_on_beyond_them(flap):
    hold = new()[0]["holding"]
    hold["elevator"] = np.arange(12.0)[:, None] + hold["flap"] ** 2
    k = min(max(np.searchsorted(hold["flap"], flap) - 1, 0), hold["flap"].size - 2)
    low, high = hold["flap"][k : k + 2]
    expected = 4.0 + low**2 + (flap - low) * (high + low)
    assert autopilot.interpolate_elevator_needed(hold, 4, flap) == pytest.approx(expected)


def test_what_is_held_comes_within_both_limits_at_its_pace():
    pilot, *_ = new()
    hold, pilot["airspeed_to_fly"] = pilot["holding"], 45.0
    hold["fastest"], hold["slowest"] = np.inf, 45.02
    autopilot.approach_airspeed_to_fly(pilot)
    assert (pilot["airspeed_to_fly"], pilot["airspeed_to_fly_rate"]) == pytest.approx((45.02, 0.02 / DT))
    assert hold["limits_airspeed"] == 1
    hold["slowest"], hold["fastest"] = 0.0, 44.0
    autopilot.approach_airspeed_to_fly(pilot)
    assert (pilot["airspeed_to_fly"], pilot["airspeed_to_fly_rate"]) == pytest.approx((45.02 - DT, -1.0))
    hold["slowest"], hold["fastest"] = 47.0, 46.0  # nothing can be held: the faster of both ends gives way
    for _ in range(40):
        autopilot.approach_airspeed_to_fly(pilot)
    assert pilot["airspeed_to_fly"] == 46.0
    pilot["command_rate"][SPEED], hold["slowest"], hold["fastest"] = 0.3, 0.0, np.inf
    for _ in range(40):
        autopilot.approach_airspeed_to_fly(pilot)
    assert (pilot["airspeed_to_fly"], pilot["airspeed_to_fly_rate"], hold["limits_airspeed"]) == (
        45.0,
        0.3,
        0,
    )
