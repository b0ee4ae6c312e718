"""Envelope protection a kernel at a time, on the table of a made-up aircraft."""

import numpy as np
import pytest

from beaver_ftc.control import autopilot
from beaver_ftc.control.autopilot import AUTOPILOT, BANK_LIMIT, FASTEST, SLOWEST, SPEED
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


@pytest.mark.parametrize("unexplained", [0.0, -0.5 / 8.0])
def test_what_acts_is_averaged_from_the_first_frame_on(unexplained):
    hold = new()[0]["holding"]
    commands = np.random.default_rng(1).uniform(-0.2, 0.2, 40)
    for command in commands:
        autopilot.average_acting_elevator(hold, DT, 0.02, 0.6 * command, unexplained)
    assert hold["n_averaged_frames"] == 40
    assert hold["mean_acting_elevator"] == pytest.approx(0.02 + 0.6 * commands.mean() + unexplained)
    assert hold["mean_commanded_elevator"] == pytest.approx(0.6 * commands.mean())


def test_later_it_follows_within_four_seconds():
    hold = new()[0]["holding"]
    hold["n_averaged_frames"], hold["mean_acting_elevator"], hold["mean_commanded_elevator"] = (
        10_000,
        0.3,
        0.4,
    )
    for _ in range(80):
        autopilot.average_acting_elevator(hold, DT, 0.02, 0.6 * 0.1, 0.0)
    left = (1.0 - DT / 4.0) ** 80
    assert hold["mean_acting_elevator"] == pytest.approx(0.08 + left * (0.3 - 0.08))
    assert hold["mean_commanded_elevator"] == pytest.approx(0.06 + left * (0.4 - 0.06))


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


@pytest.mark.parametrize(("offset", "stands"), [(-0.3, -0.1), (1.2, 1.0)])
def test_a_lost_flap_stands_within_its_travel(offset, stands):
    pilot, layout, surfaces, y = new(effectiveness=(1.0, 0.0, 1.0, 0.0))
    surfaces["output"]["offset"][FLAP] = offset
    pilot["holding"]["mean_acting_elevator"] = needed(40.0, stands)
    autopilot.find_airspeeds_that_can_be_held(pilot["holding"], layout, surfaces, y)
    assert pilot["holding"]["fastest"] == pytest.approx(40.0 / np.sqrt(DENSITY), abs=0.05)
    assert pilot["holding"]["slowest"] == pytest.approx(40.0 / np.sqrt(DENSITY), abs=0.05)


@pytest.mark.parametrize("flap", [-0.2, -0.1, 0.3, 0.72, 0.725, 1.0, 1.1])
def test_the_table_is_straight_between_its_columns_and_goes_on_beyond_them(flap):
    hold = new()[0]["holding"]
    hold["elevator"] = np.arange(12.0)[:, None] + hold["flap"] ** 2
    k = min(max(np.searchsorted(hold["flap"], flap) - 1, 0), hold["flap"].size - 2)
    low, high = hold["flap"][k : k + 2]
    expected = 4.0 + low**2 + (flap - low) * (high + low)
    assert autopilot.interpolate_elevator_needed(hold, 4, flap) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("effectiveness", "stand_in", "known", "watched"),
    [
        ((1, 0.6, 1, 1), FLAP, 1, True), ((1, 1, 1, 1), FLAP, 1, False), ((1, 1, 1, 0.5), FLAP, 1, True),
        ((1, 0.6, 1, 1), FLAP, 0, False), ((1, 1, 1, 0.5), -1, 1, False), ((0.5, 1, 0.5, 1), FLAP, 1, False),
        ((1, 1, 1, 0.5), AILERON, 1, False), ((0.5, 1, 1, 1), AILERON, 1, True),
    ],
)  # fmt: skip
def test_only_a_pitch_that_is_not_whole_is_watched(effectiveness, stand_in, known, watched):
    pilot, layout, surfaces, y = new(effectiveness=effectiveness, stand_in=stand_in)
    pilot["holding"]["has_table"], pilot["holding"]["n_averaged_frames"] = known, 3
    autopilot.limit_airspeed_to_fly(pilot, layout, surfaces, np.zeros(4), 0.0, y, 1.0)
    assert pilot["holding"]["n_averaged_frames"] == (4 if watched else 0)
    assert pilot["airspeed_to_fly"] == 45.0


def test_nothing_is_concluded_within_the_first_half_second():
    pilot, layout, surfaces, y = new(effectiveness=(1.0, 0.0, 1.0, 0.0))
    surfaces["output"]["offset"][[ELEVATOR, FLAP]] = needed(40.0, 0.2), 0.2
    fastest = []
    for k in range(12):
        autopilot.limit_airspeed_to_fly(pilot, layout, surfaces, np.zeros(4), 0.0, y, k * DT)
        fastest.append(float(pilot["holding"]["fastest"]))
    assert fastest[:10] == [np.inf] * 10
    assert fastest[10:] == pytest.approx([40.0 / np.sqrt(DENSITY)] * 2, abs=0.05)
    assert pilot["holding"]["from_s"].tolist() == pytest.approx([10 * DT, -1.0, -1.0])
    assert pilot["airspeed_to_fly"] == pytest.approx(45.0 - 2 * DT * 1.0)  # on its way at its pace


def noted(command=45.0, fastest=np.inf, slowest=0.0, commanded=1, effectiveness=(1, 1, 1, 1), limit=0.5):
    pilot, layout, surfaces, _ = new(command=command, effectiveness=effectiveness)
    hold = pilot["holding"]
    hold["fastest"], hold["slowest"], pilot["is_commanded"][SPEED] = fastest, slowest, commanded
    pilot["bank_limit"] = limit
    autopilot.record_limits_in_force(pilot, layout["main"], surfaces["output"]["effectiveness"], 7.0)
    return hold


@pytest.mark.parametrize(
    ("given", "kind", "bites"),
    [
        ({"fastest": 44.4}, FASTEST, True), ({"fastest": 44.6}, FASTEST, False),
        ({"slowest": 45.6}, SLOWEST, True), ({"slowest": 45.4}, SLOWEST, False),
        ({"fastest": 40.0, "commanded": 0}, FASTEST, False),
    ],
)  # fmt: skip
def test_a_limit_that_bites_by_half_a_metre_per_second_is_announced(given, kind, bites):
    hold = noted(**given)
    assert hold["in_force"].tolist() == [bites and kind == i for i in range(3)]
    assert hold["from_s"][kind] == (7.0 if bites else -1.0)
    assert hold["value"][kind] == (given.get("fastest", given.get("slowest")) if bites else 0.0)


@pytest.mark.parametrize("surface", [AILERON, RUDDER])
def test_a_bank_limit_is_announced_as_it_has_been_on_average(surface):
    effectiveness = np.ones(4)
    effectiveness[surface] = 0.9
    hold = noted(effectiveness=effectiveness, limit=0.1)
    assert hold["bank"] == pytest.approx(0.5 - DT / 4.0 * 0.4)
    assert not hold["in_force"].any()  # 0.005 rad as yet
    pilot, layout, surfaces, _ = new(effectiveness=effectiveness)
    pilot["bank_limit"] = 0.1
    for k in range(6):
        autopilot.record_limits_in_force(pilot, layout["main"], surfaces["output"]["effectiveness"], k - 4.0)
    assert pilot["holding"]["in_force"][BANK_LIMIT] == 1
    assert pilot["holding"]["from_s"][BANK_LIMIT] == 0.0  # that it bites in the sixth as well is no news
    left = 0.1 + 0.4 * (1.0 - DT / 4.0) ** 6
    assert pilot["holding"]["value"][BANK_LIMIT] == pytest.approx(left)
    assert noted(limit=0.1)["bank"] == 0.5


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
