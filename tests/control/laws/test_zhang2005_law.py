"""The published law of two parts: what it learns by another road, and that it keeps the aircraft."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

from beaver_ftc.control.laws import zhang2005
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.reproduce.choices import scenario as published
from flying import Memory, flown, loss
from law_records import new_control
from samples import samples

UNANTICIPATED = {"type": "unanticipated", "Cm_alpha3": 10, "at_s": 12.0}
TRAVEL = np.array([[-0.5] * 4, [0.5] * 4])
LAW = {"law": "zhang2005"}


def law(**options):
    return configured(new_control(main=(0, 1, 2), law="zhang2005", effectiveness=1.0), options=options)


def configured(control, **keys):
    """The law's record filled from a scenario with these keys of `control`."""
    scenario = Scenario.model_validate({"name": "x", "control": {"law": "zhang2005", **keys}})
    control["layout"]["low"], control["layout"]["high"] = TRAVEL
    zhang2005.configure(control["zhang2005"], control, None, Declared.of(scenario), None)
    return control


@given(st.floats(0.5, 6.0), st.floats(0.1, 9.0), st.floats(0.02, 50.0))
def test_the_signal_is_that_of_lyapunovs_equation(Kp, Ki, q):
    """A' P + P A = -diag(1, q) by SciPy: the second row of P, over its last element."""
    keys = {"options": {"rate_weight": q}, "proportional_per_s": Kp, "integral_per_s2": Ki}
    control = configured(new_control(main=(0, 1, 2)), **keys)
    A = np.array([[0.0, 1.0], [-Ki, -Kp]])
    P = solve_continuous_lyapunov(A.T, -np.diag([1.0, q]))
    assert control["zhang2005"]["config"]["integral_weight"] == pytest.approx(P[1, 0] / P[1, 1])


def adapt(control, error, u=(0.1, -0.2, 0.05, 0.0), dt=0.01):
    G = np.zeros((3, 4))
    G[0, 0], G[2, 0], G[1, 1], G[2, 2], G[0, 2] = -8.0, -0.4, -10.0, -5.0, 0.3
    saturated = control.allocation.output.saturated
    main, error = control.layout.main, np.array(error)
    u = np.array(u)
    zhang2005.adapt(control.zhang2005, control.surfaces, main, saturated, error, 0.0 * error, G, u, dt)
    return G, u


def test_effectiveness_follows_the_gradient_and_stays_in_its_set():
    control = law(parametric_gain=20.0)
    control.zhang2005.feedback.memory.integral[:] = 0.02, -0.01, 0.0
    control.surfaces.output.effectiveness[:3] = 0.8
    error = np.array([0.03, -0.02, 0.01])
    G, u = adapt(control, error)
    s = error + control.zhang2005.config.integral_weight * control.zhang2005.feedback.memory.integral
    expected = 0.8 - 0.01 * 20.0 * (s @ (G * u))[:3]
    np.testing.assert_allclose(control.surfaces.output.effectiveness[:3], expected)
    assert control.surfaces.output.effectiveness[3] == 1.0
    free = law(parametric_gain=20.0, projection=0)
    for _ in range(2000):
        adapt(control, 9.0 * error)
        adapt(free, 9.0 * error)
    kept, beyond = control.surfaces.output.effectiveness, free.surfaces.output.effectiveness
    assert ((kept >= 0.1) & (kept <= 1.0)).all()
    assert np.isfinite(beyond).all()
    assert ((beyond < 0.1) | (beyond > 1.0)).any()


@settings(max_examples=samples(15))
@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0))
def test_the_lyapunov_function_falls(unknown, e0):
    """e' = -Kp e - Ki int e + fhat - phi, phi constant, in small steps: V with the weights in it."""
    control, dt = law(network_gain=60.0, rate_weight=20.0), 1e-3
    q, Gamma, network = 20.0, 60.0, control.zhang2005.network
    network.memory.basis[:, 0] = 1.0
    A = np.array([[0.0, 1.0], [-1.0, -2.0]])
    P = solve_continuous_lyapunov(A.T, -np.diag([1.0, q]))
    e, integral, before = e0, 0.0, np.inf
    for k in range(3000):
        control.zhang2005.feedback.memory.integral[1] = integral
        missed = network.memory.weights[1, 0] - unknown
        z = np.array([integral, e])
        V = z @ P @ z / P[1, 1] + missed**2 / Gamma
        if k % 100 == 0:
            assert before + 1e-12 >= V * (1.0 - 2e-3)
            before = V
        adapt(control, (0.0, e, 0.0), u=np.zeros(4), dt=dt)
        e, integral = (
            e + dt * (-2.0 * e - integral + network.memory.weights[1, 0] - unknown),
            integral + dt * e,
        )
    assert abs(e) < 0.05 * (1.0 + abs(unknown) + abs(e0))


def test_the_network_alone_keeps_the_unanticipated_case():
    changes = {"faults": [UNANTICIPATED], "initial.airspeed_mps": 48.0}
    log = Memory()
    flight = fly(published("alone", changes | {"control.options": {"parametric_gain": 0.0}}), log)
    assert flight.departure is None
    assert flight.detection_time_s - 12.0 <= 0.5
    assert log.rms_deg_s("q", 14.0) < 0.3  # a tenth of the reference's amplitude
    assert fly(published("without", changes | {"control.options": {"network": 0}})).departure is not None


def test_after_an_elevator_loss_the_flap_takes_over_unless_it_is_told_not_to():
    keys = {"fdi": {"scheme": "zhang2005"}, "faults": [loss(at_s=4.0)], "duration_s": 12.0}
    flight, log = flown(**keys, control=LAW)
    assert [mode for _, mode in flight.supervisor] == ["nominal", "adaptive", "reallocated"]
    after = log["t_s"] > 6.0
    assert np.ptp(log["elevator_cmd_rad"][after]) < 0.2 * np.ptp(log["flap_cmd_rad"][after])
    assert log.rms_deg_s("q", 6.0) < 0.3
    kept, log = flown(**keys, control=LAW | {"options": {"hand_over": 0}})
    assert [mode for _, mode in kept.supervisor] == ["nominal", "adaptive"]
    assert np.ptp(log["flap_cmd_rad"]) == 0.0
