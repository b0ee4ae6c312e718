"""A few dozen frames of the whole diagnosis on the design model as a plant, where sums and sets are exact."""

import numpy as np
import pytest
from design_plant import UNCERTAINTIES, DesignPlant

from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2

RATE_HZ, AT, THETA = 50.0, 5, -0.6
AILERON, ELEVATOR, RUDDER = range(3)


def exactly(plant, bound, phi):
    """The model is right."""
    return 0.0 * bound


def plant(surface=None, **given):
    theta = None if surface is None or "position" in given else (lambda k: THETA if k >= AT else 0.0)
    return DesignPlant(seed=3, rate_hz=RATE_HZ, surface=surface, theta=theta, **given)


def summed(pole_keeps, inputs):
    """dt times the sum of what each frame's input has left, (poles, axes)."""
    ages = np.arange(len(inputs))[::-1]
    return np.asarray(pole_keeps)[..., None] ** ages @ np.asarray(inputs) / RATE_HZ


@pytest.mark.parametrize("kind", ["random", "push"])
def test_until_an_alarm_all_is_sums_of_what_the_model_does_not_explain(kind):
    flown = plant().fly(30, UNCERTAINTIES[kind])
    fdi, n = flown.fdi, int(flown.fdi["bank"]["config"]["n_filters"])
    missed, bounds = np.array(flown.innovations[:-1]), np.array(flown.bounds[:-1]) + ROUNDING_RAD_S2
    assert not fdi["verdict"]["detected"]
    assert fdi["bank"]["output"]["innovation"] == pytest.approx(missed[-1])
    keeps = fdi["bank"]["config"]["a"][:n]
    assert fdi["bank"]["output"]["residual"][:n] == pytest.approx(summed(keeps, missed))
    assert fdi["bank"]["output"]["threshold"][:n] == pytest.approx(summed(keeps, bounds))
    for i in range(3):
        keep = fdi["fdae"]["config"]["a"][i]
        assert fdi["fdae"]["output"]["residual"][i] == pytest.approx(summed(keep, missed[:, [i]])[0])
        assert fdi["fdae"]["output"]["threshold"][i] == pytest.approx(summed(keep, bounds[:, [i]])[0])
    assert not fdi["fdae"]["network"]["memory"]["weights"].any()
    assert not fdi["isolation"]["estimator"]["xhat"].any()
    assert ((fdi["bank"]["output"]["peak"][:n] > 0.0) & (fdi["bank"]["output"]["peak"][:n] < 1.0)).all()


@pytest.mark.parametrize("surface", [AILERON, ELEVATOR, RUDDER])
def test_an_alarm_is_of_the_frame_in_which_a_residual_leaves_its_bound(surface):
    flown, axis = plant(surface), (0, 1, 2)[surface]
    seen = []
    for _ in range(40):
        flown.fly(1, exactly)
        bank = flown.fdi["bank"]
        n = int(bank["config"]["n_filters"])
        seen.append((np.abs(bank["output"]["residual"][:n]) > bank["output"]["threshold"][:n]).any(axis=0))
        if flown.fdi["verdict"]["detected"]:
            break
    first = int(np.flatnonzero(np.any(seen, axis=1))[0])
    assert first > AT
    assert flown.detected_at_s == pytest.approx(first / RATE_HZ)
    assert flown.fdi["verdict"]["axis"] == int(np.flatnonzero(seen[first])[0])
    assert seen[first][axis] or surface != ELEVATOR
    # Every estimator starts there, with no residual and all of its set.
    fie = flown.fdi["isolation"]["estimator"][surface]
    assert fie["xhat"] == pytest.approx(flown.frame["measured"]["x"])
    assert not fie["excluded"]
    assert fie["P"] == pytest.approx([1.0 / 12.0] * 3)
    assert not fie["Om"].any()


def loss_flown(surface, kind=exactly, frames=60, **fdi):
    """Flown frame by frame; what must hold of the true estimator in each of them."""
    flown = plant(surface, **fdi)
    for _ in range(frames):
        flown.fly(1, kind)
        fie, verdict = flown.fdi["isolation"]["estimator"][surface], flown.fdi["verdict"]
        assert not fie["excluded"]
        if verdict["detected"]:
            asked = fie["skip"] == 0
            room = 1e-12
            assert (fie["mu_lo"] - room <= fie["residual"])[asked].all()
            assert (fie["residual"] <= fie["mu_hi"] + room)[asked].all()
            assert (fie["theta_min"] <= fie["theta"]).all()
            assert (fie["theta"] <= fie["theta_max"]).all()
    return flown


@pytest.mark.parametrize("surface", [AILERON, ELEVATOR, RUDDER])
@pytest.mark.parametrize("kind", ["none", "random", "push"])
def test_the_estimator_of_the_true_loss_stays_and_is_named_once_it_is_alone(surface, kind):
    flown = loss_flown(surface, exactly if kind == "none" else UNCERTAINTIES[kind])
    verdict, fies = (
        flown.fdi["verdict"],
        flown.fdi["isolation"]["estimator"][: int(flown.fdi["isolation"]["config"]["n_estimators"])],
    )
    left = np.flatnonzero(fies["excluded"] == 0)
    assert surface in left
    assert verdict["isolated_estimator"] == (surface if len(left) == 1 else -1)
    if len(left) == 1:
        gone = np.delete(fies["excluded_at_s"], surface)
        assert verdict["isolated_at_s"] == pytest.approx(gone.max())
        assert gone.min() >= verdict["detected_at_s"]


def test_an_estimator_filters_what_its_fault_does_not_explain():
    """Since the alarm its residual is Omega (theta - thetahat), Omega the filtered moment [Zhang2005, IV]."""
    flown, steps = plant(ELEVATOR), []
    for k in range(60):
        flown.fly(1, exactly)
        fie, verdict = flown.fdi["isolation"]["estimator"][ELEVATOR], flown.fdi["verdict"]
        if verdict["detected"]:
            alarm = round(float(verdict["detected_at_s"]) * RATE_HZ)
            moments = np.array(flown.innovations[alarm:k]).reshape(-1, 3) / THETA
            omega = summed(flown.fdi["isolation"]["config"]["a"][ELEVATOR], moments)
            assert fie["Om"] == pytest.approx(omega, abs=1e-15)
            assert fie["residual"] == pytest.approx(omega * (THETA - fie["theta"]), abs=1e-12)
            steps.append(np.abs(fie["residual"]).max())
    assert len(steps) > 40
    assert max(steps) > 5e-4
    assert fie["theta"][1] == pytest.approx(THETA, abs=0.02)


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("whole_class", [False, True])
def test_what_is_known_of_a_fault_is_expected_from_the_alarm_on(known, whole_class):
    stuck_at = 0.2
    position = (lambda k, u: stuck_at if k >= AT else u) if whole_class else None
    more = {"fault_class": "all", "position": position} if whole_class else {}
    flown = plant(ELEVATOR, **more)
    control = flown.frame["control"]
    for _ in range(40):
        flown.fly(1, exactly)
        if flown.fdi["verdict"]["detected"] and known:
            control["surfaces"]["output"]["effectiveness"][ELEVATOR] = 0.0 if whole_class else 1.0 + THETA
            control["surfaces"]["output"]["offset"][ELEVATOR] = stuck_at if whole_class else 0.0
    left = flown.frame["prediction"]["F_known"] - flown.frame["prediction"]["means"]["F"]
    phi = np.array(flown.innovations[-2])
    assert np.abs(phi).max() > 0.05
    assert left == pytest.approx(phi if known else 0.0 * phi, abs=1e-12)


FAULTS = {
    "jam": lambda k, u: 0.2 if k >= AT else u,
    "hard over": lambda k, u: 0.44 if k >= AT else u,
    "bias": lambda k, u: u + 0.15 if k >= AT else u,
    "loss": lambda k, u: 0.3 * u if k >= AT else u,
    "oscillation": lambda k, u: u + 0.2 * np.sin(0.3 * k) if k >= AT else u,
    "runaway": lambda k, u: min(0.02 * (k - AT), 0.4) if k >= AT else u,
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("surface", [AILERON, ELEVATOR, RUDDER])
def test_of_faults_of_every_kind_the_true_position_is_never_excluded(name, surface):
    flown = plant(surface, position=FAULTS[name], fault_class="all")
    for _ in range(30):
        flown.fly(1, UNCERTAINTIES["random"])
        assert not flown.position_excluded(surface)
    verdict = flown.fdi["verdict"]
    assert verdict["detected"]
    assert verdict["target"] in (-1, surface)
    named = int(verdict["isolated_estimator"])
    assert named == -1 or flown.fdi["isolation"]["estimator"]["surface"][named] == surface
    if name != "oscillation" or surface != RUDDER:
        assert (
            surface
            in flown.fdi["isolation"]["estimator"]["surface"][
                flown.fdi["isolation"]["estimator"]["excluded"] == 0
            ]
        )
