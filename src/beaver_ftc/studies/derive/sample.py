"""States of an aircraft over its envelope, and the angular accelerations JSBSim has there."""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.plant.adapter import PA_PER_PSF, Plant
from beaver_ftc.plant.state import FlightState

_LOOKED_UP = ("alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s")
FT = 0.3048


@dataclass(frozen=True)
class Envelope:
    """Where to sample: low and high ends. surface_share: of the travel, about the trim."""

    airspeed_mps: tuple[float, float]
    alpha_rad: tuple[float, float]
    altitude_m: float
    beta_rad: float = 0.10
    rates_rad_s: tuple[float, float, float] = (0.30, 0.20, 0.20)
    surface_share: float = 1.0


@dataclass(frozen=True)
class Samples:
    """x (n, 3) rad/s, y (n, 4 + declared): alpha, beta, V, qdyn and declared signals, u (n, surfaces) rad,
    rate (n, 3) rad/s2."""

    x: np.ndarray
    y: np.ndarray
    u: np.ndarray
    rate: np.ndarray


def sample(plant: Plant, envelope: Envelope, trim: FlightState, n: int, seed: int) -> Samples:
    """So many random states, time standing still at each. The engines' setting is that of the trim."""
    rng, rows = np.random.default_rng(seed), []
    aircraft = plant.aircraft
    plant.start(trim)
    for _ in range(n):
        rows.append(_at(plant, _random_state(rng, envelope, trim, aircraft)))
    x, y, u, rate = (np.array(column) for column in zip(*rows, strict=True))
    return Samples(x, y, u, rate)


def _random_state(
    rng: np.random.Generator, envelope: Envelope, trim: FlightState, aircraft: Aircraft
) -> FlightState:
    half = np.array([envelope.beta_rad, *envelope.rates_rad_s])
    alpha = rng.uniform(*envelope.alpha_rad)
    values = dict(zip(_LOOKED_UP, (alpha, *rng.uniform(-half, half)), strict=True))
    surfaces = {}
    for name, travel in aircraft.travel.items():
        reach = envelope.surface_share * 0.5 * (travel.max_rad - travel.min_rad)
        deflection = trim.surfaces_rad[name] + rng.uniform(-reach, reach)
        surfaces[name] = float(np.clip(deflection, travel.min_rad, travel.max_rad))
    V = rng.uniform(*envelope.airspeed_mps)
    theta = trim.theta_rad - trim.alpha_rad + alpha
    return FlightState(
        V, envelope.altitude_m, theta_rad=theta, surfaces_rad=surfaces, settings=trim.settings, **values
    )


def _at(plant: Plant, state: FlightState) -> tuple[list[float], list[float], list[float], list[float]]:
    plant.start(state)
    read = plant.read
    x = [read(f"velocities/{axis}-rad_sec") for axis in "pqr"]
    flow = [read("aero/alpha-rad"), read("aero/beta-rad"), read("velocities/vt-fps") * FT]
    u = [read(surface.effective) for surface in plant.aircraft.surface.values()]
    rate = [read(f"accelerations/{axis}dot-rad_sec2") for axis in "pqr"]
    declared = [read(signal.property) for signal in plant.aircraft.signals.values()]
    return x, [*flow, read("aero/qbar-psf") * PA_PER_PSF, *declared], u, rate
