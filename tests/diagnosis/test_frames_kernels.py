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
