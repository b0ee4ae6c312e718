"""A repaired surface on its way back: neither at fault nor healthy, and no reason to doubt what it was."""

import numpy as np
import pytest
from design_plant import TRAVEL_RAD, UNCERTAINTIES, DesignPlant
from hypothesis import example, given, settings
from hypothesis import strategies as st
from test_fault_types import TYPES, cases, shares, surfaces

import fault_kinds
from samples import samples

HELD = ("stuck", "float", "hardover up", "hardover down")
uncertainties = st.sampled_from(list(UNCERTAINTIES.values()))


class Repaired:
    """A servo held by a fault from frame `at` to `gone`; otherwise it follows its command."""

    def __init__(self, kind, surface, at, gone, share, dt, back=None):
        self.make, self.code = TYPES[kind]
        self.surface, self.at, self.gone = surface, at, gone
        self.true, self.back = (
            self.make(surface, at, share, dt),
            back or (lambda plant, a, c: plant.moved(a, c)),
        )
        self.actuator = 0.0

    def __call__(self, k, u):
        if k < self.at:
            self.actuator = u
        elif k < self.gone:
            self.actuator = self.true(k, u)
        else:
            self.actuator = self.back(self.plant, self.actuator, self.plant.commanded[self.surface])
        return self.actuator


def fly(case, surface, fault, uncertainty, frames=200):
    plant = DesignPlant(surface=surface, position=fault, fault_class="all", actuators="servo", **case)
    fault.plant = plant
    return plant.fly(frames, uncertainty)


def at_20_hz(seed, airspeed_mps):
    return {"seed": seed, "rate_hz": 20.0, "airspeed_mps": airspeed_mps}


@pytest.mark.parametrize("kind", HELD)
@settings(max_examples=samples(40), deadline=None)
@example(at_20_hz(0, 54.0), 1, 0, 3, 0.0, UNCERTAINTIES["push"])  # back to 1e-12 rad, and still felt
@example(at_20_hz(284662124, 49.2), 1, 0, 12, 0.0, UNCERTAINTIES["across"])  # ends pass by rounding
@example(at_20_hz(2069848671, 37.4), 2, 25, 4, 0.6, UNCERTAINTIES["bang-bang"])
@given(cases, surfaces, st.integers(0, 60), st.integers(3, 60), shares, uncertainties)
def test_a_return_excludes_neither_surface_nor_type(kind, case, surface, at, lasting, share, uncertainty):
    fault = Repaired(kind, surface, at, at + lasting, share, 1 / case["rate_hz"])
    plant = fly(case, surface, fault, uncertainty)
    assert not plant.position_excluded(surface)
    assert not plant.fdi["types"]["surface"][surface]["sets"]["excluded"][fault.code]


@settings(max_examples=samples(60), deadline=None)
@given(cases, surfaces, st.integers(0, 60), st.integers(3, 60), shares, uncertainties)
def test_a_return_does_not_move_the_jam(case, surface, at, lasting, share, uncertainty):
    """Where it was jammed stays within its set, though the last frames showed it elsewhere."""
    fault = Repaired("stuck", surface, at, at + lasting, share, 1 / case["rate_hz"])
    plant = fly(case, surface, fault, uncertainty, frames=at + lasting + int(3 * case["rate_hz"]))
    low, high = TRAVEL_RAD[:, surface]
    known = plant.fdi["types"]["surface"][surface]
    healthy = not (known["last"]["anomalous"] or known["judged"]["anomalous"])
    if healthy:
        assert (
            known["sets"]["low"][fault_kinds.STUCK]
            <= low + share * (high - low)
            <= known["sets"]["high"][fault_kinds.STUCK]
        )


class Masked(DesignPlant):
    """The command undoes a swing of the surface while it lasts, and then stays where that left it."""

    def command(self, f, G):
        command = super().command(f, G)
        command[self.surface] = self.wanted(self.k + 1)
        return command


@pytest.mark.parametrize(("profile", "excluded"), [("any", False), ("abrupt", True)])
@pytest.mark.parametrize("surface", [0, 1, 2])
def test_health_after_a_swing_that_looked_like_a_jam_is_no_quiet_of_a_jam(surface, profile, excluded):
    """p = u + A sin(wt) under u = c - A sin(wt): a jam at c, as long as it lasts; so is health under u = c.

    Only a fault that is declared to stay shows by its quiet that it does not swing.
    """
    at, lasting, c, amplitude = 60, 150, 0.15, 0.08
    swing = lambda k: amplitude * np.sin(1.5 * (k - at) * 0.01) * (at <= k < at + lasting)  # noqa: E731
    plant = Masked(
        seed=1, surface=surface, position=lambda k, u: u + swing(k), fault_class="all", fault_profile=profile
    )
    plant.wanted = lambda k: c - swing(k)
    plant.fly(1000, UNCERTAINTIES["random"])
    known = plant.fdi["types"]["surface"][surface]
    assert not known["sets"]["excluded"][fault_kinds.STUCK]
    assert bool(known["sets"]["excluded"][fault_kinds.OSCILLATORY]) == excluded
    assert excluded or plant.fdi["verdict"]["fault_type"] != fault_kinds.STUCK
