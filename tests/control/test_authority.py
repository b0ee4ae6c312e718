"""Lost authority: the attainable moments, the reference bent to them, and the probe that nobody feels."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.control import allocation, authority, probing, reference_model
from beaver_ftc.control.state import control_dtype

DT = 0.01
LOW, HIGH = np.array([-0.52, -0.49, -0.44, -0.1]), np.array([0.52, 0.49, 0.44, 1.03])


def control_record():
    control = np.zeros(1, control_dtype(4))
    control["main"], control["stand_in"] = [0, 1, 2], 3
    control["dt"], control["low"], control["high"] = DT, LOW, HIGH
    control["effectiveness"], control["reference_scale"] = 1.0, 1.0
    control["model_A"], control["model_B"] = reference_model.discretise(10.0, 1.0, DT)
    return control[0]


@given(st.lists(st.floats(-12, 12), min_size=4, max_size=4))
def test_the_attainable_interval_is_spanned_by_the_corners_of_the_travel(row):
    G = np.array([row] * 3)
    corners = [G[1] @ np.array(corner) for corner in product(*zip(LOW, HIGH, strict=True))]
    least, greatest = authority.attainable(G, LOW, HIGH, 1)
    assert least == pytest.approx(min(corners), abs=1e-12)
    assert greatest == pytest.approx(max(corners), abs=1e-12)


def test_without_a_loss_the_law_follows_the_reference_model_to_the_bit():
    control = control_record()
    for k in range(50):
        reference = np.array([0.05 * np.sin(k / 9), 0.02, -0.01])
        reference_model.follow(control, reference)
        authority.govern(control, reference)
        assert np.array_equal(control["governed_rate"], control["model_rate"])


def test_a_shortfall_on_one_side_scales_the_reference_on_both_and_in_time_it_comes_back():
    control = control_record()
    control["hedging"] = 1
    control["shortfall"] = [0.0, 0.5, 0.0]
    for _ in range(10):
        authority.govern(control, np.array([0.05, 0.05, 0.05]))
    missed = 10 * DT * 0.5 / authority.MISSED_RAD_S
    assert control["reference_scale"][1] == pytest.approx(1 - missed, abs=0.01)
    assert control["reference_scale"][[0, 2]] == pytest.approx([1, 1])
    control["shortfall"] = 0.0
    for _ in range(round(5 * authority.RECOVERY_S / DT)):
        authority.govern(control, np.array([0.05, 0.05, 0.05]))
    assert control["governed_rate"] == pytest.approx(0.05, rel=0.01)


def test_a_demand_beyond_the_stops_is_noted():
    control = control_record()
    G = np.zeros((3, 4))
    G[1, 3] = 2.2  # nothing but the flap is left
    control["demand"] = [0.0, -1.0, 0.0]
    control["hold"] = [0.0, -0.5, 0.0]
    authority.note_shortfall(control, G, np.array([0.0, 0.0, 0.0, -0.1]))
    assert control["shortfall"][1] == pytest.approx(-1.0 + 0.22)
    assert list(control["beyond"]) == [0, 1, 0]


def test_what_a_lagging_surface_still_gives_is_no_shortfall():
    control, rng = control_record(), np.random.default_rng(3)
    G, u, lag = rng.normal(size=(3, 4)), rng.uniform(-0.1, 0.1, 4), rng.uniform(-0.1, 0.1, 4)
    control["demand"], control["lag"] = rng.normal(size=3), lag
    authority.note_shortfall(control, G, u)
    assert control["shortfall"] == pytest.approx(control["demand"] - G @ (u + lag), abs=1e-12)


class TestProbing:
    def probed(self, wanted):
        control = control_record()
        control["probe_amplitude"], control["probe_step"], control["probe_frames"] = 0.05, np.pi * DT, 400
        control["probe_from_s"] = control["probe_to_s"] = -1.0
        history = []
        for k in range(1000):
            probing.advance(control, wanted(k), k * DT)
            history.append(float(control["probe"]))
        return control, np.array(history)

    def test_it_is_bounded_one_sided_and_without_a_jump(self):
        control, history = self.probed(lambda k: k >= 100)
        assert history.min() >= 0.0
        assert history.max() == pytest.approx(0.05, abs=1e-4)
        assert np.abs(np.diff(history)).max() < 0.05 * np.pi * DT
        assert (control["probe_from_s"], control["probe_to_s"]) == pytest.approx((1.0, 5.0))

    def test_it_ends_with_the_movement_in_which_the_doubt_ends_and_does_not_come_again(self):
        control, history = self.probed(lambda k: 100 <= k < 150 or k > 600)
        assert control["probe_to_s"] == pytest.approx(3.0)
        assert not history[320:].any()

    @given(st.floats(0, 0.1), st.floats(-0.5, 0.5))
    def test_a_healthy_aircraft_feels_nothing(self, probe, needed):
        control = control_record()
        control["probe"], control["demand"] = probe, [0.0, needed, 0.0]
        G = np.array([[-9.0, 0, 0.6, 0], [0, -10.0, 0, 2.1], [-0.2, 0, -2.0, 0]])
        u = np.zeros(4)
        allocation.allocate(control, G, u)
        assert (G @ u)[1] == pytest.approx(needed, abs=1e-12)
