"""Types of fault with errors declared: a truth with other coefficients, seen through noisy gyros."""

import numpy as np
import pytest
from design_plant import DesignPlant, conclude, evaluate
from hypothesis import example, given, settings
from hypothesis import strategies as st
from test_fault_types import TYPES, shares, starts, surfaces
from test_release import HELD, Repaired

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import design_record, nonlinear_response
from beaver_ftc.diagnosis.types import registry as types
from beaver_ftc.diagnosis.types.findings import fault_finding_dict
from samples import samples

NOISE_DEG_S = 0.02
TOLERANCE = 0.05
SURFACES = ("aileron", "elevator", "rudder", "flap")
NAMES = [term.name for term in load().moments]


class RealPlant(DesignPlant):
    """The truth has coefficients at the ends of their tolerance; the gyros are off by up to four sigma."""

    def __init__(self, seed, noisy, **keys):
        bounds = {"coefficients": TOLERANCE}
        if noisy:
            bounds["sensors"] = {axis: {"noise_std_deg_s": NOISE_DEG_S} for axis in "pqr"}
        super().__init__(seed=seed, bounds=bounds, fault_class="all", **keys)
        is_anomalous = {name: 1 + TOLERANCE * self.rng.choice([-1, 1]) for name in NAMES}
        self.truth = design_record(scale=is_anomalous)[0]
        self.largest_deflection = 4 * np.deg2rad(NOISE_DEG_S) * noisy

    def _step(self, uncertainty):
        frame = self.frame
        seen = self.x + self.rng.choice([-1, 1], 3) * self.largest_deflection
        frame["k"], frame["t"] = self.k, self.k * self.dt
        prediction, y = frame["prediction"], self.condition()
        frame["measured"]["x"], frame["measured"]["y"] = seen, y
        prediction["u"], prediction["commanded"] = self.u, self.commanded
        evaluate(self.frames)
        f, G, true_f, true_G = prediction["f"].copy(), prediction["G"].copy(), np.zeros(3), np.zeros((3, 4))
        nonlinear_response(self.truth, self.x, y, true_f, true_G)
        conclude(self.frames)
        eta = self.rng.uniform(-0.02, 0.02, 3)
        self.x = self.x + self.dt * (true_f + true_G @ self.u + self.effect(true_G) + eta)
        true_x, self.x = self.x, seen
        self.commanded = self.command(f, G)
        self.u = self.moved(self.u, self.commanded)
        self.x = true_x
        self.k += 1


def fly(seed, noisy, kind, surface, at, share, frames):
    position = TYPES[kind][0](surface, at, share, 0.02)
    return RealPlant(seed, noisy, rate_hz=50.0, surface=surface, position=position).fly(frames, None)


@pytest.mark.parametrize("noisy", [False, True])
@settings(max_examples=samples(80), deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(list(TYPES)), surfaces, starts, shares)
def test_the_true_type_is_neither_excluded_nor_named_wrongly(noisy, seed, kind, surface, at, share):
    plant = fly(seed, noisy, kind, surface, at, share, 700)
    code = TYPES[kind][1]
    assert not plant.position_excluded(surface)
    assert not plant.fdi["types"]["surface"][surface]["sets"]["excluded"][code]
    said = fault_finding_dict(plant.fdi, SURFACES)
    assert said["isolated"] in (SURFACES[surface], None)
    assert said["isolation_type"] in (types.TYPE_NAMES[code], None)


@pytest.mark.parametrize("kind", HELD)
@settings(max_examples=samples(15), deadline=None)
@example(0, 1, 20, 30, 1.0)
@given(st.integers(0, 2**32), surfaces, starts, st.integers(11, 60), shares)
def test_a_release_anywhere_inside_a_block_excludes_neither_surface_nor_type(
    kind, seed, surface, at, lasting, share
):
    fault = Repaired(kind, surface, at, at + lasting, share, 0.02)
    plant = RealPlant(seed, True, rate_hz=50.0, surface=surface, position=fault, actuators="servo")
    fault.plant = plant
    plant.fly(at + lasting + 100, None)
    assert not plant.position_excluded(surface)
    assert not plant.fdi["types"]["surface"][surface]["sets"]["excluded"][fault.code]
