"""The command `matrix`: every fault type on every surface, or elevator and flap lost at once."""

from dataclasses import dataclass
from pathlib import Path

from beaver_ftc.aircraft import DEFAULT
from beaver_ftc.commands import (
    AirspeedsOption,
    Document,
    Reporter,
    StudyCommand,
    TurbulenceName,
    WorkersOption,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.engine.study import run_into
from beaver_ftc.studies.matrix import fault_matrix, matrix_shown
from beaver_ftc.studies.matrix import pitch_lost as lost


@dataclass(frozen=True)
class Matrix(StudyCommand):
    """Fly every fault type on every surface.

    The command reports which faults are detected and which are named. It also reports the tracking error,
    divided by the tracking error of the informed law. The informed law receives the true fault. With
    --declared the command also reports how many faults the informed test detects, and how many of those the
    diagnosis names. The informed test receives the true fault, too.

    The exit status is 1 if a fault is named wrongly or an alarm is false. With --pitch-lost, the exit status
    is 1 if an aircraft is lost with control by engine power, but not without this control.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc matrix --airspeed 45
      beaver-ftc matrix --declared --turbulence light --airspeed 45

    out: Folder for the results.
    airspeed: Airspeed, m/s. Default: 38, 45 and 52 for the Beaver, otherwise shares of the airspeed at
    the start.
    pitch_lost: Instead, fail elevator and flap together, with and without control by engine power.
    declared: Simulate and declare tactical-grade sensors, servos and, if possible, coefficient errors of
    5 %.
    turbulence: With --declared: severity of the turbulence, simulated and declared.
    aircraft: Aircraft: built-in name, jsbsim:NAME, or ./FOLDER. Default: beaver.
    """

    out: Path = Path("runs")
    airspeed: AirspeedsOption = None
    workers: WorkersOption = None
    pitch_lost: bool = False
    declared: bool = False
    turbulence: TurbulenceName = TurbulenceName.none
    aircraft: str | None = None

    FILES = (*matrix_shown.FILES, *lost.FILES)

    @property
    def label(self) -> str:
        """The words before the progress bar."""
        return "faults flown"

    def run(self, reporter: Reporter) -> Document:
        """Fly the faults, or the pairs of faults."""
        self._check()
        speeds_mps = tuple(self.airspeed) if self.airspeed else None
        reporter.progress(0.0)
        if self.pitch_lost:
            study = lost.pitch_lost_study(speeds_mps)
        else:
            aircraft = self.aircraft or DEFAULT
            study = fault_matrix.matrix_study(speeds_mps, self.declared, aircraft, self.turbulence.value)
        return run_into(study, self.out, self.processes, reporter.progress)

    def _check(self) -> None:
        """Raise BadInput for options that exclude each other."""
        if self.pitch_lost and self.declared:
            raise BadInput("--pitch-lost and --declared exclude each other, allowed: one of them")
        if self.pitch_lost and self.aircraft:
            raise BadInput(
                "--pitch-lost needs a flap and engine power in place of the elevator: the built-in aircraft "
                "has these, allowed: without --aircraft"
            )
        if self.turbulence is not TurbulenceName.none and not self.declared:
            raise BadInput("--turbulence is only flown where it is declared, allowed: with --declared")

    def as_text(self, document: Document, colour: bool) -> str:
        """Table, remarks and totals, and the folder of the files."""
        shown = lost.as_text if self.pitch_lost else matrix_shown.as_text
        return f"{shown(document)}\n\nresults: {document['folder']}"
