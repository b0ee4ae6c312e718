"""The loop as a user might write it must do the loop's work, or it is no measure of anything."""

import numpy as np
import pytest

from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.control.laws import discretise
from beaver_ftc.design.fdc import MASS
from beaver_ftc.design.model import both_responses, design_record, inertia_coefficients
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.faults import FaultSchedule
from beaver_ftc.studies.bench.straightforward import (
    FeedbackLinearisation,
    PublishedModel,
    Straightforward,
)
from flying import Memory, scenario

FAULT_FRAME, FRAMES = 200, 500
LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 2}


@pytest.fixture(scope="module")
def wanted():
    return scenario(duration_s=5, faults=[LOSS], control={"law": "adaptive"})


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
        both_responses(design, x, y, f, G)
        mine = PublishedModel().f_and_G(x, truth)
        np.testing.assert_allclose(mine[0], f, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(mine[1], G, rtol=1e-9, atol=1e-9)


def test_it_raises_no_alarm_before_the_fault_and_one_soon_after(flown):
    detected = [row["detected"] for row in flown.log]
    assert not any(detected[:FAULT_FRAME])
    assert all(detected[FAULT_FRAME + 20 :])


def test_it_names_the_elevator_and_its_loss(flown):
    assert flown.estimators.isolated == 1
    assert flown.estimators.theta[1, 1] == pytest.approx(-0.4, abs=0.02)


def test_it_flies_as_well_as_the_loop(flown, wanted):
    log = Memory()
    fly(wanted, log)
    errors = [row["q_rad_s"] - row["q_model_rad_s"] for row in flown.log[FAULT_FRAME:]]
    assert np.rad2deg(np.sqrt(np.mean(np.square(errors)))) < 2 * log.rms_deg_s("q", 2.0) + 0.05


def test_its_bound_is_the_published_one_and_the_turning_earths(changed):
    """Each axis the product of the two other rates; of the Earth 2 W |x| and its square [WGS84]."""
    user = object.__new__(Straightforward)
    constant = {"constant_rad_s2": {"p": 0.01, "q": 0.02, "r": 0.03}}
    coupling = {"inertia_coupling": {"p": 0.1, "q": 0.2, "r": 0.3}}
    user.model, user.scenario = PublishedModel(), scenario(fdi={"bounds": constant | coupling})
    inertia, (p, q, r) = inertia_coefficients(MASS), (0.5, -0.3, 0.2)
    earth = 2.0 * EARTH_RATE_RAD_S * (0.5 + 0.3 + 0.2) + EARTH_RATE_RAD_S**2
    expected = np.array([0.01, 0.02, 0.03]) + earth
    expected += np.abs([0.1 * inertia.Pqr * q * r, 0.2 * inertia.Qpr * p * r, 0.3 * inertia.Rpq * p * q])
    assert user.bound(np.array([p, q, r])) == pytest.approx(expected, rel=1e-12)
    nothing = dict.fromkeys("pqr", 0.0)
    user.scenario = scenario(fdi={"bounds": {"constant_rad_s2": nothing, "inertia_coupling": nothing}})
    assert user.bound(np.zeros(3)) == pytest.approx([EARTH_RATE_RAD_S**2] * 3, rel=1e-12)


def test_its_law_cancels_the_model_and_follows_the_reference():
    """u = G^-1 (reference's acceleration + Kp e + Ki int e - f - unknown), the flap left where it is."""
    wanted, dt, flap = scenario(), 0.01, 0.1
    law = FeedbackLinearisation(wanted, dt, flap)
    rng = np.random.default_rng(7)
    G = np.diag([-8.0, -10.0, -4.0]) @ np.eye(3, 4) + np.outer([0.0, -2.0, 0.0], [0, 0, 0, 1])
    A, B = discretise(wanted.control.reference_natural_frequency_rad_s, wanted.control.reference_damping, dt)
    model, summed = np.zeros((2, 3)), np.zeros(3)
    for k in range(4):
        x, f, unknown, reference = rng.uniform(-0.1, 0.1, (4, 3))
        error = model[0] - x
        summed += dt * error
        demand = model[1] + law.Kp * error + law.Ki * summed - f - unknown - G[:, 3] * flap
        asked = demand / np.diag(G)
        u = law.command(x, f, G, unknown, reference)
        assert u == pytest.approx([*asked, flap], rel=1e-12)
        model = A @ model + np.outer(B, reference)
        assert law.model == pytest.approx(model), k
    far = law.command(x, np.array([50.0, -50.0, 1.0]), G, unknown, reference)
    assert far[:2].tolist() == [0.44, -0.44]
    assert (law.Kp, law.Ki) == (wanted.control.proportional_per_s, wanted.control.integral_per_s2)
