"""A scenario or a sweep that a plan of evidence flies."""

import contextlib
import hashlib
from dataclasses import dataclass
from functools import cached_property

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents import (
    BadInput,
)
from beaver_ftc.plant import digest_of_aircraft
from beaver_ftc.scenario import (
    Scenario,
    Sweep,
)
from beaver_ftc.studies.sweep import Assignment, Plan, flight_name, scenario_of


@dataclass(frozen=True)
class Source:
    """A scenario or a sweep (`content`) that a plan flies. given: its name or path in the plan."""

    name: str
    given: str
    content: Scenario | Sweep

    @property
    def flights(self) -> int:
        """Number of its flights."""
        return self.content.flights if isinstance(self.content, Sweep) else 1

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft of all its flights."""
        return self.content.aircraft if isinstance(self.content, Sweep) else self.content.airframe

    def assignment(self, run: int) -> Assignment | None:
        """The varied values of one flight of a sweep; None for a scenario."""
        return Plan(self.content).assignments([run])[0] if isinstance(self.content, Sweep) else None

    def flight(self, run: int) -> str:
        """The name of one flight."""
        return flight_name(self.content, run) if isinstance(self.content, Sweep) else self.name

    def scenario(self, run: int) -> Scenario:
        """The scenario of one flight. Raises BadInput if the varied values contradict each other."""
        if not isinstance(self.content, Sweep):
            return self.content
        assigned = self.assignment(run)
        assert assigned is not None
        return scenario_of(self.content, assigned)

    @property
    def base(self) -> Scenario:
        """The scenario of all its flights, without the variations."""
        return self.content.scenario({}) if isinstance(self.content, Sweep) else self.content

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
        aircraft = digest_of_aircraft(self.aircraft.folder)
        left_out = {"description", "expect"}
        if isinstance(self.content, Sweep):
            file = self.content.file.model_dump(mode="json", exclude=left_out | {"base", "set"})
            text = repr([aircraft, self.content.base, file])
        else:
            text = repr([aircraft, self.content.model_dump(mode="json", exclude=left_out)])
        return hashlib.sha256(text.encode()).hexdigest()
