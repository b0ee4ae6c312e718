"""A scenario or a sweep that a plan of evidence flies."""

import contextlib
import hashlib
from dataclasses import dataclass
from functools import cached_property

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents import (
    BadInput,
)
from beaver_ftc.scenario import (
    Scenario,
    Sweep,
)
from beaver_ftc.studies.engine import digest_of_aircraft
from beaver_ftc.studies.sweep import Assignment, Plan, flight_name, scenario_of


@dataclass(frozen=True)
class Source:
    """A scenario or a sweep (`what`) that a plan flies. given: its name or path in the plan."""

    name: str
    given: str
    what: Scenario | Sweep

    @property
    def flights(self) -> int:
        """Number of its flights."""
        return self.what.flights if isinstance(self.what, Sweep) else 1

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft of all its flights."""
        return self.what.aircraft if isinstance(self.what, Sweep) else self.what.airframe

    def assignment(self, run: int) -> Assignment | None:
        """The varied values of one flight of a sweep; None for a scenario."""
        return Plan(self.what).assignments([run])[0] if isinstance(self.what, Sweep) else None

    def flight(self, run: int) -> str:
        """The name of one flight."""
        return flight_name(self.what, run) if isinstance(self.what, Sweep) else self.name

    def scenario(self, run: int) -> Scenario:
        """The scenario of one flight. Raises BadInput if the varied values contradict each other."""
        if not isinstance(self.what, Sweep):
            return self.what
        assigned = self.assignment(run)
        assert assigned is not None
        return scenario_of(self.what, assigned)

    @property
    def base(self) -> Scenario:
        """The scenario of all its flights, without the variations."""
        return self.what.scenario({}) if isinstance(self.what, Sweep) else self.what

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
        """SHA-256 of the resolved scenario or sweep without description and expectations, and of the files of
        its aircraft."""
        aircraft = digest_of_aircraft(self.aircraft.folder)
        left_out = {"description", "expect"}
        if isinstance(self.what, Sweep):
            file = self.what.file.model_dump(mode="json", exclude=left_out | {"base", "set"})
            text = repr([aircraft, self.what.base, file])
        else:
            text = repr([aircraft, self.what.model_dump(mode="json", exclude=left_out)])
        return hashlib.sha256(text.encode()).hexdigest()
