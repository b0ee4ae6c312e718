"""A study as a command: one class has its options, what it flies, its words and the names of its files.

The command line makes a command of it: its fields are the options, its docstring is the help (first what the
command does, then `field: help` of each option), and `--format` is added. Nothing else is written for it but
its row in `commands.py`:

    @dataclass(frozen=True)
    class Losses(StudyCommand):
        \"\"\"Fly losses of each surface.

        Writes losses.json.

        airspeed: Airspeed, m/s.
        \"\"\"

        airspeed: AirspeedOption = 45.0
        out: Path = Path("runs")
        workers: WorkersOption = None

        FILES = ("losses.json",)

        def run(self, reporter): ...
        def as_text(self, document, colour): ...
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, ClassVar

import typer

from beaver_ftc.documents.files import Document


@dataclass(frozen=True)
class Reporter:
    """How a study reports while it runs. progress: takes the share that is done, 0 to 1. say: takes a line of
    text for standard error."""

    progress: Callable[[float], None] = lambda share: None
    say: Callable[[str], None] = lambda line: None


class StudyCommand(ABC):
    """What the command line runs: a frozen dataclass whose fields are the options.

    FILES: names of all that it may write into a result folder. A result folder is replaced only if it holds
    nothing but files that a command declares. PLUGINS: whether the user's own detectors and laws can fly
    (`--plugin`).
    """

    FILES: ClassVar[Collection[str]] = ()
    PLUGINS: ClassVar[bool] = True
    workers: int | None = None

    @abstractmethod
    def run(self, reporter: Reporter) -> Document:
        """Fly the study, write its files and return its document."""

    @abstractmethod
    def as_text(self, document: Document, colour: bool) -> str:
        """The document in words; colour: whether the terminal shows colours."""

    @property
    def label(self) -> str:
        """The words before the progress bar."""
        return type(self).__name__.lower()

    def passed(self, document: Document) -> bool:
        """Whether the command ends with exit status 0; with 1 if not."""
        return bool(document.get("passed", True))

    @property
    def processes(self) -> int:
        """The number of worker processes: as asked, else one a core."""
        from beaver_ftc.studies.engine.workers import cores

        return self.workers or cores()


def complete_names(incomplete: str) -> list[str]:
    """Built-in scenarios whose names begin so, for the shell."""
    from beaver_ftc.scenario.builtin import builtin_names

    return [name for name in builtin_names() if name.startswith(incomplete)]


SCENARIO = typer.Argument(
    metavar="SCENARIO", help="A file, or the name of a built-in scenario.", autocompletion=complete_names
)
ScenarioArgument = Annotated[str, SCENARIO]
WorkersOption = Annotated[int | None, typer.Option(min=1, max=1024, help="Processes; default: one a core.")]
AirspeedOption = Annotated[float | None, typer.Option(min=1, max=1000)]
AirspeedsOption = Annotated[list[float] | None, typer.Option(min=1, max=1000)]
AltitudeOption = Annotated[float | None, typer.Option(min=-300, max=30000)]
AltitudesOption = Annotated[list[float] | None, typer.Option(min=-300, max=30000)]
TurbulenceName = StrEnum("TurbulenceName", ["none", "light", "moderate"])


def listed(names: str) -> list[str]:
    """The names in a list with commas."""
    return [name.strip() for name in names.split(",") if name.strip()]
