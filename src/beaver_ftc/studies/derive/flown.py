"""States of an aircraft as it comes through them in flight: engines turn, the air lags, fuel burns.

Time stands still at the random states of sample.py, so they hold nothing of what changes by itself. Here the
aircraft flies from trim, its surfaces moved a little by sines.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.state import FlightState
from beaver_ftc.studies.derive.sample import Samples, as_arrays, seen_at

FLIGHTS, FRAMES, EVERY = 6, 800, 4
_SHARE_OF_TRAVEL = 0.06
_FREQUENCIES_HZ = (0.2, 0.5, 1.1)
_SPEEDS = (1.0, 1.0, 0.95, 1.05, 1.0, 1.0)  # as shares of the trim's


def fly_about(plant: Plant, trim: FlightState, seed: int, properties: Mapping[str, str]) -> Samples:
    """Some short flights from trim; `box` and `level` are not sorted yet."""
    rng, rows = np.random.default_rng(seed), []
    for share in _SPEEDS[:FLIGHTS]:
        started = replace(trim, airspeed_mps=share * trim.airspeed_mps)
        plant.start(started)
        phases = rng.uniform(0.0, 2.0 * np.pi, (plant.aircraft.n, len(_FREQUENCIES_HZ)))
        for k in range(FRAMES):
            if k % EVERY == 0:
                rows.append((*seen_at(plant, properties), 0, 0, 0))
            _move(plant, trim, phases, k * plant.dt_s)
            plant.run()
    plant.start(trim)
    return as_arrays(rows, tuple(properties))


def _move(plant: Plant, trim: FlightState, phases: np.ndarray, t_s: float) -> None:
    """Command the surfaces for one frame."""
    waves = np.sin(2.0 * np.pi * np.array(_FREQUENCIES_HZ) * t_s + phases).sum(axis=1)
    for (name, surface), wave in zip(plant.aircraft.surface.items(), waves, strict=True):
        travel = plant.aircraft.travel[name]
        reach = _SHARE_OF_TRAVEL * min(-travel.min_rad, travel.max_rad)
        there = trim.surfaces_rad[name] + reach * float(wave)
        plant.write(surface.command, float(np.clip(there, travel.min_rad, travel.max_rad)))


def sorted_in(
    samples: Samples, ends: Sequence[np.ndarray], aircraft: Aircraft, shares: Sequence[float]
) -> Samples:
    """Samples with the innermost box each is in, and its share of the travel; those in no box are left out.

    ends: of each box (2, 7 + declared), in the order of `places`.
    """
    where = places(samples, aircraft)
    inside = np.array([((where >= low) & (where <= high)).all(axis=1) for low, high in ends])
    travel = np.array([(t.min_rad, t.max_rad) for t in aircraft.travel.values()])
    used = np.maximum(samples.u / travel[:, 1], samples.u / travel[:, 0]).max(axis=1)
    level = np.searchsorted(np.array(shares[:-1]), used)
    kept = inside.any(axis=0)
    named = {name: values[kept] for name, values in samples.signals.items()}
    return Samples(
        samples.x[kept], samples.y[kept], named, samples.u[kept], samples.rate[kept],
        inside.argmax(axis=0)[kept], level[kept], samples.age[kept],
    )  # fmt: skip


def places(samples: Samples, aircraft: Aircraft) -> np.ndarray:
    """Rates, alpha, beta, airspeed, density, declared signals: (n, 7 + declared)."""
    y = samples.y
    declared = [samples.signals[name] for name in aircraft.signals]
    return np.column_stack([samples.x, y[:, :3], 2.0 * y[:, 3] / y[:, 2] ** 2, *declared])
