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


def test_the_reference_model_keeps_what_was_commanded_and_goes_a_frame_on(control):
    model, wanted = fields(control["reference"]), np.array([0.1, -0.2, 0.3])
    state = np.array([model["model_rate"], model["model_acceleration"]])
    laws.follow(control["reference"]["config"], control["reference"]["output"], wanted)
    assert model["commanded_rate"].tolist() == wanted.tolist()
    after = model["A"] @ state + np.outer(model["B"], wanted)
    assert np.array([model["model_rate"], model["model_acceleration"]]) == pytest.approx(after)
