"""The declared half of a scenario: all that the diagnosis, laws, studies and products may use of it.

None of them reads `fdi.bounds` itself. `Declared` also says which parts of the diagnosis run.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import radians
from typing import Any, NamedTuple, Self

import numpy as np

from beaver_ftc.aircraft import Aircraft, MassProperties, Term
from beaver_ftc.design.turbulence import Dryden
from beaver_ftc.scenario.actuators import Actuators
from beaver_ftc.scenario.airframe import Initial
from beaver_ftc.scenario.autopilot import Autopilot
from beaver_ftc.scenario.diagnosis import ActuatorBounds, ControlConfig, FdiConfig
from beaver_ftc.scenario.kept import KeptBySections
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA, SIGNALS, Sensors

# Relative error of the mass (fuel and load) that is assumed where accelerometers are compared with the forces
# of the design model. No key of `fdi.bounds` declares it.
MASS_TOLERANCE = 0.05
PerAxis = tuple[float, float, float]


class Error(NamedTuple):
    """Declared errors of one instrument, SI.

    noise: standard deviation of a sample. steady: size of the constant error. resolution: step of the
    readings. slope: relative error of the scale. random: standard deviation of noise and rounding together.
    worst: largest error of a reading of zero.
    """

    noise: float
    steady: float
    resolution: float
    slope: float
    random: float
    worst: float

    def of_reading(self, largest: float) -> float:
        """Largest error of a reading whose size is at most `largest`."""
        return (self.worst + self.slope * largest) / (1.0 - self.slope)


class SensorErrors(dict[str, Error]):
    """Declared errors of all instruments, by their names in the section `sensors`."""

    def __init__(self, sensors: Sensors) -> None:
        super().__init__()
        self.declared = sensors
        for name, sensor in sensors:
            noise, bias, resolution = sensor.noise_bias_quantum
            worst = NOISE_LIMIT_SIGMA * noise + abs(bias) + resolution / 2
            slope = abs(sensor.scale_error)
            self[name] = Error(noise, abs(bias), resolution, slope, sensor.random_error, worst)

    def each(self, of_it: str, names: Iterable[str] = SIGNALS) -> np.ndarray:
        """One number of several instruments, (n,)."""
        return np.array([getattr(self[name], of_it) for name in names])

    @property
    def is_ideal(self) -> bool:
        """Whether no error of any instrument is declared."""
        return self.declared.is_ideal

    def exceeded_by(self, sensors: Sensors) -> list[str]:
        """The instruments of the true `sensors` whose errors are not within the declared ones."""
        return [
            name
            for name, sensor in sensors
            if not (sensor.is_ideal or sensor.is_within(getattr(self.declared, name)))
        ]


@dataclass(frozen=True)
class CoefficientErrors:
    """Tolerance of the aerodynamic coefficients: one share for all moment coefficients, or one for each."""

    share: float | Mapping[str, float]

    def of(self, name: str) -> float:
        """Share of a moment coefficient."""
        return self.share.get(name, 0.0) if isinstance(self.share, Mapping) else self.share

    @property
    def largest(self) -> float:
        """The largest share, which those of the forces are taken to have."""
        return max(self.share.values(), default=0.0) if isinstance(self.share, Mapping) else self.share

    def absolute(self, terms: Sequence[Term], values: np.ndarray) -> np.ndarray:
        """Tolerance of each of so many terms, absolute; values: the designer's."""
        return np.array([self.of(term.name) for term in terms]) * np.abs(values[: len(terms)])


_sensor_errors: KeptBySections[SensorErrors] = KeptBySections(64)


def _errors_of(sensors: Sensors) -> SensorErrors:
    """The errors in a section, kept: a flight reads them several times, and flights of a sweep share them."""
    return _sensor_errors.get((sensors,), lambda: SensorErrors(sensors))


@dataclass(frozen=True)
class Declared:
    """The declared half of a scenario: all that diagnosis, laws, supervisor and autopilots are configured
    from. The other half is the truth, of which they receive readings.

    initial: what a pilot reads at the start. servos, instruments: the actuators and sensors as the designer
    knows them. name: of the scenario, for messages.
    """

    name: str
    aircraft: Aircraft
    rate_hz: float
    substeps: int
    initial: Initial
    autopilot: Autopilot | None
    fdi: FdiConfig
    control: ControlConfig
    design_model: Any  # a `model_errors.DesignModel`
    servos: Actuators
    instruments: Sensors

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """That of a `schema.Scenario`."""
        return cls(
            scenario.name,
            scenario.airframe,
            scenario.rate_hz,
            scenario.substeps,
            scenario.initial,
            scenario.autopilot,
            scenario.fdi,
            scenario.control,
            scenario.design_model,
            scenario.known_actuators,
            scenario.known_sensors,
        )

    @cached_property
    def scale(self) -> dict[str, float]:
        """What the designer multiplies terms of the aircraft's file by, by name. Without engine terms, 0 for
        each moment of a declared signal: of the slipstream, as published."""
        scale = dict(self.design_model.coefficients)
        for term in self.aircraft.moments:
            if not self.design_model.engine_terms and self.aircraft.signals.keys() & dict(term.of):
                scale[term.name] = 0.0
        return scale

    @cached_property
    def terms(self) -> dict[str, float]:
        """The designer's value of each term of the aircraft's file, by name."""
        return {name: t.value * self.scale.get(name, 1.0) for name, t in self.aircraft.terms.items()}

    @cached_property
    def mass(self) -> MassProperties:
        """The designer's mass and inertia. A heavier aircraft of the same shape has its inertia in
        proportion."""
        of_file, times, inertia = self.aircraft.mass, self.design_model.mass, {}
        for name, ratio in self.design_model.inertia:
            inertia[f"{name}_kg_m2"] = getattr(of_file, f"{name}_kg_m2") * times * ratio
        return replace(of_file, mass_kg=of_file.mass_kg * times, **inertia)

    @property
    def travel_rad(self) -> np.ndarray:
        """Lower and upper stop of each surface, (2, surfaces) rad, as the designer knows them."""
        of_file = self.aircraft.file.surfaces
        stops = (
            of_file[surface].travel_rad if servo.travel_deg is None else map(radians, servo.travel_deg)
            for surface, servo in ((name, getattr(self.servos, name)) for name in self.aircraft.surfaces)
        )
        return np.array([tuple(each) for each in stops]).T.copy()

    @property
    def air(self) -> Dryden:
        """The strongest turbulence."""
        return Dryden(self.fdi.bounds.turbulence)

    @property
    def sensors(self) -> SensorErrors:
        """The largest errors of the instruments."""
        return _errors_of(self.fdi.bounds.sensors)

    @property
    def coefficients(self) -> CoefficientErrors:
        """Tolerance of the moment coefficients."""
        return CoefficientErrors(self.fdi.bounds.coefficients)

    @property
    def servo_errors(self) -> ActuatorBounds:
        """The largest errors of the actuators."""
        return self.fdi.bounds.actuators

    @property
    def deflection_rad(self) -> float:
        """Largest distance, rad, of a surface from the position of its actuator."""
        return radians(self.fdi.bounds.deflection_deg)

    @property
    def deflections_rad(self) -> np.ndarray:
        """Largest distance of each surface from the position of its actuator's model at rest, with the dead
        band, (surfaces,) rad."""
        bands = [getattr(self.servo_errors, name).dead_band_deg for name in self.aircraft.surfaces]
        return self.deflection_rad + np.radians(bands)

    @property
    def inertia(self) -> float:
        """Tolerance of each moment of inertia, as a share."""
        return self.fdi.bounds.inertia

    @property
    def coupling(self) -> PerAxis:
        """Largest relative errors of Pqr, Qpr, Rpq, as published."""
        return self.fdi.bounds.inertia_coupling.as_tuple()

    @property
    def constant_rad_s2(self) -> PerAxis:
        """Largest unstructured angular acceleration by axis, as published."""
        return self.fdi.bounds.constant_rad_s2.as_tuple()

    @property
    def vertical_wind_mps(self) -> float:
        """The strongest steady vertical wind."""
        return self.fdi.bounds.vertical_wind_mps

    @property
    def uses_statistics(self) -> bool:
        """Whether the statistical detector runs."""
        return self.fdi.weighs_chance

    @property
    def compares_across(self) -> bool:
        """Whether motion across a surface's column excludes it."""
        return self.fdi.compares_across(self.substeps)

    @property
    def monitors_sensors(self) -> bool:
        """Whether the sensor monitor runs."""
        return self.fdi.monitors_sensors

    @property
    def is_noise_free(self) -> bool:
        """Whether neither errors of instruments nor turbulence are declared."""
        return self.sensors.is_ideal and not self.air.moves

    @property
    def uses_accelerometers(self) -> bool:
        """Whether accelerometers are compared with the designer's forces, which separate surfaces that the
        rates alone do not."""
        return self.uses_statistics and self.compares_across and self.aircraft.forces_separate_surfaces

    @property
    def follows_gusts_by_forces(self) -> bool:
        """Whether the vanes show a gust beside the forces of the design model."""
        return self.uses_statistics and self.air.moves and bool(self.aircraft.measurable_forces)

    @property
    def follows_gusts_by_accelerometers(self) -> bool:
        """Whether accelerometers stand in for forces that the design model lacks.

        Not where the sensor monitor may find them broken, and only of aircraft whose damage takes surfaces:
        light ones, whose law answers the rest of a gust, alarmed in 3 of 34 and 4 of 30 healthy flights.
        """
        unknown = self.aircraft.loses_surfaces and not self.aircraft.measurable_forces
        return self.uses_statistics and self.air.moves and unknown and not self.monitors_sensors
