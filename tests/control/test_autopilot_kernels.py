"""Each loop of the autopilot by itself, one frame from a known state, against the equations of its page."""

import numpy as np
import pytest

import law_records
from beaver_ftc.control import autopilot as loops
from beaver_ftc.control.autopilot import ALTITUDE, AUTOPILOT, BANK, HEADING, N_CHANNELS, SPEED
from beaver_ftc.control.engines import follow_autopilot
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, DPT, QDYN
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from law_records import put

DT, G, V, ALPHA_NOW = 0.05, 9.8, 44.0, 0.08
AILERON, ELEVATOR, RUDDER = 0, 1, 2
GAINS = {
    "altitude": 0.7, "altitude_i": 0.04, "attitude": 3.0, "speed": 0.3, "speed_i": 0.015, "bank": 1.1,
    "bank_i": 0.2, "heading": 0.25, "heading_i": 0.04, "sideslip": 0.5, "alpha_s": 2.0, "airspeed_s": 3.0,
    "jammed_s": 1.5, "authority_s": 1.2, "bank_s": 6.0, "spare_mps": 2.0, "path_per_mps": 0.02, "loose": 0.4,
    "protection": 2.0,
}  # fmt: skip
MEASURED = np.dtype([("y", "f8", (8,)), ("attitude", "f8", (3,)), ("altitude", "f8")], align=True)


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


def follow(pilot, control, y):
    saturated = control["allocation"]["output"]["saturated"]
    loops.smooth_signals_and_losses(pilot, control["layout"], control["surfaces"], saturated, False, y)


def limit(pilot, control):
    axes, by_engines = control["axes"], np.zeros((2, 3))
    loops.limit_rates_and_bank(pilot, control["layout"], axes["G"], axes["hold"], by_engines)


def full_power(pilot, control, y):
    left, at_stop = (
        control["surfaces"]["output"]["effectiveness"],
        control["allocation"]["output"]["saturated"],
    )
    return loops.highest_power(pilot, control["power"], left[RUDDER], at_stop[RUDDER], y)


def new_y(alpha=0.1, beta=0.03, airspeed=46.0, dpt=0.4):
    y = np.zeros(8)
    y[[ALPHA, BETA, AIRSPEED, QDYN, DPT]] = alpha, beta, airspeed, 0.55 * airspeed**2, dpt
    return y


def seen(attitude=(0.0, 0.0, 0.0), altitude=1000.0, **air):
    measured = record(MEASURED)
    measured["y"], measured["attitude"], measured["altitude"] = new_y(**air), attitude, altitude
    return measured


def test_it_takes_over_in_trim():
    pilot = new_autopilot(flying=0)
    loops.take_over(pilot, new_y(), np.array([0.0, 0.13, 0.0]))
    assert pilot["flying"] == 1
    assert pilot["alpha"] == 0.1
    assert pilot["airspeed"] == pilot["recent_airspeed_mps"] == 46.0
    assert pilot["climb_in_trim"] == pytest.approx(0.03)


@pytest.mark.parametrize(("surface", "share"), [(AILERON, "roll_loss_share"), (RUDDER, "yaw_loss_share")])
@pytest.mark.parametrize("left", [0.0, 0.0999, 0.1, 1.0])
def test_signals_are_smoothed_and_a_lost_surface_is_noticed(surface, share, left):
    pilot, control = new_autopilot(roll_loss_share=0.5, yaw_loss_share=0.5), new_control()
    control["surfaces"]["output"]["effectiveness"][surface] = left
    follow(pilot, control, new_y())
    assert pilot["alpha"] == pytest.approx(ALPHA_NOW + DT / 2.0 * (0.1 - ALPHA_NOW))
    assert pilot["airspeed"] == pytest.approx(V + DT / 3.0 * (46.0 - V))
    for name in ("roll_loss_share", "yaw_loss_share"):
        goal = 1.0 if name == share and left < 0.1 else 0.0
        assert pilot[name] == pytest.approx(0.5 + DT / 1.5 * (goal - 0.5))


@pytest.mark.parametrize(
    ("engines_yaw", "left", "at_stop", "alone"),
    [(True, 0.0, 0, 1.0), (True, 1.0, 1, 1.0), (True, 0.1, 0, 0.0), (False, 0.0, 1, None)],
)
def test_engines_yaw_alone_once_the_rudder_is_gone_or_at_its_stop(engines_yaw, left, at_stop, alone):
    """Within 5 s."""
    pilot, control = new_autopilot(engines_alone_yaw_share=0.4), new_control()
    surfaces, saturated = control["surfaces"], control["allocation"]["output"]["saturated"]
    surfaces["output"]["effectiveness"][RUDDER], saturated[RUDDER] = left, at_stop
    loops.smooth_signals_and_losses(pilot, control["layout"], surfaces, saturated, engines_yaw, new_y())
    goal = 0.4 if alone is None else alone
    assert pilot["engines_alone_yaw_share"] == pytest.approx(0.4 + DT / 5.0 * (goal - 0.4))


def limited(jammed=0.0, loose=0.0, hold=(0.0, 0.0, 0.0)):
    pilot, control = new_autopilot(roll_loss_share=jammed, yaw_loss_share=loose), new_control(hold=hold)
    control["axes"]["G"] = np.diag([0.1, 0.2, 0.05, 0.0])[:3]
    control["layout"]["low"], control["layout"]["high"] = -0.5, (1.0, 0.5, 2.0, 0.0)
    limit(pilot, control)
    return pilot


def test_rates_are_what_the_smaller_spare_acceleration_gives():
    pilot = limited(hold=(0.01, 0.06, -0.03))
    # -0.05..0.1, -0.1..0.1, -0.025..0.1 rad/s2, less what holding takes; roll: 1.2 s of 0.06 is below 0.2
    assert pilot["rate_limit"] == pytest.approx([1.2 * 0.06, 1.2 * 0.04, 0.0])
    assert pilot["bank_limit"] == pytest.approx(6.0 * 1.2 * 0.06)


def test_a_healthy_aircraft_is_asked_for_no_more_than_declared():
    pilot, control = new_autopilot(), new_control()
    control["layout"]["low"], control["layout"]["high"] = -1.0, 1.0
    put(control, G=np.eye(3, 4))
    limit(pilot, control)
    assert pilot["rate_limit"] == pytest.approx([0.2, 0.1, 0.15])
    assert pilot["bank_limit"] == 0.5


def test_without_ailerons_roll_is_what_sideslip_gives_and_banks_are_halved():
    pilot = limited(jammed=0.9, hold=(0.2, 0.0, 0.0))
    assert pilot["rate_limit"][ROLL] == pytest.approx(0.9 * 0.02 * V * 0.14)
    assert limited(jammed=0.9, loose=0.2)["bank_limit"] <= 0.5 * (1.0 - 0.45)
    loose = limited(loose=1.0)  # ailerons can leave a bank; a fifth less, for the sideslip
    assert loose["bank_limit"] == pytest.approx(min(0.4, 6.0 * loose["rate_limit"][ROLL]))


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


@pytest.mark.parametrize("commanded", [36.0, 43.0])
def test_nothing_is_climbed_below_the_slowest_airspeed(commanded):
    pilot = new_autopilot(SPEED, airspeed=33.0)
    pilot["airspeed_to_fly"], pilot["full_power"] = commanded, 28.0
    slow = max(35.0, commanded - 2.0)
    assert loops.path_angle_limits(pilot, 0.01)[1] == pytest.approx(
        0.01 + 0.08 / G - 0.02 * (slow - 33.0), abs=1e-12
    )
    pilot["airspeed"] = 10.0
    assert loops.path_angle_limits(pilot, 0.01)[1] == -0.15


def test_without_an_airspeed_the_engine_stays_and_descents_are_free():
    low, high = loops.path_angle_limits(new_autopilot(), PUSH)
    assert low == -0.15
    assert high == pytest.approx(min(0.01 + 0.02 * (V - 35.0), 0.15))


@pytest.mark.parametrize("error", [-2.0, 0.5, 3.0])
def test_a_path_closes_a_height_and_integrates_what_is_missing(error):
    pilot = new_autopilot(ALTITUDE, missing_path_angle=0.004)
    pilot["command"][ALTITUDE], pilot["command_rate"][ALTITUDE] = 1000.0 + error, 0.3
    path = loops.path_angle_to_fly(pilot, seen(), PUSH)
    assert path == pytest.approx((0.3 + 0.7 * error) / V + 0.004)
    assert pilot["missing_path_angle"] == pytest.approx(0.004 + DT * 0.04 * error / V)


@pytest.mark.parametrize("error", [-100.0, 100.0])
def test_a_path_beyond_what_can_be_flown_is_cut_and_not_integrated(error):
    pilot = new_autopilot(ALTITUDE, missing_path_angle=0.004)
    pilot["command"][ALTITUDE] = 1000.0 + error
    assert (
        loops.path_angle_to_fly(pilot, seen(), PUSH) == loops.path_angle_limits(pilot, PUSH)[int(error > 0)]
    )
    assert pilot["missing_path_angle"] == 0.004


def test_what_is_found_missing_has_a_limit_and_without_a_height_the_path_is_the_flown_one():
    pilot = new_autopilot(ALTITUDE, missing_path_angle=0.2, command_rate=(-0.15 * V, 0, 0, 0))
    pilot["command"][ALTITUDE] = 1000.0
    loops.path_angle_to_fly(pilot, seen(), PUSH)
    assert pilot["missing_path_angle"] == 0.1
    flown = loops.path_angle_to_fly(new_autopilot(), seen(attitude=(0, 0.12, 0)), PUSH)
    assert flown == pytest.approx(0.12 - ALPHA_NOW)


def test_the_pitch_attitude_is_path_and_incidence_in_the_bank():
    pilot, attitude = new_autopilot(ALTITUDE), np.array([0.4, 0.1, 0.0])
    wanted = 3.0 * (0.02 + ALPHA_NOW * np.cos(0.4) - 0.1)
    assert loops.pitch_attitude_rate(pilot, new_y(), attitude, 0.02) == pytest.approx(wanted)
    pilot["rate_limit"] = 0.001
    assert loops.pitch_attitude_rate(pilot, new_y(), attitude, 0.02) == pytest.approx(-0.001)
    pilot["rate_limit"] = 10.0
    assert loops.pitch_attitude_rate(pilot, new_y(alpha=0.25), attitude, 0.9) == pytest.approx(2.0 * 0.01)
    assert loops.pitch_attitude_rate(new_autopilot(), new_y(), attitude, 0.02) == 0.0


# Engines that alone yaw and roll get a quarter of the gain: 1 - 0.75 x 0.5 x 0.8 with half of the ailerons.
BY_ENGINES = pytest.mark.parametrize(
    ("jammed", "alone", "gain"), [(0.5, 0.0, 1.0), (0.0, 0.8, 1.0), (0.5, 0.8, 0.7)]
)


@BY_ENGINES
def test_a_heading_is_flown_by_a_bank(jammed, alone, gain):
    pilot = new_autopilot(HEADING, missing_turn_rate=0.5, max_healthy_bank=2.0, bank_limit=2.0)
    pilot["roll_loss_share"], pilot["engines_alone_yaw_share"] = jammed, alone
    pilot["command"][HEADING], pilot["command_rate"][HEADING] = 3.1, 0.01
    rate = loops.bank_angle_rate(pilot, np.array([0.02, 0.0, -3.1]))
    error = -(2 * np.pi - 6.2)
    assert rate == pytest.approx(1.1 * gain * (V / G * (0.25 * gain * error + 0.01) - 0.02))
    assert pilot["missing_turn_rate"] == 0.0


@pytest.mark.parametrize("error", [0.02, 5.0])
def test_where_nothing_acts_in_yaw_turns_are_slow_and_a_drift_is_found(error):
    pilot = new_autopilot(HEADING, yaw_loss_share=0.8, missing_turn_rate=0.03, bank_limit=100.0)
    pilot["command"][HEADING] = min(error, 3.0)
    rate = loops.bank_angle_rate(pilot, np.zeros(3))
    off = min(error, 3.0)
    drift = 0.8 * min(0.03 + DT * 0.8 * 0.04 * off, 0.1)
    assert pilot["missing_turn_rate"] == pytest.approx(drift)
    assert rate == pytest.approx(1.1 * V / G * ((1 - 0.8 * 0.6) * 0.25 * off + drift))


def test_the_drift_found_has_a_limit():
    pilot = new_autopilot(HEADING, yaw_loss_share=1.0, missing_turn_rate=0.3)
    loops.bank_angle_rate(pilot, np.zeros(3))
    assert pilot["missing_turn_rate"] == 0.1


@BY_ENGINES
def test_a_bank_is_held_and_what_roll_misses_without_ailerons_is_integrated(jammed, alone, gain):
    pilot = new_autopilot(BANK, roll_loss_share=jammed, missing_roll_rate=0.02, engines_alone_yaw_share=alone)
    pilot["command"][BANK] = 0.3
    rate = loops.bank_angle_rate(pilot, np.array([0.1, 0.0, 0.0]))
    assert rate == pytest.approx(gain * 1.1 * 0.2 + jammed * 0.02)
    assert pilot["missing_roll_rate"] == pytest.approx(0.02 + jammed * DT * gain * 0.2 * 0.2)
    pilot["bank_limit"], pilot["missing_roll_rate"] = 0.05, 0.0
    assert loops.bank_angle_rate(pilot, np.array([0.1, 0.0, 0.0])) == pytest.approx(gain * 1.1 * -0.05)
    pilot["rate_limit"], kept = 0.01, float(pilot["missing_roll_rate"])
    assert loops.bank_angle_rate(pilot, np.array([0.4, 0.0, 0.0])) == -0.01
    assert pilot["missing_roll_rate"] == kept
    assert loops.bank_angle_rate(new_autopilot(), np.array([0.1, 0.0, 0.0])) == 0.0


@pytest.mark.parametrize("jammed", [0.0, 0.6])
@pytest.mark.parametrize("rolling", [0.02, 1.0])
def test_the_rudder_keeps_the_sideslip_that_rolls_where_the_ailerons_do_not(jammed, rolling):
    pilot, attitude = new_autopilot(BANK, roll_loss_share=jammed), np.zeros(3)
    loops.set_body_rates(pilot, new_y(), attitude, rolling, 0.0)
    wanted = -jammed * min(rolling / (0.02 * V), 0.14)
    assert pilot["rates"] == pytest.approx([rolling, 0.0, 0.5 * (0.03 - wanted)])


def test_without_a_lateral_command_nothing_yaws_and_a_yaw_is_limited():
    pilot = new_autopilot(ALTITUDE)
    loops.set_body_rates(pilot, new_y(), np.array([0.3, 0.1, 0.0]), 0.02, 0.05)
    assert pilot["rates"] == pytest.approx([0.02, 0.05 * np.cos(0.3), 0.0])
    pilot = new_autopilot(HEADING, rate_limit=(10.0, 10.0, 0.004))
    loops.set_body_rates(pilot, new_y(), np.zeros(3), 0.0, 0.0)
    assert pilot["rates"][YAW] == 0.004


def test_upside_down_the_turn_stays_finite():
    pilot = new_autopilot(BANK)
    loops.set_body_rates(pilot, new_y(beta=0.0), np.array([1.55, 0.0, 0.0]), 0.0, 0.0)
    turning = G / V * np.sin(1.55) / 0.1
    assert pilot["rates"][PITCH] == pytest.approx(turning * np.sin(1.55))
    assert pilot["rates"][YAW] == pytest.approx(turning * np.cos(1.55))


def throttled(path=0.03, y=None, power=(), rudder=1.0, **fields):
    pilot, control = (
        new_autopilot(SPEED, **{"recent_airspeed_mps": 43.0, "missing_acceleration": 0.05, **fields}),
        new_control(),
    )
    pilot["airspeed_to_fly"], pilot["airspeed_to_fly_rate"], pilot["dpt_cubed_held_by_sideslip"] = (
        45.0,
        0.04,
        0.2,
    )
    control["surfaces"]["output"]["effectiveness"][RUDDER] = rudder
    control["power"]["output"]["command"][0] = 21.0
    for name, value in dict(power).items():
        law_records.fields(control["power"])[name] = value
    pilot["full_power"] = full_power(pilot, control, new_y(dpt=0.2) if y is None else y)
    power, engine = law_records.fields(control["power"]), control["power"]
    power["step"] = 0.5
    loops.set_power(pilot, engine, new_y(dpt=0.2) if y is None else y, path, PUSH)
    follow_autopilot(engine, pilot["power_setting"], pilot["power_airspeed"])
    return pilot, power


def test_power_holds_the_airspeed_and_carries_the_climb():
    pilot, power = throttled()
    wanted = 20.0 + (0.04 + 0.05 + 0.3 * 1.0 + G * (0.03 - 0.01)) / PUSH
    assert power["base"] == pytest.approx(wanted)
    assert power["in_use"] == 1
    assert pilot["missing_acceleration"] == pytest.approx(0.05 + DT * 0.015 * 1.0)
    assert pilot["recent_airspeed_mps"] == pytest.approx(43.0 + DT / 20.0 * 1.0)
    assert power["command"][0] == 21.5  # half an inHg a frame


def test_power_goes_down_as_slowly_and_to_the_lowest():
    pilot, power = throttled(path=-0.5)
    assert power["base"] == 12.0
    assert power["command"][0] == 20.5
    assert pilot["missing_acceleration"] == 0.05  # what a limit cuts off is not integrated
    assert throttled(path=0.5)[1]["base"] == 28.0
    assert throttled(missing_acceleration=5.0, path=-0.45)[0]["missing_acceleration"] == pytest.approx(
        0.1 * G
    )
    assert throttled(power={"enabled": 1})[1]["command"][0] == 21.0


@pytest.mark.parametrize(("path", "expected"), [(-0.5, 13.2), (0.5, 26.8)])
def test_engines_that_alone_yaw_half_the_time_keep_half_of_their_room_at_either_end(path, expected):
    """Half of 15 % of 12 to 28 inHg."""
    _, power = throttled(path=path, engines_alone_yaw_share=0.5)
    assert power["base"] == pytest.approx(expected)


def test_small_steps_of_power_are_taken_at_once():
    _, power = throttled(path=0.01 + (0.9 * PUSH + 0.2 - 0.05 - 0.04 - 0.3 - 0.2 + 0.001) / G)
    assert power["command"][0] == pytest.approx(power["base"])
    assert abs(power["base"] - 21.0) < 0.5


@pytest.mark.parametrize("rudder", [1.0, 0.5, 0.02])
def test_power_leaves_the_rudder_enough(rudder):
    """The propeller yaws with dpt^3; the rudder holds what is left of it, sideslip what that lacks."""
    y = new_y(dpt=0.85)
    _, power = throttled(path=0.5, y=y, rudder=rudder)
    dpt = y[DPT] + (power["base"] - 21.0) * 40.0 / (2.0 * y[QDYN] * y[AIRSPEED])
    yawing = (dpt / 0.9) ** 3
    held = rudder + (1.0 - rudder) * 0.2 / 0.9**3
    assert yawing == pytest.approx(held, rel=1e-9) or power["base"] in (12.0, 28.0)


def test_while_power_stands_in_for_pitch_it_gets_the_airspeed_to_hold():
    _, power = throttled(power={"engaged": 1})
    usual = 43.0 + DT / 20.0
    assert power["usual_speed"] == pytest.approx(45.0)
    assert power["base"] == pytest.approx(20.0 + (0.04 + 0.05 + G * 0.02) / PUSH)
    _, power = throttled(power={"engaged": 1}, recent_airspeed_mps=38.0)
    usual = 38.0 + DT / 20.0 * (V - 38.0)
    assert power["usual_speed"] == pytest.approx(usual + 3.0)


def test_deviations_are_judged_once_settled_and_of_the_airspeed_the_mean():
    pilot = new_autopilot(ALTITUDE, SPEED, HEADING, BANK)
    pilot["command"] = 1000.0, 45.0, 3.1, 0.2
    pilot["changed_at_s"], pilot["mean_deviation"] = 10.0, (4.0, -0.5, 0.1, 0.0)
    pilot["airspeed_to_fly"], pilot["mean_deviation_from_airspeed_to_fly"] = 46.0, -0.2
    loops.record_deviations(pilot, 990.0, 47.0, -3.1, -0.1, 39.9)
    assert (
        pilot["largest_deviation_from_airspeed_to_fly"]
        == abs(pilot["mean_deviation_from_airspeed_to_fly"])
        == pytest.approx(0.2 - DT / 10.0 * 1.2)
    )
    mean = -0.5 + DT / 10.0 * 2.5
    part, off = DT / 10.0, 2 * np.pi - 6.2
    means = [4.0 - part * 14.0, mean, 0.1 + part * (off - 0.1), -part * 0.3]
    assert pilot["mean_deviation"] == pytest.approx(means)
    assert pilot["largest_instant_airspeed_deviation"] == 2.0
    assert pilot["largest_deviation"] == pytest.approx([10.0, abs(mean), 0.0, 0.0])
    loops.record_deviations(pilot, 1001.0, 41.5, -3.1, -0.1, 40.0)
    assert (pilot["largest_deviation"][ALTITUDE], pilot["largest_instant_airspeed_deviation"]) == (10.0, 3.5)
    assert pilot["largest_deviation"][[HEADING, BANK]] == pytest.approx([2 * np.pi - 6.2, 0.3])
    idle = new_autopilot()
    loops.record_deviations(idle, 990.0, 47.0, 1.0, 1.0, 100.0)
    assert not idle["largest_deviation"].any()


@pytest.mark.parametrize("angle", [-9.0, -3.2, -3.1, 0.0, 2.0, 3.2, 9.0])
def test_a_direction_is_given_within_half_a_turn(angle):
    assert loops.wrap_to_half_turn(angle) == pytest.approx(np.arctan2(np.sin(angle), np.cos(angle)))


def test_a_frame_is_its_loops_one_after_the_other():
    """From a heading and an altitude hold in trim: nothing to do but to keep the bank and the path."""
    pilot, control = new_autopilot(flying=0), new_control()
    put(control, G=np.eye(3, 4))
    control["layout"]["low"], control["layout"]["high"] = -1.0, 1.0
    control["power"]["output"]["command"][0] = 20.0
    pilot["n_legs"], pilot["leg_value"][:, 0] = (1, 1, 1, 0), np.nan
    pilot["leg_max_command_rate"] = np.inf
    measured = seen(attitude=(0.0, 0.11, 0.5), alpha=0.1, beta=0.02)
    loops.steer(pilot, control, np.zeros(4), measured, 0.0, 0.0)
    assert pilot["sets_power"]
    follow_autopilot(control["power"], pilot["power_setting"], pilot["power_airspeed"])
    assert pilot["airspeed_to_fly"] == 46.0
    assert pilot["is_commanded"][:3].all()
    assert pilot["command"][:3] == pytest.approx([1000.0, 46.0, 0.5])
    assert pilot["changed_at_s"] == pytest.approx(np.zeros(N_CHANNELS))
    # pitch: path 0 + alpha - theta; yaw: the sideslip washed out
    assert pilot["rates"] == pytest.approx([0.0, max(3.0 * -0.01, -0.1), 0.5 * 0.02])
    assert control["power"]["setpoint"]["base"] == pytest.approx(
        20.0 - G * 0.01 / loops.acceleration_per_power(pilot, control["power"], measured["y"])
    )


def test_a_climb_asks_for_no_more_power_than_a_lost_rudder_leaves():
    """At 15 inHg, all that the propeller's yaw leaves, the path is bounded as if the engine ended there."""
    pilot = new_autopilot(SPEED, airspeed_to_fly=43.0, full_power=15.0)
    assert loops.path_angle_limits(pilot, PUSH)[1] == pytest.approx(0.01 - 5 * PUSH / G + 0.02 * 3.0)
    pilot["full_power"] = 5.0  # less than idle is idle
    assert loops.path_angle_limits(pilot, PUSH)[1] == pytest.approx(
        max(0.01 - 8 * PUSH / G + 0.02 * 3.0, -0.15)
    )


def test_a_whole_rudder_leaves_the_whole_engine():
    pilot, control = new_autopilot(dpt_cubed_held_by_sideslip=0.2), new_control()
    assert full_power(pilot, control, new_y(dpt=2.0)) == 28.0


def test_power_goes_back_while_the_rudder_stands_at_its_stop():
    """From what is commanded, to what sideslip alone holds, and slowly up again."""
    pilot, control = new_autopilot(dpt_cubed_held_by_sideslip=0.027), new_control()
    control["power"]["output"]["command"][0], control["allocation"]["output"]["saturated"][RUDDER] = 24.0, 1
    y = new_y(dpt=0.4)
    inhg_per_dpt = 2.0 * y[QDYN] * y[AIRSPEED] / 40.0
    lowest = 24.0 + (0.3 - 0.4) * inhg_per_dpt
    assert lowest < 12.0  # a low ceiling: what follows is not bounded by it
    assert full_power(pilot, control, y) == pytest.approx(24.0 - 8.0 * DT)
    assert full_power(pilot, control, y) == pytest.approx(24.0 - 16.0 * DT)
    control["power"]["output"]["command"][0] = 20.0
    assert full_power(pilot, control, y) == pytest.approx(20.0 - 8.0 * DT)
    pilot["dpt_cubed_held_by_sideslip"] = 0.4**3  # sideslip holds what there is: no less than that
    assert full_power(pilot, control, y) == pytest.approx(20.0)
    control["allocation"]["output"]["saturated"][RUDDER] = 0
    assert full_power(pilot, control, y) == pytest.approx(20.0 + DT)
    pilot["allowed_power"] = 27.9999
    assert full_power(pilot, control, y) == 28.0


def test_ailerons_at_their_stop_are_gone_whatever_is_believed_of_them():
    pilot, control = new_autopilot(), new_control()
    control["allocation"]["output"]["saturated"][AILERON] = 1
    follow(pilot, control, new_y())
    assert pilot["roll_loss_share"] == pytest.approx(DT / pilot["gain"]["jammed_s"])
    control["allocation"]["output"]["saturated"][:] = (0, 1, 1, 1)
    follow(pilot, control, new_y())
    assert pilot["roll_loss_share"] < DT / pilot["gain"]["jammed_s"]


@pytest.mark.parametrize("left", [0.9, 0.4, 0.0, -0.2])
def test_a_weak_rudder_and_sideslip_hold_the_propellers_yaw_together(left):
    """dpt^3 at the ceiling: what is left of the rudder's share, and the sideslip's for what is not."""
    pilot, control, y = (
        new_autopilot(dpt_cubed_held_by_sideslip=0.2, high_power=1e9),
        new_control(),
        new_y(dpt=0.4),
    )
    pilot["allowed_power"], control["surfaces"]["output"]["effectiveness"][RUDDER] = 1e9, left
    control["power"]["output"]["command"][0] = 21.0
    dpt = y[DPT] + (full_power(pilot, control, y) - 21.0) * 40.0 / (2.0 * y[QDYN] * y[AIRSPEED])
    assert dpt**3 == pytest.approx(max(left, 0.0) * 0.9**3 + (1.0 - left) * 0.2)


def test_what_power_misses_is_integrated_by_how_much_it_is():
    pilot, power = throttled(airspeed=43.5)
    assert pilot["missing_acceleration"] == pytest.approx(0.05 + DT * 0.015 * 1.5)
    assert power["base"] == pytest.approx(20.0 + (0.04 + 0.05 + 0.3 * 1.5 + G * (0.03 - 0.01)) / PUSH)
