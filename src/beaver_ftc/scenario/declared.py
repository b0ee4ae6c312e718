"""What a scenario declares in `fdi.bounds`, and which parts of the diagnosis use it: one object, made once.

Detectors, warnings, studies and products ask `Declared`; none reads `fdi.bounds` for itself.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import radians
from typing import Any, NamedTuple, Self

import numpy as np

from beaver_ftc.aircraft import Aircraft, Term
from beaver_ftc.design.context import SIGNALS
from beaver_ftc.design.dryden import Dryden
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA, Sensors

# Of the mass, where accelerometers are compared with the designer's forces: fuel and load, which no key of
# `fdi.bounds` declares.
MASS_TOLERANCE = 0.05
PerAxis = tuple[float, float, float]


class Error(NamedTuple):
    """What is declared of one instrument, SI.

    noise: standard deviation of a sample's; steady: size of a constant error; slope: as a share. random:
    noise and rounding together, a standard deviation. worst: how far a reading of zero can be off.
    """

    noise: float
    steady: float
    resolution: float
    slope: float
    random: float
    worst: float

    def of_reading(self, largest: float) -> float:
        """How far a reading of at most `largest` can be off."""
        return (self.worst + self.slope * largest) / (1.0 - self.slope)


class SensorErrors(dict[str, Error]):
    """Those of all instruments, by their names in `sensors`."""

    def __init__(self, sensors: Sensors) -> None:
        super().__init__()
        self.declared = sensors
        for name, sensor in sensors:
            noise, bias, resolution = sensor.noise_bias_quantum
            worst, slope = NOISE_LIMIT_SIGMA * noise + abs(bias) + resolution / 2, abs(sensor.scale_error)
            self[name] = Error(noise, abs(bias), resolution, slope, sensor.random_error, worst)

    def each(self, of_it: str, names: Iterable[str] = SIGNALS) -> np.ndarray:
        """One number of several instruments, (n,)."""
        return np.array([getattr(self[name], of_it) for name in names])

    @property
    def is_ideal(self) -> bool:
        """Whether no error of any instrument is declared."""
        return self.declared.is_ideal

    def exceeded_by(self, sensors: Sensors) -> list[str]:
        """The instruments of a truth whose errors are not within the declared ones."""
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


_known: dict[int, SensorErrors] = {}  # each holds the section whose number it is found by
_MOST = 64


def _errors_of(sensors: Sensors) -> SensorErrors:
    """Those of a section. A flight asks several times, and flights of a sweep share what does not vary."""
    known = _known.get(id(sensors))
    if known is None:
        if len(_known) >= _MOST:
            _known.clear()
        known = _known[id(sensors)] = SensorErrors(sensors)
    return known


@dataclass(frozen=True)
class ActuatorErrors:
    """How far a surface may be from its actuator's model, rad."""

    deflection_rad: float


@dataclass(frozen=True)
class Declared:
    """What `fdi.bounds` declares of an aircraft, and who takes part in the diagnosis that relies on it.

    inertia: tolerance of each moment of inertia as a share. coupling: relative errors of Pqr, Qpr, Rpq;
    constant_rad_s2: unstructured angular acceleration by axis; both as published. vertical_wind_mps: the
    strongest steady one. uses_statistics: whether the statistical detector runs. compares_across: whether
    motion across a surface's column excludes it. monitors_sensors: whether the sensor monitor runs.
    """

    aircraft: Aircraft
    air: Dryden
    sensors: SensorErrors
    coefficients: CoefficientErrors
    actuators: ActuatorErrors
    inertia: float
    coupling: PerAxis
    constant_rad_s2: PerAxis
    vertical_wind_mps: float
    uses_statistics: bool = False
    compares_across: bool = False
    monitors_sensors: bool = False

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """As a scenario (a `schema.Scenario`, which imports what imports this) declares it."""
        fdi, broken = scenario.fdi, any(of_a_sensor(fault) for fault in scenario.faults)
        return cls.by(fdi, scenario.airframe, scenario.substeps, broken)

    @classmethod
    def by(cls, fdi: FdiConfig, aircraft: Aircraft, substeps: int = 1, sensor_fails: bool = False) -> Self:
        """As a diagnosis declares it; sensor_fails: whether the scenario breaks an instrument."""
        bounds = fdi.bounds
        return cls(
            aircraft,
            Dryden(bounds.turbulence),
            _errors_of(bounds.sensors),
            CoefficientErrors(bounds.coefficients),
            ActuatorErrors(radians(bounds.deflection_deg)),
            bounds.inertia,
            bounds.inertia_coupling.as_tuple(),
            bounds.constant_rad_s2.as_tuple(),
            bounds.vertical_wind_mps,
            uses_statistics=fdi.weighs_chance,
            compares_across=fdi.compares_across(substeps),
            monitors_sensors=fdi.monitors_sensors(sensor_fails),
        )

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
