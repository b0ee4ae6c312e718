"""Writes what a scenario says of the truth into the aircraft's properties, and trims it there."""

from math import radians

from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.errors import BadInput
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import TrimPoint, trim
from beaver_ftc.scenario.schema import Scenario

_AXES = ("p", "q", "r")


def configure(plant: Plant, scenario: Scenario) -> None:
    """Declare the scenario's truth; failures come later, in flight."""
    _refuse_what_is_missing(scenario)
    _uncertainty(plant, scenario)
    _actuators(plant, scenario)


def _refuse_what_is_missing(scenario: Scenario) -> None:
    """Nothing in a scenario is silently skipped: what the truth cannot do yet is refused by name."""
    if not scenario.sensors.is_ideal:
        raise BadInput(f"{scenario.name}: sensors: measurement errors are not available yet, allowed: ideal")
    if scenario.environment.turbulence != "none" or any(scenario.environment.wind_mps):
        raise BadInput(
            f"{scenario.name}: environment: wind and turbulence are not available yet, allowed: still air"
        )


def _uncertainty(plant: Plant, scenario: Scenario) -> None:
    uncertainty = scenario.uncertainty
    for axis in _AXES:
        plant.write(f"uncertainty/inertia-coupling/{axis}", getattr(uncertainty.inertia_coupling, axis))
        sinusoid = getattr(uncertainty.sinusoid, axis)
        plant.write(f"uncertainty/sinusoid/{axis}-amplitude-rad_sec2", sinusoid.amplitude_rad_s2)
        plant.write(f"uncertainty/sinusoid/{axis}-frequency-rad_sec", sinusoid.frequency_rad_s)
    for name, ratio in uncertainty.coefficients.items():
        plant.write(f"uncertainty/{name}-scale", ratio)


def _actuators(plant: Plant, scenario: Scenario) -> None:
    for surface in SURFACES:
        dynamics = getattr(scenario.actuators, surface)
        plant.write(f"actuators/{surface}/bandwidth-rad_sec", dynamics.bandwidth_rad_s)
        plant.write(f"actuators/{surface}/rate-limit-rad_sec", radians(dynamics.rate_limit_deg_s))
        if dynamics.travel_deg is not None:
            low, high = dynamics.travel_deg
            plant.write(f"actuators/{surface}/position-min-rad", radians(low))
            plant.write(f"actuators/{surface}/position-max-rad", radians(high))


def trim_of(scenario: Scenario, plant: Plant) -> TrimPoint:
    """The scenario's trim, on its truth with the coefficient errors; BadInput when there is none."""
    initial = scenario.initial
    return trim(
        initial.airspeed_mps,
        initial.altitude_m,
        engine_rpm=initial.engine_rpm,
        manifold_pressure_inhg=initial.manifold_pressure_inhg,
        flap_rad=radians(initial.flap_deg),
        plant=plant,
    )
