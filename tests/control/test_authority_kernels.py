"""Lost authority, engine power and the probe, one frame from a known state, against their equations."""

import numpy as np
import pytest

from beaver_ftc.control import authority, power, probing, reference_model
from beaver_ftc.control.state import FAULT_TOLERANT, ORACLE, control_dtype
from beaver_ftc.design.model import AIRSPEED, DPT, QDYN

DT, FLAP = 0.02, 3


@pytest.fixture
def control():
    control = np.zeros(1, control_dtype(4)).view(np.recarray)[0]
    rng = np.random.default_rng(2)
    control["main"], control["stand_in"], control["dt"], control["law"] = (0, 1, 2), FLAP, DT, FAULT_TOLERANT
    control["effectiveness"], control["least_effectiveness"] = 1.0, 0.1
    control["model_A"], control["model_B"] = reference_model.discretise(8.0, 0.7, DT)
    for name in ("governed_rate", "governed_acceleration", "model_rate", "model_acceleration"):
        control[name] = rng.normal(0, 0.1, 3)
    control["reference_scale"], control["shortfall"] = (0.9, 0.5, 0.02), (0.2, -0.4, 0.3)
    engine = control["power"]
    engine["trim"], engine["command"], engine["low"], engine["high"] = 20.0, 20.0, 12.0, 28.0
    engine["step"], engine["speed_gain"], engine["attitude_gain"] = 0.1, 0.4, 6.0
    engine["smoothing"], engine["washout"], engine["leak"] = 0.1, 0.02, 0.01
    engine["dpt_factor"], engine["highest_dpt"], engine["from_s"] = 40.0, 3.0, -1.0
    engine["impatience"], engine["forgiveness"] = 0.4, 0.25
    engine["speed"], engine["usual_speed"], engine["attitude"] = 44.0, 43.0, 0.03
    engine["least"], engine["greatest"] = 19.0, 21.0
    return control


def seen(V=46.0, dpt=0.4, q=0.05):
    x, y = np.array([0.3, q, -0.2]), np.zeros(8)
    y[[AIRSPEED, QDYN, DPT]] = V, 0.55 * V * V, dpt
    return x, y


@pytest.mark.parametrize("steered", [0, 1])
def test_the_reference_waits_for_what_was_not_given_and_is_scaled(control, steered):
    control["hedging"], control["steered"], reference = 1, steered, np.array([0.1, -0.2, 0.3])
    scale, short = control["reference_scale"].copy(), control["shortfall"].copy()
    state = np.array([control["governed_rate"], control["governed_acceleration"]])
    authority.govern(control, reference)
    if not steered:
        scale = scale - DT * np.abs(short) / authority.MISSED_RAD_S
        scale = np.maximum(scale + DT / authority.RECOVERY_S * (1.0 - scale), 0.0)
        assert scale[2] == 0.0
    rate, acceleration = control["model_A"] @ state + np.outer(control["model_B"], scale * reference)
    assert control["reference_scale"] == pytest.approx(scale)
    assert control["governed_rate"] == pytest.approx(rate - DT * short)
    assert control["governed_acceleration"] == pytest.approx(acceleration)


def test_without_a_loss_the_reference_is_the_models(control):
    authority.govern(control, np.ones(3))
    assert control["governed_rate"].tolist() == control["model_rate"].tolist()
    assert control["governed_acceleration"].tolist() == control["model_acceleration"].tolist()
    assert control["reference_scale"].tolist() == [0.9, 0.5, 0.02]


def test_what_holds_the_rates_is_within_reach_up_to_its_ends(control):
    G = np.array([[-2.0, 0.0, 1.0, 0.0], [0.0, 3.0, 0.0, 0.5], [0.0, 0.0, 0.0, 0.0]])
    control["low"], control["high"] = -0.5, (0.25, 0.5, 1.0, 2.0)
    for hold, beyond in (
        ((-1.0, -1.75, 0.0), (0, 0, 0)),
        ((2.0, 2.5, 0.0), (0, 0, 0)),
        ((-1.001, 2.501, 1e-9), (1, 1, 1)),
        ((2.001, -1.751, -1e-9), (1, 1, 1)),
    ):
        control["hold"] = hold
        authority.note_shortfall(control, G, np.zeros(4))
        assert control["beyond"].tolist() == list(beyond)


def test_speed_and_attitude_missed_are_followed_and_speed_begins_with_what_is_flown(control):
    engine, (x, y) = control["power"], seen()
    control["governed_rate"] = 9.0, 0.02, 9.0
    power.follow(control, x, y)
    speed = 44.0 + 0.1 * 2.0
    assert engine["speed"] == pytest.approx(speed)
    assert engine["usual_speed"] == pytest.approx(43.0 + 0.02 * (speed - 43.0))
    assert engine["attitude"] == pytest.approx(0.03 + DT * 0.03 - 0.01 * 0.03)
    engine["usual_speed"] = 0.0
    power.follow(control, x, y)
    assert engine["speed"] == engine["usual_speed"] == 46.0


@pytest.mark.parametrize("engaged", [0, 1])
def test_the_pressure_is_that_of_the_law_within_its_limits(control, engaged):
    engine, (_, y) = control["power"], seen()
    engine["engaged"] = engaged
    expected = 20.0 - 0.4 * 1.0 + 6.0 * 0.03 if engaged else 20.0
    assert power.wanted(engine, y) == pytest.approx(expected)
    for attitude, limit in ((9.0, 28.0), (-9.0, 12.0)):
        engine["attitude"] = attitude
        assert power.wanted(engine, y) == (limit if engaged else 20.0)


def test_the_ceiling_is_where_the_slipstream_would_be_the_highest(control):
    """dpt is affine in the pressure, by dpt_factor / 2 q V."""
    engine, (_, y) = control["power"], seen()
    inhg = power.ceiling(engine, y, 0.9)
    assert y[DPT] + (inhg - 20.0) * 40.0 / (2.0 * y[QDYN] * y[AIRSPEED]) == pytest.approx(0.9)
    engine["engaged"], engine["attitude"], engine["highest_dpt"] = 1, 9.0, 0.401
    assert power.wanted(engine, y) == pytest.approx(power.ceiling(engine, y, 0.401))


@pytest.mark.parametrize(
    ("effectiveness", "stop", "lack", "lost"),
    [
        ((1.0, 1.0), 0, 9.0, False), ((0.09, 1.0), 0, 0.06, True), ((0.09, 1.0), 0, 0.05, False),
        ((0.1, 0.05), 0, 9.0, False), ((0.09, 0.05), 0, 0.0, True), ((1.0, 1.0), 1, -0.06, True),
        ((0.05, 0.1), 0, 0.0, False),
    ],
)  # fmt: skip
def test_pitch_is_lost_when_nothing_acts_or_all_that_does_lacks(control, effectiveness, stop, lack, lost):
    control["effectiveness"][[1, FLAP]], control["saturated"][1] = effectiveness, stop
    control["shortfall"] = 9.0, lack, 9.0
    assert power.pitch_is_lost(control) == lost


def test_without_a_stand_in_the_elevator_alone_decides(control):
    control["stand_in"], control["effectiveness"][[1, FLAP]] = -1, (0.05, 1.0)
    assert power.pitch_is_lost(control)


def test_power_takes_over_after_a_while_and_hands_back_after_another(control):
    engine, control["effectiveness"][[1, FLAP]] = control["power"], 0.0
    engaged = []
    for k in range(4):
        power.watch(control, 0.1 * k)
        engaged.append(int(engine["engaged"]))
    assert engaged == [0, 0, 1, 1]  # 0.4, 0.8, 1, 1
    assert (engine["from_s"], engine["attitude"], engine["lost"]) == (pytest.approx(0.2), 0.0, 1.0)
    engine["attitude"], control["effectiveness"][1] = 0.3, 1.0
    for lost, on in ((0.75, 1), (0.5, 1), (0.25, 1), (0.0, 0), (0.0, 0)):
        power.watch(control, 1.0)
        assert (engine["lost"], engine["engaged"], engine["attitude"]) == (lost, on, 0.3)
    control["effectiveness"][1] = 0.0
    for _ in range(3):
        power.watch(control, 2.0)
    assert (engine["engaged"], engine["from_s"]) == (1, pytest.approx(0.2)), "the first time is told"


def test_a_flight_that_begins_without_pitch_says_so_from_its_first_frame(control):
    engine, control["effectiveness"][[1, FLAP]] = control["power"], 0.0
    engine["lost"] = 1.0
    power.watch(control, 0.0)
    engine["engaged"] = 0
    power.watch(control, 5.0)
    assert engine["from_s"] == 0.0


@pytest.mark.parametrize("attitude", [3.0, -3.0, 0.0668])
def test_the_pressure_moves_no_faster_than_it_may_and_how_far_is_kept(control, attitude):
    engine, (x, y) = control["power"], seen(V=44.0)
    engine["engaged"], engine["usual_speed"], engine["attitude"], engine["leak"] = 1, 44.0, attitude, 0.0
    control["governed_rate"][1] = x[1]
    engine["least"] = engine["greatest"] = 20.0
    engine["attitude_gain"], engine["frames"] = 1.0, 7
    power.steer(control, x, y, 0, 1.0)
    moved = np.clip(attitude, -0.1, 0.1)
    assert engine["command"][0] == pytest.approx(20.0 + moved)
    assert engine["frames"] == 8
    assert engine["least"] == pytest.approx(min(20.0, 20.0 + moved))
    assert engine["greatest"] == pytest.approx(max(20.0, 20.0 + moved))
    assert (engine["in_use"], engine["moved"]) == (1, 1)


def test_on_its_way_back_to_trim_it_is_in_use_and_in_nobodys_charge(control):
    engine, (x, y) = control["power"], seen()
    engine["command"], engine["moved"], engine["frames"] = 20.05, 1, 7
    power.steer(control, x, y, 0, 1.0)
    assert (engine["command"][0], engine["in_use"], engine["moved"], engine["frames"]) == (20.0, 1, 0, 7)
    power.steer(control, x, y, 0, 1.0)
    assert (engine["in_use"], engine["frames"]) == (0, 7)


@pytest.mark.parametrize(
    ("known", "law", "watched"), [(0, FAULT_TOLERANT, 0), (1, FAULT_TOLERANT, 1), (0, ORACLE, 1)]
)
def test_only_after_an_alarm_or_by_the_oracle_is_it_watched(control, known, law, watched):
    control["law"], control["effectiveness"][[1, FLAP]] = law, 0.0
    power.steer(control, *seen(), known, 1.0)
    assert control["power"]["lost"] == pytest.approx(0.4 * watched)


def test_a_probe_is_a_raised_cosine_that_is_not_repeated(control):
    """Down and back in eight frames; begun at the very start of a flight it is not begun again."""
    control["probe_amplitude"], control["probe_step"], control["probe_frames"] = 0.2, np.pi / 4, 8
    control["probe_from_s"] = control["probe_to_s"] = -1.0
    probing.advance(control, False, 0.0)
    assert (control["probe_from_s"], control["probed"]) == (-1.0, 0)
    shape = []
    for k in range(9):
        probing.advance(control, True, k * DT)
        shape.append(float(control["probe"]))
    assert shape[:8] == pytest.approx(0.1 * (1.0 - np.cos(np.arange(8) * np.pi / 4)))
    assert (shape[8], control["probed"]) == (0.0, 0)
    assert (control["probe_from_s"], control["probe_to_s"]) == (0.0, pytest.approx(8 * DT))
    probing.advance(control, True, 1.0)
    assert (control["probed"], control["probe_from_s"]) == (0, 0.0)


@pytest.mark.parametrize(("doubt", "frames"), [(3, 8), (8, 8), (9, 16), (99, 24)])
def test_a_probe_ends_with_the_movement_in_which_the_doubt_ends(control, doubt, frames):
    control["probe_amplitude"], control["probe_step"], control["probe_frames"] = 0.2, np.pi / 4, 24
    control["probe_from_s"] = -1.0
    ended = None
    for k in range(40):
        probing.advance(control, k < doubt, k * DT)
        if ended is None and control["probed"] == 0:
            ended = k
    assert ended == frames


def test_the_reference_model_keeps_what_was_commanded_and_goes_a_frame_on(control):
    state = np.array([control["model_rate"], control["model_acceleration"]])
    reference = np.array([0.1, -0.2, 0.3])
    reference_model.follow(control, reference)
    assert control["commanded_rate"].tolist() == reference.tolist()
    after = control["model_A"] @ state + np.outer(control["model_B"], reference)
    assert np.array([control["model_rate"], control["model_acceleration"]]) == pytest.approx(after)
