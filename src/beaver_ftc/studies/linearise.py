"""The command `linearise`: margins of the closed loop, and handling qualities of the aircraft alone."""

from dataclasses import asdict, dataclass
from typing import Annotated

import typer

from beaver_ftc.commands import Document, Reporter, StudyCommand
from beaver_ftc.scenario.schema import load
from beaver_ftc.studies import handling, margins
from beaver_ftc.studies.present.tables import all_finite


@dataclass(frozen=True)
class Linearise(StudyCommand):
    """Linearise the closed loop and print its margins.

    The loop contains the aircraft, the actuators, the lag and delay of the sensors, and the default law at
    its frame rate. The command opens the loop at each surface in turn, at several airspeeds of the envelope.
    It prints the margins of the healthy aircraft, and the margins after losses of effectiveness of each
    surface. After a loss, the law uses the true effectiveness.

    The command also prints the handling qualities of the aircraft alone: short period, phugoid, Dutch roll,
    roll and spiral mode. For each mode it prints the level of MIL-F-8785C. If the scenario has a fault, the
    command also prints the handling qualities at the end of the flight.

    Examples:
      beaver-ftc linearise elevator-loss-in-turbulence

    scenario: Scenario file or built-in name from which sensors, actuators and law are read.
    """

    scenario: Annotated[str | None, typer.Argument(metavar="SCENARIO")] = None

    def run(self, reporter: Reporter) -> Document:
        """The margins and the handling qualities over the airspeeds."""
        scenario = load({} if self.scenario is None else self.scenario)
        required = scenario.control.gain_margin_db, scenario.control.phase_margin_deg
        document = margins.as_document(margins.over_airspeeds(scenario), required)
        return document | {
            "handling": [all_finite(asdict(quality)) for quality in handling.over_airspeeds(scenario)]
        }

    def as_text(self, document: Document, colour: bool) -> str:
        """A line for each fault and surface, then a line for each flight condition."""
        return f"{margins.as_text(document)}\n\n{handling.as_text(document['handling'])}"
