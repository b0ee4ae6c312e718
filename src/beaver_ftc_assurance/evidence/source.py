"""A scenario or a sweep that a plan of evidence flies."""

import contextlib
import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents import BadInput
from beaver_ftc.plant import digest_of_aircraft
from beaver_ftc.scenario import Scenario, Sweep
from beaver_ftc.studies.sweep import Assignment, Plan, flight_name, scenario_of

_NOT_DIGESTED = {"description", "expect"}


@dataclass(frozen=True)
class Source:
    """A scenario (`content`) that a plan flies once. given: its name or path in the plan."""

    given: str
    content: Any
    is_sweep = False

    @property
    def name(self) -> str:
        """Name of the scenario or sweep."""
        return str(self.content.name)

    @property
    def flights(self) -> int:
        """Number of its flights."""
        return 1

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft of all its flights."""
        return self.base.airframe

    def assignment(self, run: int) -> Assignment | None:
        """The varied values of one flight of a sweep; None for a scenario."""
        return None

    def flight(self, run: int) -> str:
        """The name of one flight."""
        return self.name

    def scenario(self, run: int) -> Scenario:
        """The scenario of one flight. Raises BadInput if the varied values contradict each other."""
        return self.base

    @property
    def base(self) -> Scenario:
        """The scenario of all its flights, without the variations."""
        return self.content

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The columns of its logs; none if it cannot fly, which the row of the flight reports."""
        from beaver_ftc.loop import Loop

        with contextlib.suppress(BadInput):
            loop = Loop(self.base)
            loop.release()
            return loop.columns
        return ()

    @property
    def sha256(self) -> str:
        """SHA-256 of the files of its aircraft and of the content: a resolved scenario without description
        and expectations, or a sweep without these, with its base as it is written."""
        text = repr([digest_of_aircraft(self.aircraft.folder), *self._digested])
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def _digested(self) -> list[Any]:
        """The content for `sha256`."""
        return [self.content.model_dump(mode="json", exclude=_NOT_DIGESTED)]


class SweepSource(Source):
    """A sweep (`content`) that a plan flies."""

    content: Sweep
    is_sweep = True

    @property
    def flights(self) -> int:
        return self.content.flights

    @property
    def aircraft(self) -> Aircraft:
        return self.content.aircraft

    def assignment(self, run: int) -> Assignment:
        return Plan(self.content).assignments([run])[0]

    def flight(self, run: int) -> str:
        return flight_name(self.content, run)

    def scenario(self, run: int) -> Scenario:
        return scenario_of(self.content, self.assignment(run))

    @property
    def base(self) -> Scenario:
        return self.content.scenario({})

    @property
    def _digested(self) -> list[Any]:
        file = self.content.file.model_dump(mode="json", exclude=_NOT_DIGESTED | {"base", "set"})
        return [self.content.base, file]
