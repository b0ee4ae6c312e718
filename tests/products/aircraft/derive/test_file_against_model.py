"""What a file declares at a state, and the line said where its model exceeds it, on states made by hand."""

import numpy as np
import pytest

from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.plant import Plant
from beaver_ftc_aircraft.derive import first_use, fit
from kept import in_short

from .known import TRAINER, aircraft, moving, states


def test_declared_is_the_files_error_beside_what_every_scenario_adds():
    """0.02 rad/s2, a quarter of each product of the rates, and of the map the state's box and share."""
    plain = aircraft()
    samples, i = states(plain, n=60, signals=()), inertia_coefficients(plain.mass)
    p, q, r = np.abs(samples.x.T)
    every = 0.02 + 0.25 * np.abs(np.column_stack([i.Pqr * q * r, i.Qpr * p * r, i.Rpq * p * q]))
    error = np.array(plain.model_error_rad_s2)
    assert first_use._declared(plain, samples) == pytest.approx(every + error)
    error_map, _ = fit.map_of(plain, (moving(plain, samples, [0.001, 0.002, 0.003]),), samples)
    mapped = aircraft(model_error_map=error_map)
    boxes = [[box[f"error_{axis}_rad_s2"][0] for axis in "pqr"] for box in error_map["boxes"]]
    of_map = [
        [boxes[b][axis][level] for axis in range(3)]
        for b, level in zip(samples.box, samples.level, strict=True)
    ]
    assert first_use._declared(mapped, samples) == pytest.approx(every + np.array(of_map))


def test_states_are_drawn_over_the_envelope_from_engines_just_started(changed):
    trainer = read(TRAINER)
    samples = first_use._samples(trainer, Plant(100, aircraft=trainer))
    assert len(samples) == 800
    assert not samples.age.any()
    low, high = samples.y[:, 2].min(), samples.y[:, 2].max()
    assert (low, high) == pytest.approx(trainer.envelope.airspeed_mps, rel=1e-3)
    assert not changed(
        {name: in_short(getattr(samples, name)) for name in ("x", "y", "u", "rate", "box", "level")}
    )
