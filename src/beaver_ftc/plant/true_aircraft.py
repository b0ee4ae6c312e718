"""The truth of a scenario in JSBSim: its errors are written into the aircraft, it is trimmed, and the air
moves.

Turbulence and one-minus-cosine gusts are JSBSim's own models.
"""

from collections.abc import Sequence
from math import radians

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import KG_PER_LB
from beaver_ftc.design.turbulence import EXCEEDENCE, WIND_AT_20_FT
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import FT_PER_M, Plant
from beaver_ftc.plant.faults import NEVER
from beaver_ftc.plant.trim import TrimPoint, trim
from beaver_ftc.scenario.air import Gust
from beaver_ftc.scenario.instants import frame_of
from beaver_ftc.scenario.model_errors import Uncertainty
from beaver_ftc.scenario.truth import Truth

DELAY = "actuators/delay-s"
LB_PER_KG, IN_PER_M = 1.0 / KG_PER_LB, 12.0 * FT_PER_M

TUSTIN = 4  # JSBSim's Dryden turbulence in Tustin's form, whose spectrum does not depend on the frame
_LOCAL_FRAME = 3  # of atmosphere/cosine-gust/frame: north, east, down


def configure(plant: Plant, truth: Truth) -> None:
    """Write what is true; failures come later, in flight, and the air at take-off."""
    _uncertainty(plant, truth.uncertainty)
    _mass(plant, truth.uncertainty)
    _actuators(plant, truth)


def _set(plant: Plant, key: str, name: str, value: float, neutral: float = 0.0) -> None:
    """Write a property that stands for a scenario's key; an aircraft without it can only have it neutral."""
    if plant.has(name):
        plant.write(name, value)
    elif value != neutral:
        raise BadInput(f"{key}: {plant.aircraft.name} has no property {name}, allowed: {neutral:g}")


def _uncertainty(plant: Plant, uncertainty: Uncertainty) -> None:
    for axis in AXES:
        theta = getattr(uncertainty.inertia_coupling, axis)
        key, name = f"uncertainty.inertia_coupling.{axis}", f"uncertainty/inertia-coupling/{axis}"
        _set(plant, key, name, theta)
        sinusoid = getattr(uncertainty.sinusoid, axis)
        key, name = f"uncertainty.sinusoid.{axis}", f"uncertainty/sinusoid/{axis}"
        _set(plant, key, f"{name}-amplitude-rad_sec2", sinusoid.amplitude_rad_s2)
        if plant.has(f"{name}-frequency-rad_sec"):
            plant.write(f"{name}-frequency-rad_sec", sinusoid.frequency_rad_s)
    for name, ratio in uncertainty.coefficients.items():
        _set(plant, f"uncertainty.coefficients.{name}", f"uncertainty/{name}-scale", ratio, 1.0)


def _mass(plant: Plant, uncertainty: Uncertainty) -> None:
    """Mass and inertia by small masses about the centre of gravity, which moves against the aerodynamics."""
    mass = plant.aircraft.mass
    change = {axis: getattr(uncertainty.inertia, axis) - 1.0 for axis in ("Ix", "Iy", "Iz")}
    Ix, Iy, Iz = (change[axis] * getattr(mass, f"{axis}_kg_m2") for axis in change)
    pairs = [(Iy + Iz - Ix) / 2, (Iz + Ix - Iy) / 2, (Ix + Iy - Iz) / 2]  # kg m2 of the x, y and z pair
    extra_kg = mass.mass_kg * (uncertainty.mass - 1.0) if uncertainty.mass != 1.0 else 0.0
    masses_kg = [extra_kg - sum(pairs), *(pair / 2 for pair in pairs for _ in range(2))]  # at 1 m
    if any(masses_kg):
        for i, mass_kg in enumerate(masses_kg):
            weight = mass_kg * LB_PER_KG
            _set(plant, "uncertainty.mass", f"inertia/pointmass-weight-lbs[{i}]", weight)
    if any(uncertainty.cg_m):
        for axis, toward, sign in zip("xyz", uncertainty.cg_m, (1.0, -1.0, 1.0), strict=True):
            name = f"metrics/aero-rp-{axis}-in"  # aft, right, up
            plant.write(name, plant.read(name) + sign * toward * IN_PER_M)


def take_off(plant: Plant, truth: Truth, trim_point: TrimPoint) -> None:
    """Start the trimmed flight in the true air: JSBSim's own wind and turbulence [MIL-F-8785C]."""
    environment = truth.environment
    plant.forget_conditions()  # of the trim: whether it was computed or known must not show
    plant.start(trim_point, environment.wind_mps)
    if environment.severity is not None:
        plant.write("atmosphere/randomseed", 1 + truth.seed % (2**31 - 2))
        plant.write("atmosphere/turb-type", TUSTIN)
        plant.write(
            "atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps", WIND_AT_20_FT[environment.severity]
        )
        plant.write("atmosphere/turbulence/milspec/severity", EXCEEDENCE[environment.severity])


def _actuators(plant: Plant, truth: Truth) -> None:
    if plant.has(DELAY):
        plant.write(DELAY, 0.0)  # of servos as built: a scenario's have none
    for surface in plant.aircraft.surfaces:
        dynamics = getattr(truth.actuators, surface)
        off = getattr(truth.uncertainty.actuators, surface)
        plant.write(f"actuators/{surface}/bandwidth-rad_sec", off.bandwidth * dynamics.bandwidth_rad_s)
        rate_rad_s = off.rate_limit * radians(dynamics.rate_limit_deg_s)
        plant.write(f"actuators/{surface}/rate-limit-rad_sec", rate_rad_s)
        key, name = f"uncertainty.actuators.{surface}.dead_band_deg", f"actuators/{surface}/dead-band-rad"
        _set(plant, key, name, radians(off.dead_band_deg))
        if dynamics.travel_deg is not None:
            low, high = dynamics.travel_deg
            plant.write(f"actuators/{surface}/position-min-rad", radians(low))
            plant.write(f"actuators/{surface}/position-max-rad", radians(high))


def trim_of(truth: Truth, plant: Plant) -> TrimPoint:
    """The trim with the coefficient errors; BadInput when there is none."""
    initial, aircraft = truth.initial, plant.aircraft
    given = {name: getattr(initial, name) for name in aircraft.engine.settings}
    free = aircraft.left_by_trim
    given |= {f"{surface}_rad": radians(getattr(initial, f"{surface}_deg")) for surface in free}
    return trim(initial.airspeed_mps, initial.altitude_m, plant=plant, **given)


class GustSchedule:
    """Sets gusts off, one after the other; without any it does nothing."""

    def __init__(self, gusts: Sequence[Gust], plant: Plant, rate_hz: float) -> None:
        self._plant = plant
        self._starts = {frame_of(gust.at_s, rate_hz): gust for gust in gusts if any(gust.velocity_mps)}

    def apply(self, k: int) -> None:
        """Set the gust off that starts with frame k."""
        if k not in self._starts:
            return
        gust = self._starts[k]
        height = sum(speed**2 for speed in gust.velocity_mps) ** 0.5
        values = {
            "startup-duration-sec": gust.rise_s, "steady-duration-sec": gust.hold_s,
            "end-duration-sec": gust.fade_s, "magnitude-ft_sec": height * FT_PER_M, "frame": _LOCAL_FRAME,
        }  # fmt: skip
        values |= {f"{axis}-velocity-ft_sec": v for axis, v in zip("XYZ", gust.velocity_mps, strict=True)}
        for name, value in (values | {"start": 1.0}).items():
            self._plant.write(f"atmosphere/cosine-gust/{name}", value)

    def next_change(self, k: int) -> int:
        """The first frame after k at which `apply` has something to do."""
        return min((start for start in self._starts if start > k), default=NEVER)
