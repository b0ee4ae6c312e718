"""Which commands there are, a row each by name, and what a study as a command must have.

    [project.entry-points."beaver_ftc.commands"]         # in the pyproject.toml of another package
    "class grade" = "my_package.grading:Grade"
    [project.entry-points."beaver_ftc.command_groups"]   # a class whose docstring says what they are for
    class = "my_package.grading:Group"

A row names a study (a `StudyCommand`) or a function whose parameters are the options. It is imported when
the command is called. Its docstring is its help; the first line of it is read from the source, so that
`--help` answers at once.

A study is one class: it has its options, what it flies, its words and the names of its files. The command
line makes a command of it: its fields are the options, its docstring is the help (first what the command
does, then `field: help` of each option), and `--format` is added. Nothing else is written for it but its
row:

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

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from beaver_ftc.documents.files import Document
from beaver_ftc.plugins import entries, loaded, required

__all__ = [
    "COMMANDS", "FORMER", "GROUP", "GROUPS", "Reporter", "ScenarioArgument", "StudyCommand", "WorkersOption",
    "declare", "files_of_commands", "groups", "registered", "summary",
]  # fmt: skip

GROUP, GROUPS = "beaver_ftc.commands", "beaver_ftc.command_groups"
COMMANDS = {
    "run": "beaver_ftc.cli.run:command",
    "mismatch": "beaver_ftc.cli.mismatch:command",
    "validate": "beaver_ftc.cli.scenarios:validate",
    "schema": "beaver_ftc.cli.catalogue:schema",
    "trim": "beaver_ftc.cli.trim:command",
    "linearise": "beaver_ftc.studies.linearise:Linearise",
    "list": "beaver_ftc.cli.catalogue:list_choices",
    "show": "beaver_ftc.cli.catalogue:show",
    "new": "beaver_ftc.cli.scenarios:new",
    "sweep": "beaver_ftc.cli.sweep:command",
    "compare": "beaver_ftc.cli.compare:command",
    "reproduce": "beaver_ftc.studies.reproduce.reproduction:Reproduce",
    "matrix": "beaver_ftc.studies.matrix.command:Matrix",
    "sensitivity": "beaver_ftc.studies.sensitivity.command:Sensitivity",
    "bench": "beaver_ftc.studies.bench.measure:Bench",
    "verify": "beaver_ftc.studies.verify:Verify",
    "detectability": "beaver_ftc.studies.detectability.command:Detectability",
}

FORMER = {  # names that still work for a release, and what to type instead, before the same arguments
    "smallest": ("detectability", "--within", "0.5"),
    "power": ("detectability", "--grid", "quick"),
    "decay": ("sensitivity",),
    "mechanisms": ("sensitivity", "--mechanisms"),
}

TOPICS = {  # of the program's help: commands by what they are for, in a few words
    "fly": {
        "run": "scenarios", "sweep": "many variations of one", "live": "by hand, in the browser",
        "new": "begin a file", "validate": "check files",
    },
    "look": {
        "list": "the choices", "show": "a built-in file", "schema": "all keys", "trim": "a flight condition",
        "linearise": "margins of the loop",
    },
    "ask": {
        "detectability": "how small a fault is found", "sensitivity": "what larger errors change",
        "mismatch": "errors of the model", "separate": "a doublet", "matrix": "every fault",
    },
    "compare": {
        "compare": "runs, schemes, laws", "reproduce": "the published study", "bench": "time of a frame",
        "challenge": "a class",
    },
    "aircraft": {"derive": "from JSBSim", "import": "from published data"},
    "logs": {"identify": "a vehicle from its flights", "diagnose": "recorded flights"},
    "links": {"sitl": "an autopilot flies"},
    "evidence": {"evidence": "a plan of requirements", "verify": "guarantees", "check": "a certificate"},
}  # fmt: skip
MORE = "more"  # the topic of commands of other packages


def topics(names: Collection[str]) -> dict[str, dict[str, str]]:
    """Of these commands what each is for, by topic."""
    named = {name for of in TOPICS.values() for name in of}
    found = {topic: {n: says for n, says in of.items() if n in names} for topic, of in TOPICS.items()}
    found[MORE] = {name: "" for name in names if name not in named}
    return {topic: of for topic, of in found.items() if of}


def registered() -> dict[str, str]:
    """Every command by name, ours first: `module:function` or `module:Study`. Imports none of them."""
    return COMMANDS | {name: where for name, where in entries(GROUP).items() if name not in COMMANDS}


def groups() -> dict[str, str]:
    """What each group of commands is for, by the word that stands before theirs."""
    return {name: summary(target) for name, target in entries(GROUPS).items()}


def summary(target: str) -> str:
    """The first line of its docstring, read from the source."""
    module, _, name = target.partition(":")
    file = _source(module)
    source = file.read_text(encoding="utf-8") if file.is_file() else ""
    found = re.search(rf'^(?:class|def) {name}\b.*?"""(.*?)(?:"""|$)', source, re.DOTALL | re.MULTILINE)
    return found[1] if found else ""


def _source(module: str) -> Path:
    """The file of a module; imports none of the packages that it is in."""
    package, *below = module.split(".")
    spec = find_spec(package)
    if not below or spec is None or not spec.submodule_search_locations:
        return Path(str(spec.origin if spec else module))
    place = Path(spec.submodule_search_locations[0], *below)
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


def declare(*files: str, plugins: bool = True) -> Callable[[Any], Any]:
    """Say of a command that is a function what a study says in its class: FILES and PLUGINS."""

    def mark(command: Any) -> Any:
        command.FILES, command.PLUGINS = files, plugins
        return command

    return mark


def files_of_commands() -> Iterator[str]:
    """The names of all that any command writes into a result folder; imports one command after the other."""
    for target in registered().values():
        yield from getattr(loaded(target), "FILES", ())


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
        return self.workers or required("cores", "--workers")()


def complete_names(incomplete: str) -> list[str]:
    """Built-in scenarios whose names begin so, for the shell."""
    return [name for name in required("scenarios", "SCENARIO")() if name.startswith(incomplete)]


SCENARIO = typer.Argument(
    metavar="SCENARIO",
    help="Path of a scenario file, or name of a built-in scenario.",
    autocompletion=complete_names,
)
ScenarioArgument = Annotated[str, SCENARIO]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, max=1024, help="Number of processes. Default: one for each core.")
]
SeedOption = Annotated[int, typer.Option(min=0)]
AirspeedOption = Annotated[float | None, typer.Option(min=1, max=1000)]
AirspeedsOption = Annotated[list[float] | None, typer.Option(min=1, max=1000)]
AltitudesOption = Annotated[list[float] | None, typer.Option(min=-300, max=30000)]
TurbulenceName = StrEnum("TurbulenceName", ["none", "light", "moderate"])


def listed(names: str) -> list[str]:
    """The names in a list with commas."""
    return [name.strip() for name in names.split(",") if name.strip()]
