"""The other half of a scenario than `declared`: what flies, and what breaks in it. `plant/` knows no more."""

from dataclasses import dataclass
from typing import Self

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.scenario.airframe import Actuators, Environment, Initial, checked_against
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario, Uncertainty


@dataclass(frozen=True)
class Truth:
    """What is true of a flight. substeps: JSBSim steps in a frame. seed: of its random numbers."""

    aircraft: Aircraft
    rate_hz: float
    substeps: int
    initial: Initial
    uncertainty: Uncertainty
    actuators: Actuators
    environment: Environment
    seed: int

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """That of a scenario."""
        of = scenario
        return cls(
            of.airframe, of.rate_hz, of.substeps, of.initial, of.uncertainty, of.actuators, of.environment,
            of.seed,
        )  # fmt: skip

    @classmethod
    def as_declared(cls, declared: Declared) -> Self:
        """The one that the designer believes in: no errors, and still air."""
        of = declared
        with checked_against(of.aircraft):
            nothing = Uncertainty(), of.servos, Environment()
        return cls(of.aircraft, of.rate_hz, of.substeps, of.initial, *nothing, seed=1)
