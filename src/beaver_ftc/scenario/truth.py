"""The other half of a scenario than `declared`, as far as the plant is configured from it. Faults and errors
of instruments are true as well: the loop hands them to their schedules."""

from dataclasses import dataclass
from typing import Self

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.scenario.actuators import Actuators
from beaver_ftc.scenario.air import Environment
from beaver_ftc.scenario.airframe import Initial, checked_against
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.model_errors import Uncertainty
from beaver_ftc.scenario.schema import Scenario


@dataclass(frozen=True)
class Truth:
    """What is true of an aircraft, its start and the air. substeps: JSBSim steps in a frame. seed: of the
    random numbers of the air."""

    aircraft: Aircraft
    rate_hz: float
    substeps: int
    initial: Initial
    uncertainty: Uncertainty
    actuators: Actuators
    environment: Environment
    seed: int = 1

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """That of a scenario."""
        return cls(
            aircraft=scenario.airframe,
            rate_hz=scenario.rate_hz,
            substeps=scenario.substeps,
            initial=scenario.initial,
            uncertainty=scenario.uncertainty,
            actuators=scenario.actuators,
            environment=scenario.environment,
            seed=scenario.seed,
        )

    @classmethod
    def as_declared(cls, declared: Declared) -> Self:
        """The one that the designer believes in: no errors, and still air."""
        with checked_against(declared.aircraft):
            return cls(
                aircraft=declared.aircraft,
                rate_hz=declared.rate_hz,
                substeps=declared.substeps,
                initial=declared.initial,
                uncertainty=Uncertainty(),
                actuators=declared.servos,
                environment=Environment(),
            )
