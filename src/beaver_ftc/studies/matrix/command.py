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
from beaver_ftc.studies.matrix import fault_matrix
from beaver_ftc.studies.matrix import pitch_lost as lost


@dataclass(frozen=True)
class Matrix(StudyCommand):
    """Fly every fault type on every surface.

    Reports which faults are detected and named, and the tracking error relative to the informed law, which
    knows the fault. With --declared it also reports how many of the faults that the informed test detects are
    named.

    Exit status 1 if a fault is named wrongly or an alarm is false; with --pitch-lost, if an aircraft is lost
    with engine power but kept without it.

    The same command resumes an interrupted run.

    out: Folder for the results: `fault-matrix` or `pitch-lost` in it.
    airspeed: Airspeed, m/s. Repeat the option for several.
    pitch_lost: Instead, lose elevator and flap together, with and without control by engine power.
    declared: Simulate tactical-grade sensors, servos and, where the model allows it, 5 % wrong moment
      coefficients, and declare them to the diagnosis.
    turbulence: Turbulence to simulate and to declare to the diagnosis (with --declared).
    aircraft: Built-in name, jsbsim:NAME, or ./FOLDER in the working directory.
    """

    out: Path = Path("runs")
    airspeed: AirspeedsOption = None
    workers: WorkersOption = None
    pitch_lost: bool = False
    declared: bool = False
    turbulence: TurbulenceName = TurbulenceName.none
    aircraft: str | None = None

    FILES = (*fault_matrix.FILES, *lost.FILES)

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
            name = lost.NAME
            document = lost.run_pitch_lost(self.out, speeds_mps, self.processes, reporter.progress)
        else:
            name = fault_matrix.name_of(self.declared, self.turbulence)
            document = fault_matrix.run_matrix(
                self.out, speeds_mps, self.processes, reporter.progress, self.declared,
                self.aircraft or DEFAULT, self.turbulence.value,
            )  # fmt: skip
        return document | {"folder": str(self.out / name)}

    def _check(self) -> None:
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
        """Table, remarks and totals, and where the files are."""
        shown = lost.as_text if self.pitch_lost else fault_matrix.as_text
        return f"{shown(document)}\n\nresults: {document['folder']}"
