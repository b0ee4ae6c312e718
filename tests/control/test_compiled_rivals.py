"""A rival in the loop's kernels against its equation, frame by frame on random rates, without an aircraft."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.control.accommodation import MODE_NOMINAL
from beaver_ftc.control.laws import compiled_rivals
from beaver_ftc.control.rivals.lqr import FixedGainLqr
from beaver_ftc.design.context import Context
from law_records import fields, new_control

DT = 0.02
A = np.array([[-4.0, 0.3, 1.0], [0.2, -3.0, 0.1], [-0.2, 0.4, -0.8]])
G = np.array([[-9.0, 0.7, 0.5, 0.1], [0.4, -12.0, 0.2, 3.0], [-0.4, 0.3, -4.0, 0.2]])
TRIM_X, TRIM = np.array([0.01, -0.02, 0.03]), np.array([0.02, -0.05, 0.01, 0.1])
# A design model that couples all axes: xdot = A x + G u
LINEAR = SimpleNamespace(f=lambda x, y: A @ x, G=lambda y: G)


def context(most):
    travel = np.array([[-most] * 4, [0.8 * most] * 4])
    return Context(
        DT, 1, LINEAR, TRIM_X, np.zeros(5), TRIM, travel, np.zeros(3), np.zeros(3), leading=(0, 1, 2)
    )


@pytest.mark.parametrize("most", [9.0, 0.12])
def test_the_regulator_commands_what_its_equation_says_within_the_travel_and_at_the_stops(most):
    rng, law = np.random.default_rng(5), FixedGainLqr()
    law.reset(context(most))
    control = new_control(main=(0, 1, 2), dt=DT)
    control["layout"]["trim"] = TRIM
    control["layout"]["low"], control["layout"]["high"] = -most, 0.8 * most
    law.compile_into(control["compiled_rivals"])
    frame = SimpleNamespace(G=G, means=SimpleNamespace(Gu=G)), SimpleNamespace(x=None)
    K, integral, at_stop, stops = law.law["config"]["K"], np.zeros(3), np.zeros(4, bool), 0
    for k in range(40):
        x, rate, acceleration = 0.02 * rng.normal(size=(3, 3))
        integral = integral + DT * (rate - x) * (not at_stop.any())
        forward = np.linalg.solve(G[:, :3], acceleration - A @ (rate - TRIM_X))
        back = K @ [*rate - x, *integral]
        wanted = np.clip(TRIM + np.append(forward + back, 0.0), -most, 0.8 * most)
        reference, out = fields(control["reference"]), control["allocation"]["output"]
        reference["model_rate"], reference["model_acceleration"], frame[1].x = rate, acceleration, x
        compiled_rivals.command(control, None, None, *frame, MODE_NOMINAL, k * DT)
        assert out["command"] == pytest.approx(wanted)
        at_stop = np.isin(wanted, (-most, 0.8 * most))
        assert out["saturated"].tolist() == at_stop.tolist()
        stops += at_stop.sum()
    assert (stops > 5) == (most < 1.0)
