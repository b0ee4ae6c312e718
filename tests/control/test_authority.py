"""Lost authority: the attainable moments, the reference bent to them, and the probe that nobody feels."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft import YAW
from beaver_ftc.aircraft.schema import ThrustSection
from beaver_ftc.control import allocation, authority, laws
from beaver_ftc.control.laws import reference
from beaver_ftc.control.probe import advance_probe
from beaver_ftc.control.thrust import set_up_engine
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.loop.assembly import frame_dtype
from law_records import RUDDER, fields, new_control, put

DT = 0.01
THRUST = ThrustSection(airspeed_mps=[20, 60], setting=[0, 1], force_n=[[0, 2000], [0, 1000]], lag_s=0.8)
LOW, HIGH = np.array([-0.52, -0.49, -0.44, -0.1]), np.array([0.52, 0.49, 0.44, 1.03])


def control_record():
    control = new_control(main=(0, 1, 2), stand_in=3, dt=DT, effectiveness=1.0, scale=1.0)
    control["layout"]["low"], control["layout"]["high"] = LOW, HIGH
    model = control["reference"]["config"]
    model["A"], model["B"] = reference.discretise(10.0, 1.0, DT)
    return control


@given(st.lists(st.floats(-12, 12), min_size=4, max_size=4))
def test_the_attainable_interval_is_spanned_by_the_corners_of_the_travel(row):
    G = np.array([row] * 3)
    corners = [G[1] @ np.array(corner) for corner in product(*zip(LOW, HIGH, strict=True))]
    least, greatest = authority.attainable(G, control_record()["layout"], np.zeros((2, 3)), 1)
    assert least == pytest.approx(min(corners), abs=1e-12)
    assert greatest == pytest.approx(max(corners), abs=1e-12)


def test_a_shortfall_on_one_side_scales_the_reference_on_both_and_in_time_it_comes_back():
    control = control_record()
    control["reference"]["memory"]["active"] = 1
    control["axes"]["shortfall"] = [0.0, 0.5, 0.0]
    for _ in range(10):
        reference.govern(control["reference"], np.full(3, 0.05), control["axes"]["shortfall"], False)
    missed = 10 * DT * 0.5 / reference.MISSED_RAD_S
    assert control["reference"]["memory"]["scale"][1] == pytest.approx(1 - missed, abs=0.01)
    assert control["reference"]["memory"]["scale"][[0, 2]] == pytest.approx([1, 1])
    control["axes"]["shortfall"] = 0.0
    for _ in range(round(5 * reference.RECOVERY_S / DT)):
        reference.govern(control["reference"], np.full(3, 0.05), control["axes"]["shortfall"], False)
    assert control["reference"]["output"]["governed_rate"] == pytest.approx(0.05, rel=0.01)


@pytest.mark.parametrize(("law", "detected"), [("fault-tolerant", 1), ("oracle", 0)])
def test_engines_serve_a_law_that_may_act_and_return_to_the_common_lever_when_it_may_not(law, detected):
    control = put(control_record(), law=law, least_effectiveness=0.1)
    config, difference = control["engines"]["config"], control["power"]["output"]["command"][1:3]
    config["n"], config["high"], config["step"], config["integral_gain"], config["release"] = (
        2,
        1.0,
        0.01,
        0.02,
        0.01,
    )
    config["B"][YAW, :2] = 0.5, -0.5
    control["engines"]["memory"]["problem"]["weight"][:2] = 1.0
    set_up_engine(control["engines"]["memory"]["thrust"], THRUST, 500.0)
    control["power"]["output"]["command"][0] = 0.5
    control["surfaces"]["output"]["effectiveness"][RUDDER] = 0.0
    control["axes"]["demand"] = 0.0, 0.0, 0.2
    frame = np.zeros(1, frame_dtype(4)).view(np.recarray)[0]
    frame["assessment"]["detected"], frame["measured"]["y"][AIRSPEED] = detected, 30.0
    for _ in range(20):
        laws.complete(control, frame["assessment"], frame["measured"], 0.0)
    moved = difference.copy()
    assert moved[0] > 0.0 > moved[1]
    control["config"]["informed"] = frame["assessment"]["detected"] = 0
    laws.complete(control, frame["assessment"], frame["measured"], 0.0)
    assert difference == pytest.approx(moved - np.sign(moved) * 0.01)
    for _ in range(100):
        laws.complete(control, frame["assessment"], frame["measured"], 0.0)
    assert not difference.any()
    assert not control["engines"]["output"]["authority"].any()


class TestProbing:
    def probed(self, wanted):
        record = control_record()["probe"]
        probe = fields(record)
        probe["amplitude"], probe["step"], probe["frames"] = 0.05, np.pi * DT, 400
        probe["from_s"] = probe["to_s"] = -1.0
        history = []
        for k in range(1000):
            advance_probe(record, wanted(k), k * DT)
            history.append(float(probe["deflection"]))
        return probe, np.array(history)

    def test_it_is_bounded_one_sided_and_without_a_jump(self):
        probe, history = self.probed(lambda k: k >= 100)
        assert history.min() >= 0.0
        assert history.max() == pytest.approx(0.05, abs=1e-4)
        assert np.abs(np.diff(history)).max() < 0.05 * np.pi * DT
        assert (probe["from_s"], probe["to_s"]) == pytest.approx((1.0, 5.0))

    def test_it_ends_with_the_movement_in_which_the_doubt_ends_and_does_not_come_again(self):
        probe, history = self.probed(lambda k: 100 <= k < 150 or k > 600)
        assert probe["to_s"] == pytest.approx(3.0)
        assert not history[320:].any()

    @given(st.floats(0, 0.1), st.floats(-0.5, 0.5))
    def test_a_healthy_aircraft_feels_nothing(self, probe, needed):
        control = control_record()
        out, axes = control["allocation"]["output"], control["axes"]
        axes["G"] = G = np.array([[-9.0, 0, 0.6, 0], [0, -10.0, 0, 2.1], [-0.2, 0, -2.0, 0]])
        axes["demand"] = 0.0, needed, 0.0
        allocation.allocate(axes, out, control["layout"], np.ones(4), 0.0, probe)
        assert (G @ out["command"])[1] == pytest.approx(needed, abs=1e-12)
