"""The types of fault on the plant where the theory holds exactly, against an uncertainty that fights them."""

import numpy as np
import pytest
from design_plant import TRAVEL_RAD, UNCERTAINTIES, DesignPlant
from hypothesis import given, settings
from hypothesis import strategies as st

import fault_kinds
from beaver_ftc.diagnosis.types import registry as types
from beaver_ftc.diagnosis.types.findings import fault_finding_dict
from samples import samples

FRAMES = 200
SURFACES = ("aileron", "elevator", "rudder", "flap")
LEAST_RUNAWAY_RAD_S = 0.5 * np.pi / 3


def stuck(surface, at, share, dt):
    low, high = TRAVEL_RAD[:, surface]
    c = low + share * (high - low)
    return lambda k, u: c if k >= at else u


def floating(surface, at, share, dt):
    return lambda k, u: 0.0 if k >= at else u


def bias(surface, at, share, dt):
    low, high = TRAVEL_RAD[:, surface]
    return lambda k, u: float(np.clip(u + (0.8 * share - 0.4) * (k >= at), low, high))


def growing(surface, at, share, dt):
    low, high = TRAVEL_RAD[:, surface]
    b = 0.4 * share - 0.2
    return lambda k, u: float(np.clip(u + b * (1 - np.exp(-0.03 * max(k - at, 0))), low, high))


def lost(surface, at, share, dt):
    return lambda k, u: u * (1 - share) if k >= at else u


def fading(surface, at, share, dt):
    return lambda k, u: u * (1 - share * (1 - np.exp(-0.05 * (k - at)))) if k >= at else u


def runaway(direction):
    def make(surface, at, share, dt):
        stop = TRAVEL_RAD[(direction + 1) // 2, surface]
        rate = LEAST_RUNAWAY_RAD_S * (1 + 3 * share)
        began = []

        def position(k, u):
            if k < at:
                return u
            began.append(u) if not began else None
            gone = began[0] + direction * rate * (k - at) * dt
            return min(gone, stop) if direction > 0 else max(gone, stop)

        return position

    return make


def swinging(surface, at, share, dt):
    low, high = TRAVEL_RAD[:, surface]
    w, amplitude = 1.0 + 9.0 * share, 0.01 + 0.05 * share
    return lambda k, u: float(np.clip(u + amplitude * np.sin(w * k * dt + share) * (k >= at), low, high))


def slow(surface, at, share, dt):
    where = []

    def position(k, u):
        if k < at:
            where[:] = [u]
            return u
        now = where[0] if where else u
        pace = (0.02 + 0.2 * share) * dt  # slower still, it is as good as stuck
        where[:] = [now + float(np.clip(u - now, -pace, pace))]
        return where[0]

    return position


TYPES = {
    "constant loss": (lost, fault_kinds.CONSTANT_LOSS),
    "varying loss": (fading, fault_kinds.VARYING_LOSS),
    "stuck": (stuck, fault_kinds.STUCK),
    "float": (floating, fault_kinds.FLOAT),
    "bias": (bias, fault_kinds.BIAS),
    "growing bias": (growing, fault_kinds.GROWING_BIAS),
    "hardover up": (runaway(1), fault_kinds.UP),
    "hardover down": (runaway(-1), fault_kinds.DOWN),
    "oscillatory": (swinging, fault_kinds.OSCILLATORY),
    "rate limit": (slow, fault_kinds.SLOW),
}
cases = st.fixed_dictionaries({
    "seed": st.integers(0, 2**32),
    "rate_hz": st.sampled_from([20.0, 50.0, 100.0]),
    "airspeed_mps": st.floats(30, 55),
})  # fmt: skip
surfaces, shares, starts = st.integers(0, 3), st.floats(0.0, 1.0), st.integers(0, FRAMES // 2)
uncertainties = st.sampled_from(list(UNCERTAINTIES.values()))


def fly(case, kind, surface, at, share, uncertainty, frames=FRAMES, gone=None):
    make, code = TYPES[kind]
    true = make(surface, at, share, 1.0 / case["rate_hz"])
    position = true if gone is None else (lambda k, u: true(k, u) if k < gone else u)
    plant = DesignPlant(surface=surface, position=position, fault_class="all", **case)
    return plant.fly(frames, uncertainty), code


@pytest.mark.parametrize("kind", TYPES)
@settings(max_examples=samples(30), deadline=None)
@given(cases, surfaces, starts, shares, uncertainties)
def test_the_true_type_is_never_excluded(kind, case, surface, at, share, uncertainty):
    plant, code = fly(case, kind, surface, at, share, uncertainty)
    assert not plant.position_excluded(surface)
    assert not plant.fdi["types"]["surface"][surface]["sets"]["excluded"][code]


@pytest.mark.parametrize("kind", ["constant loss", "stuck", "float", "bias", "hardover up", "oscillatory"])
@settings(max_examples=samples(20), deadline=None)
@given(cases, surfaces, starts, shares, uncertainties)
def test_nor_is_it_when_the_fault_goes_again(kind, case, surface, at, share, uncertainty):
    plant, code = fly(case, kind, surface, at, share, uncertainty, gone=at + 40)
    assert not plant.position_excluded(surface)
    assert not plant.fdi["types"]["surface"][surface]["sets"]["excluded"][code]


@pytest.mark.parametrize("kind", TYPES)
@settings(max_examples=samples(10), deadline=None)
@given(st.integers(0, 2**32), surfaces, shares, uncertainties)
def test_neither_surface_nor_type_is_ever_named_wrongly(kind, seed, surface, share, uncertainty):
    case = {"seed": seed, "rate_hz": 50.0, "airspeed_mps": 45.0}
    plant, code = fly(case, kind, surface, 30, share, uncertainty, frames=700)
    said = fault_finding_dict(plant.fdi, SURFACES)
    assert said["isolated"] in (SURFACES[surface], None)
    assert said["isolation_type"] in (types.TYPE_NAMES[code], None)
    if said["isolated"]:
        assert types.TYPE_NAMES[code] in said["candidates"]


@pytest.mark.parametrize("kind", ["varying loss", "growing bias", "rate limit"])
@settings(max_examples=samples(10), deadline=None)
@given(cases, surfaces, starts, shares, uncertainties)
def test_a_short_fault_of_any_course_stays_among_the_candidates(kind, case, surface, at, share, uncertainty):
    """Though a constant explains the few frames of it, too."""
    plant, code = fly(case, kind, surface, at, share, uncertainty, gone=at + 6)
    said = fault_finding_dict(plant.fdi, SURFACES)
    if said["candidates"]:
        name, left = types.TYPE_NAMES[code], said["candidates"]
        assert name in left or f"{SURFACES[surface]}:{name}" in left


@pytest.mark.parametrize(("kind", "true"), [("stuck", -0.26), ("bias", 0.24)])
def test_the_estimate_is_certain_to_lie_in_its_interval(kind, true):
    """Stuck a quarter up the aileron's travel; biased by 0.8 (0.8) - 0.4."""
    case = {"seed": 4, "rate_hz": 100.0, "airspeed_mps": 45.0}
    share = 0.25 if kind == "stuck" else 0.8
    plant, _ = fly(case, kind, 0, 30, share, UNCERTAINTIES["random"], frames=900)
    said = fault_finding_dict(plant.fdi, SURFACES)
    low, high = said["estimate_interval"]
    assert said["isolation_type"] == kind
    assert low <= true <= high
    assert high - low < np.deg2rad(0.4)
    assert said["estimate"] == pytest.approx(true, abs=np.deg2rad(0.2))


def test_amplitude_and_frequency_of_an_oscillation():
    case = {"seed": 4, "rate_hz": 100.0, "airspeed_mps": 45.0}
    plant, _ = fly(case, "oscillatory", 0, 30, 0.5, UNCERTAINTIES["random"], frames=1500)
    said = fault_finding_dict(plant.fdi, SURFACES)
    assert said["isolation_type"] == "oscillatory"
    assert said["estimate"] == pytest.approx(0.035, rel=0.05)
    assert said["frequency_rad_s"] == pytest.approx(5.5, rel=0.02)
