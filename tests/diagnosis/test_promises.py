"""The promises of the theory, on the plant where they hold exactly, against an uncertainty that fights."""

import numpy as np
import pytest
from design_plant import UNCERTAINTIES, DesignPlant
from hypothesis import given, settings
from hypothesis import strategies as st

from samples import samples

FRAMES = 160
BOUNDS = {
    "published": {},
    "none": {"inertia_coupling": {"p": 0, "q": 0, "r": 0}, "constant_rad_s2": {"p": 0, "q": 0, "r": 0}},
    "wide": {
        "inertia_coupling": {"p": 1, "q": 0.5, "r": 2},
        "constant_rad_s2": {"p": 0.1, "q": 0.001, "r": 0.05},
    },
}
switches = st.fixed_dictionaries(
    {name: st.booleans() for name in ("pole_bank", "memory", "shared_effectiveness", "set_membership")}
)
poles = st.floats(0.05, 1000)
flights = st.fixed_dictionaries({
    "seed": st.integers(0, 2**32),
    "rate_hz": st.floats(20, 1000),
    "airspeed_mps": st.floats(25, 60),
    "detection_pole_per_s": poles,
    "isolation_pole_per_s": poles,
    "pole_bank_per_s": st.lists(st.one_of(poles, st.just(1e6)), max_size=5),
    "forgetting_time_s": st.floats(0.1, 100),
    "sharpen": switches,
    "bounds": st.sampled_from(list(BOUNDS.values())),
})  # fmt: skip
uncertainties = st.sampled_from(list(UNCERTAINTIES.values()))


def constant(at, size):
    """A step at frame `at`."""
    return lambda k: -size if k >= at else 0.0


def incipient(at, size, grows):
    """1 - exp(-grows (k - at)) from frame `at` on."""
    return lambda k: -size * (1 - np.exp(-grows * (k - at))) if k >= at else 0.0


def intermittent(at, size, period):
    """On and off from frame `at` on."""
    return lambda k: -size if k >= at and (k - at) // period % 2 == 0 else 0.0


at, size = st.integers(0, FRAMES // 2), st.floats(0.0, 1.0)
constants = st.builds(constant, at, size)
any_course = st.one_of(
    constants,
    st.builds(incipient, at, size, st.floats(0.001, 1)),
    st.builds(intermittent, at, size, st.integers(1, 40)),
)


@settings(max_examples=samples(120), deadline=None)
@given(flights, uncertainties, st.sampled_from(["interval", "published"]))
def test_no_admissible_uncertainty_raises_an_alarm(flight, uncertainty, thresholds):
    plant = DesignPlant(thresholds=thresholds, **flight).fly(FRAMES, uncertainty)
    assert not plant.fdi["verdict"]["detected"]
    assert not any(plant.excluded(s) for s in range(3))
    # of every filter, however near the uncertainty drives it
    assert max(plant.frame["accounts"]["closest"]["filter"]) <= 1.0


@settings(max_examples=samples(150), deadline=None)
@given(flights, uncertainties, st.integers(0, 2), any_course)
def test_the_true_fault_is_never_excluded_whatever_its_course(flight, uncertainty, surface, theta):
    plant = DesignPlant(surface=surface, theta=theta, **flight).fly(FRAMES, uncertainty)
    assert not plant.excluded(surface)


low, high = -0.44, 0.44  # within every surface's travel
positions = st.one_of(
    st.builds(lambda at, c: lambda k, u: c if k >= at else u, at, st.floats(low, high)),
    st.builds(lambda at, b: lambda k, u: np.clip(u + b * (k >= at), low, high), at, st.floats(-0.2, 0.2)),
    st.builds(lambda at, w: lambda k, u: u + 0.04 * np.sin(w * k) * (k >= at), at, st.floats(0.01, 3)),
    st.builds(
        lambda at, seed: lambda k, u: np.random.default_rng(seed + k).uniform(low, high) if k >= at else u,
        at,
        st.integers(0, 10**6),
    ),
)


@settings(max_examples=samples(100), deadline=None)
@given(flights, uncertainties, st.integers(0, 2), positions)
def test_a_surface_that_may_be_anywhere_is_never_excluded(flight, uncertainty, surface, position):
    """Jammed, biased, swinging or mad: its position estimator admits it."""
    plant = DesignPlant(surface=surface, position=position, fault_class="all", **flight)
    plant.fly(FRAMES, uncertainty)
    assert not plant.position_excluded(surface)
    assert plant.detected_at_s <= plant.certain_after_s


@settings(max_examples=samples(100), deadline=None)
@given(flights, uncertainties, st.integers(0, 2), constants, st.sampled_from(["interval", "published"]))
def test_a_constant_true_fault_is_never_excluded_by_any_threshold(
    flight, uncertainty, surface, theta, thresholds
):
    """The published norm bound and set membership both presume a constant parameter."""
    plant = DesignPlant(
        surface=surface, theta=theta, thresholds=thresholds, fault_profile="abrupt", **flight
    ).fly(FRAMES, uncertainty)
    assert not plant.excluded(surface)
    if plant.fdi["verdict"]["detected"]:
        fie, true = plant.fdi["isolation"]["estimator"][surface], theta(FRAMES)
        assert (fie["set_lo"] <= true + 1e-9).all()
        assert (fie["set_hi"] >= true - 1e-9).all()


@settings(max_examples=samples(100), deadline=None)
@given(flights, uncertainties, st.integers(0, 2), any_course)
def test_detected_no_later_than_the_guaranteed_instant(flight, uncertainty, surface, theta):
    plant = DesignPlant(surface=surface, theta=theta, **flight).fly(FRAMES, uncertainty)
    assert plant.detected_at_s <= plant.certain_after_s


@pytest.mark.parametrize("surface", range(3))
def test_an_uncertainty_that_hides_the_fault_delays_detection_to_the_guaranteed_instant(surface):
    """The guarantee is not slack: the worst uncertainty there is makes it come true and no earlier."""
    plant = DesignPlant(seed=3, surface=surface, theta=incipient(20, 1.0, 0.01))
    plant.fly(2000, UNCERTAINTIES["hide"], until=lambda p: p.fdi["verdict"]["detected"])
    assert plant.detected_at_s == plant.certain_after_s < np.inf


@settings(max_examples=samples(60), deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 2), st.floats(0.1, 1.0), uncertainties)
def test_more_sharpening_never_isolates_later(seed, surface, size, uncertainty):
    """On one recorded flight each step can only exclude more."""

    def excluded(sharpen):
        plant = DesignPlant(seed, surface=surface, theta=constant(20, size), sharpen=sharpen)
        plant.fly(120, uncertainty)
        return {s for s in range(3) if plant.excluded(s)}

    none = {"memory": False, "shared_effectiveness": False, "set_membership": False}
    assert excluded({**none}) <= excluded({**none, "memory": True}) <= excluded("all")
