"""The loop as a user might write it must do the loop's work, or it is no measure of anything."""

import numpy as np
import pytest

from beaver_ftc.design.model import design_record, nonlinear_response
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.faults import FaultSchedule
from beaver_ftc.studies.bench.straightforward import Straightforward, f_and_G
from flying import Memory, loss, scenario

FAULT_FRAME, FRAMES = 200, 500


@pytest.fixture(scope="module")
def wanted():
    return scenario(duration_s=5, faults=[loss(at_s=2.0)], control={"law": "adaptive"})


@pytest.fixture(scope="module")
def flown(wanted):
    user = Straightforward(wanted.model_copy(update={"faults": ()}), at_s=0.0, frames=FRAMES)
    user.fly(FAULT_FRAME)
    FaultSchedule(wanted.faults, user.plant, wanted.rate_hz).apply(FAULT_FRAME)
    user.fly(FRAMES - FAULT_FRAME)
    return user


def test_its_design_model_is_the_published_one():
    """Euler's equations with the inertia tensor against the published split into constants."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        x = rng.uniform(-1, 1, 3)
        alpha, beta, V, qdyn, dpt = rng.uniform((-0.1, -0.3, 30, 500, 0), (0.3, 0.3, 55, 2000, 0.8))
        truth = {"alpha_rad": alpha, "beta_rad": beta, "airspeed_mps": V, "qdyn_pa": qdyn, "dpt": dpt}
        f, G = np.zeros(3), np.zeros((3, 4))
        design, y = design_record()[0], np.array([alpha, beta, V, qdyn, dpt])
        nonlinear_response(design, x, y, f, G)
        for mine, expected in zip(f_and_G(x, truth), (f, G), strict=True):
            np.testing.assert_allclose(mine, expected, rtol=1e-9, atol=1e-9)


def test_it_raises_no_alarm_before_the_fault_and_one_soon_after(flown):
    detected = [row["detected"] for row in flown.log]
    assert not any(detected[:FAULT_FRAME])
    assert all(detected[FAULT_FRAME + 20 :])


def test_it_names_the_elevator_and_its_loss(flown, changed):
    assert not changed(flown.log[::50], relative=1e-3)
    assert flown.estimators.isolated == 1
    assert flown.estimators.theta[1, 1] == pytest.approx(-0.4, abs=0.02)


def test_it_flies_as_well_as_the_loop(flown, wanted):
    log = Memory()
    fly(wanted, log)
    errors = [row["q_rad_s"] - row["q_model_rad_s"] for row in flown.log[FAULT_FRAME:]]
    assert np.rad2deg(np.sqrt(np.mean(np.square(errors)))) < 2 * log.rms_deg_s("q", 2.0) + 0.05
