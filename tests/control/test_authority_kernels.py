"""Lost authority, engine power and the probe, one frame from a known state, against their equations."""

import numpy as np
import pytest

from beaver_ftc.control import allocation, engines, laws
from beaver_ftc.design.model import AIRSPEED, DPT, QDYN
from law_records import fields, new_control, put

DT, FLAP = 0.02, 3


@pytest.fixture
def control():
    control, rng = new_control(main=(0, 1, 2), stand_in=FLAP, dt=DT), np.random.default_rng(2)
    put(control, law="fault-tolerant", effectiveness=1.0, least_effectiveness=0.1)
    model = fields(control["reference"])
    model["A"], model["B"] = laws.discretise(8.0, 0.7, DT)
    for name in ("governed_rate", "governed_acceleration", "model_rate", "model_acceleration"):
        model[name] = rng.normal(0, 0.1, 3)
    put(control, scale=(0.9, 0.5, 0.02), shortfall=(0.2, -0.4, 0.3))
    engine = fields(control["power"])
    engine["trim"], engine["base"], engine["command"] = 20.0, 20.0, 20.0
    engine["low"], engine["high"] = 12.0, 28.0
    engine["step"], engine["speed_gain"], engine["attitude_gain"] = 0.1, 0.4, 6.0
    engine["smoothing"], engine["washout"], engine["leak"] = 0.1, 0.02, 0.01
    engine["dpt_factor"], engine["highest_dpt"], engine["from_s"] = 40.0, 3.0, -1.0
    engine["impatience"], engine["forgiveness"] = 0.4, 0.25
    engine["speed"], engine["usual_speed"], engine["attitude"] = 44.0, 43.0, 0.03
    engine["least"], engine["greatest"] = 19.0, 21.0
    return control


def is_lost(control):
    parts = control["layout"], control["surfaces"], control["allocation"]["output"]["saturated"]
    return engines.pitch_is_lost(*parts, control["axes"]["shortfall"])


def steer(control, x, y, known):
    """A frame of the law, at 1 s; known: there is an alarm."""
    watched = known or control["config"]["informed"]
    engines.steer_by_power(control["power"], control["reference"], x, y, watched, is_lost(control), 1.0)


def seen(V=46.0, dpt=0.4, q=0.05):
    x, y = np.array([0.3, q, -0.2]), np.zeros(8)
    y[[AIRSPEED, QDYN, DPT]] = V, 0.55 * V * V, dpt
    return x, y


@pytest.mark.parametrize("steered", [0, 1])
def test_the_reference_waits_for_what_was_not_given_and_is_scaled(control, steered):
    model, wanted = fields(put(control, steered=steered)["reference"]), np.array([0.1, -0.2, 0.3])
    scale, short = model["scale"].copy(), control["axes"]["shortfall"].copy()
    state = np.array([model["governed_rate"], model["governed_acceleration"]])
    laws.govern(control["reference"], wanted, short, True)
    if not steered:
        scale = scale - DT * np.abs(short) / laws.MISSED_RAD_S
        scale = np.maximum(scale + DT / laws.RECOVERY_S * (1.0 - scale), 0.0)
        assert scale[2] == 0.0
    rate, acceleration = model["A"] @ state + np.outer(model["B"], scale * wanted)
    assert model["scale"] == pytest.approx(scale)
    assert model["governed_rate"] == pytest.approx(rate - DT * short)
    assert model["governed_acceleration"] == pytest.approx(acceleration)


def test_without_a_loss_the_reference_is_the_models(control):
    model = fields(control["reference"])
    laws.govern(control["reference"], np.ones(3), control["axes"]["shortfall"], False)
    assert model["governed_rate"].tolist() == model["model_rate"].tolist()
    assert model["governed_acceleration"].tolist() == model["model_acceleration"].tolist()
    assert model["scale"].tolist() == [0.9, 0.5, 0.02]


def test_what_holds_the_rates_is_within_reach_up_to_its_ends(control):
    out, axes = control["allocation"]["output"], control["axes"]
    axes["G"] = [[-2.0, 0.0, 1.0, 0.0], [0.0, 3.0, 0.0, 0.5], [0.0, 0.0, 0.0, 0.0]]
    control["layout"]["low"], control["layout"]["high"] = -0.5, (0.25, 0.5, 1.0, 2.0)
    for hold, beyond in (
        ((-1.0, -1.75, 0.0), (0, 0, 0)),
        ((2.0, 2.5, 0.0), (0, 0, 0)),
        ((-1.001, 2.501, 1e-9), (1, 1, 1)),
        ((2.001, -1.751, -1e-9), (1, 1, 1)),
    ):
        axes["hold"] = hold
        allocation.note_shortfall(axes, out["command"], control["layout"], np.zeros(4), np.zeros((2, 3)))
        assert axes["beyond"].tolist() == list(beyond)


def test_speed_and_attitude_missed_are_followed_and_speed_begins_with_what_is_flown(control):
    (x, y), parts = seen(), (control["power"]["config"], control["power"]["memory"], control["reference"])
    engine, fields(control["reference"])["governed_rate"] = fields(control["power"]), (9.0, 0.02, 9.0)
    engines.follow(*parts, x, y)
    speed = 44.0 + 0.1 * 2.0
    assert engine["speed"] == pytest.approx(speed)
    assert engine["usual_speed"] == pytest.approx(43.0 + 0.02 * (speed - 43.0))
    assert engine["attitude"] == pytest.approx(0.03 + DT * 0.03 - 0.01 * 0.03)
    engine["usual_speed"] = 0.0
    engines.follow(*parts, x, y)
    assert engine["speed"] == engine["usual_speed"] == 46.0


@pytest.mark.parametrize("engaged", [0, 1])
def test_the_pressure_is_that_of_the_law_within_its_limits(control, engaged):
    engine, (_, y) = fields(control["power"]), seen()
    engine["engaged"] = engaged
    expected = 20.0 - 0.4 * 1.0 + 6.0 * 0.03 if engaged else 20.0
    assert engines.wanted(control["power"], y) == pytest.approx(expected)
    for attitude, limit in ((9.0, 28.0), (-9.0, 12.0)):
        engine["attitude"] = attitude
        assert engines.wanted(control["power"], y) == (limit if engaged else 20.0)


def test_the_ceiling_is_where_the_slipstream_would_be_the_highest(control):
    """dpt is affine in the pressure, by dpt_factor / 2 q V."""
    engine, (_, y) = fields(control["power"]), seen()
    inhg = engines.ceiling(control["power"], y, 0.9)
    assert y[DPT] + (inhg - 20.0) * 40.0 / (2.0 * y[QDYN] * y[AIRSPEED]) == pytest.approx(0.9)
    engine["engaged"], engine["attitude"], engine["highest_dpt"] = 1, 9.0, 0.401
    assert engines.wanted(control["power"], y) == pytest.approx(engines.ceiling(control["power"], y, 0.401))


@pytest.mark.parametrize(
    ("effectiveness", "stop", "lack", "lost"),
    [
        ((1.0, 1.0), 0, 9.0, False), ((0.09, 1.0), 0, 0.06, True), ((0.09, 1.0), 0, 0.05, False),
        ((0.1, 0.05), 0, 9.0, False), ((0.09, 0.05), 0, 0.0, True), ((1.0, 1.0), 1, -0.06, True),
        ((0.05, 0.1), 0, 0.0, False),
    ],
)  # fmt: skip
def test_pitch_is_lost_when_nothing_acts_or_all_that_does_lacks(control, effectiveness, stop, lack, lost):
    control["surfaces"]["output"]["effectiveness"][[1, FLAP]] = effectiveness
    control["allocation"]["output"]["saturated"][1] = stop
    control["axes"]["shortfall"] = 9.0, lack, 9.0
    assert is_lost(control) == lost


def test_without_a_stand_in_the_elevator_alone_decides(control):
    control["layout"]["stand_in"], control["surfaces"]["output"]["effectiveness"][[1, FLAP]] = -1, (0.05, 1.0)
    control["layout"]["is_backup"][FLAP] = 0
    assert is_lost(control)


def test_power_takes_over_after_a_while_and_hands_back_after_another(control):
    engine, control["surfaces"]["output"]["effectiveness"][[1, FLAP]] = fields(control["power"]), 0.0
    engaged = []
    for k in range(4):
        engines.watch(control["power"], is_lost(control), 0.1 * k)
        engaged.append(int(engine["engaged"]))
    assert engaged == [0, 0, 1, 1]  # 0.4, 0.8, 1, 1
    assert (engine["from_s"], engine["attitude"], engine["lost"]) == (pytest.approx(0.2), 0.0, 1.0)
    engine["attitude"], control["surfaces"]["output"]["effectiveness"][1] = 0.3, 1.0
    for lost, on in ((0.75, 1), (0.5, 1), (0.25, 1), (0.0, 0), (0.0, 0)):
        engines.watch(control["power"], is_lost(control), 1.0)
        assert (engine["lost"], engine["engaged"], engine["attitude"]) == (lost, on, 0.3)
    control["surfaces"]["output"]["effectiveness"][1] = 0.0
    for _ in range(3):
        engines.watch(control["power"], is_lost(control), 2.0)
    assert (engine["engaged"], engine["from_s"]) == (1, pytest.approx(0.2)), "the first time is told"


def test_a_flight_that_begins_without_pitch_says_so_from_its_first_frame(control):
    engine, control["surfaces"]["output"]["effectiveness"][[1, FLAP]] = fields(control["power"]), 0.0
    engine["lost"] = 1.0
    engines.watch(control["power"], is_lost(control), 0.0)
    engine["engaged"] = 0
    engines.watch(control["power"], is_lost(control), 5.0)
    assert engine["from_s"] == 0.0


@pytest.mark.parametrize("attitude", [3.0, -3.0, 0.0668])
def test_the_pressure_moves_no_faster_than_it_may_and_how_far_is_kept(control, attitude):
    engine, (x, y) = fields(control["power"]), seen(V=44.0)
    engine["engaged"], engine["usual_speed"], engine["attitude"], engine["leak"] = 1, 44.0, attitude, 0.0
    control["reference"]["output"]["governed_rate"][1] = x[1]
    engine["least"] = engine["greatest"] = 20.0
    engine["attitude_gain"], engine["frames"] = 1.0, 7
    steer(control, x, y, 0)
    moved = np.clip(attitude, -0.1, 0.1)
    assert engine["command"][0] == pytest.approx(20.0 + moved)
    assert engine["frames"] == 8
    assert engine["least"] == pytest.approx(min(20.0, 20.0 + moved))
    assert engine["greatest"] == pytest.approx(max(20.0, 20.0 + moved))
    assert (engine["in_use"], engine["moved"]) == (1, 1)


def test_on_its_way_back_to_trim_it_is_in_use_and_in_nobodys_charge(control):
    engine, (x, y) = fields(control["power"]), seen()
    engine["command"], engine["moved"], engine["frames"] = 20.05, 1, 7
    steer(control, x, y, 0)
    assert (engine["command"][0], engine["in_use"], engine["moved"], engine["frames"]) == (20.0, 1, 0, 7)
    steer(control, x, y, 0)
    assert (engine["in_use"], engine["frames"]) == (0, 7)


@pytest.mark.parametrize(
    ("known", "law", "watched"), [(0, "fault-tolerant", 0), (1, "fault-tolerant", 1), (0, "oracle", 1)]
)
def test_only_after_an_alarm_or_by_the_oracle_is_it_watched(control, known, law, watched):
    put(control, law=law)["surfaces"]["output"]["effectiveness"][[1, FLAP]] = 0.0
    steer(control, *seen(), known)
    assert control["power"]["memory"]["lost"] == pytest.approx(0.4 * watched)


def new_probe(frames):
    record = new_control()["probe"]
    probe = fields(record)
    probe["amplitude"], probe["step"], probe["frames"] = 0.2, np.pi / 4, frames
    probe["from_s"] = probe["to_s"] = -1.0
    return record, probe


def test_a_probe_is_a_raised_cosine_that_is_not_repeated():
    """Down and back in eight frames; begun at the very start of a flight it is not begun again."""
    record, probe = new_probe(8)
    allocation.advance_probe(record, False, 0.0)
    assert (probe["from_s"], probe["probed"]) == (-1.0, 0)
    shape = []
    for k in range(9):
        allocation.advance_probe(record, True, k * DT)
        shape.append(float(probe["deflection"]))
    assert shape[:8] == pytest.approx(0.1 * (1.0 - np.cos(np.arange(8) * np.pi / 4)))
    assert (shape[8], probe["probed"]) == (0.0, 0)
    assert (probe["from_s"], probe["to_s"]) == (0.0, pytest.approx(8 * DT))
    allocation.advance_probe(record, True, 1.0)
    assert (probe["probed"], probe["from_s"]) == (0, 0.0)


@pytest.mark.parametrize(("doubt", "frames"), [(3, 8), (8, 8), (9, 16), (99, 24)])
def test_a_probe_ends_with_the_movement_in_which_the_doubt_ends(doubt, frames):
    (record, probe), ended = new_probe(24), None
    for k in range(40):
        allocation.advance_probe(record, k < doubt, k * DT)
        if ended is None and probe["probed"] == 0:
            ended = k
    assert ended == frames


def test_the_reference_model_keeps_what_was_commanded_and_goes_a_frame_on(control):
    model, wanted = fields(control["reference"]), np.array([0.1, -0.2, 0.3])
    state = np.array([model["model_rate"], model["model_acceleration"]])
    laws.follow(control["reference"]["config"], control["reference"]["output"], wanted)
    assert model["commanded_rate"].tolist() == wanted.tolist()
    after = model["A"] @ state + np.outer(model["B"], wanted)
    assert np.array([model["model_rate"], model["model_acceleration"]]) == pytest.approx(after)
