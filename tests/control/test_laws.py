"""The laws against the linear systems they are meant to produce."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from beaver_ftc.control import allocation
from beaver_ftc.control.laws import published, reference
from law_records import AILERON, ELEVATOR, FLAP, RUDDER, new_control

DT = 0.01
G_TYPICAL = np.array([[-9.0, 0.0, 0.6, 0.0], [0.0, -10.0, 0.0, 2.1], [-0.2, 0.0, -2.0, 0.0]])


def control_record():
    control = new_control(
        main=(0, 1, 2), stand_in=3, dt=DT, effectiveness=1.0, least_effectiveness=0.1, hand_over_step=DT
    )
    control["published"]["config"]["Kp"], control["published"]["config"]["Ki"] = 2.0, 1.0
    layout = control["layout"]
    layout["low"], layout["high"] = [-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]
    return control


def allocated(control, G):
    """The surfaces, rad, for the demand in the record."""
    out, effectiveness = control["allocation"]["output"], control["surfaces"]["output"]["effectiveness"]
    control["axes"]["G"], share = G, allocation.smoothstep(out["hand_over"])
    allocation.allocate(control["axes"], out, control["layout"], effectiveness, share, 0.0)
    return out["command"]


def pulled(control, x, f):
    """The surfaces, rad, by the published law for measured rates x; its integrators go a frame on."""
    law, axes, model = control["published"], control["axes"], control["reference"]
    published.demand(law, axes, model["output"], x, f, np.zeros(3))
    u = allocated(control, G_TYPICAL)
    published.integrate(law, axes, model, control["allocation"]["output"]["command"], x)
    return u


class TestReferenceModel:
    @given(wn=st.floats(0.5, 50), zeta=st.floats(0.2, 3), dt=st.floats(0.001, 0.05))
    def test_discretisation_is_the_matrix_exponential(self, wn, zeta, dt):
        A, B = reference.discretise(wn, zeta, dt)
        F = np.array([[0, 1, 0], [-wn * wn, -2 * zeta * wn, wn * wn], [0, 0, 0]])
        expected = expm(F * dt)
        assert pytest.approx(expected[:2, :2], rel=1e-7, abs=1e-7) == A
        assert pytest.approx(expected[:2, 2], rel=1e-7, abs=1e-7) == B

    def test_a_step_is_reached_without_overshoot_when_critically_damped(self):
        control = control_record()
        model = control["reference"]
        model["config"]["A"], model["config"]["B"] = reference.discretise(10.0, 1.0, DT)
        history = []
        for _ in range(200):
            reference.follow(model["config"], model["output"], np.array([0.1, 0.0, -0.2]))
            history.append(control["reference"]["output"]["model_rate"].copy())
        t = DT * np.arange(1, 201)
        assert np.array(history)[:, 0] == pytest.approx(0.1 * (1 - (1 + 10 * t) * np.exp(-10 * t)), abs=1e-9)
        assert np.array(history)[-1] == pytest.approx([0.1, 0, -0.2], abs=1e-6)


class TestNominal:
    def test_the_tracking_error_obeys_its_own_linear_equation(self):
        """With f and G exact: e'' + Kp e' + Ki e = 0, integrated here as the two-state system it is."""
        control = control_record()
        f = np.array([0.3, -0.2, 0.1])
        x = np.array([0.05, -0.03, 0.02])
        expected = np.array([-x, np.zeros(3)])  # error and its integral
        step = np.array([[1 - 2.0 * DT, -1.0 * DT], [DT, 1.0]])
        for _ in range(300):
            demands = f + G_TYPICAL @ pulled(control, x, f)
            x = x + DT * demands
            expected = step @ expected
            assert -x == pytest.approx(expected[0], abs=1e-12)

    def test_the_integrator_does_not_wind_up_at_a_stop(self):
        control = control_record()
        x = np.array([0.0, -3.0, 0.0])  # far more than the elevator can give
        for _ in range(3000):
            pulled(control, x, np.zeros(3))
        attainable = 10 * 0.49
        assert control["allocation"]["output"]["saturated"][ELEVATOR] == 1
        # in equilibrium the demand stands off what can be given by Kp times the error, and no further
        assert control["axes"]["demand"][1] == pytest.approx(attainable + 2.0 * 3.0, rel=1e-3)


small = st.floats(-0.5, 0.5)


class TestAllocation:
    @given(demand=st.tuples(small, small, small), hand_over=st.floats(0, 1), loss=st.floats(0, 0.8))
    def test_what_is_demanded_is_what_the_surfaces_give(self, demand, hand_over, loss):
        control = control_record()
        control["axes"]["demand"], control["allocation"]["output"]["hand_over"] = demand, hand_over
        control["surfaces"]["output"]["effectiveness"][ELEVATOR] = 1 - loss
        allocation.form_effectiveness_matrix(control["axes"], G_TYPICAL, control["surfaces"], True)
        G = control["axes"]["G"].copy()
        u = allocated(control, G)
        if not control["allocation"]["output"]["saturated"][[AILERON, ELEVATOR, RUDDER]].any():
            assert G @ u == pytest.approx(demand, abs=1e-12)

    def test_after_the_hand_over_the_elevator_keeps_its_trimmed_moment(self):
        control = control_record()
        control["layout"]["trim"][ELEVATOR], control["allocation"]["output"]["hand_over"] = -0.04, 1.0
        control["surfaces"]["output"]["effectiveness"][ELEVATOR] = 0.6
        control["axes"]["demand"] = [0.0, 0.4 + 0.2, 0.0]
        allocation.form_effectiveness_matrix(control["axes"], G_TYPICAL, control["surfaces"], True)
        G = control["axes"]["G"].copy()
        u = allocated(control, G)
        assert u[ELEVATOR] == pytest.approx(-0.04 / 0.6)
        assert u[FLAP] == pytest.approx(0.2 / 2.1)
