"""Which commands there are: a row each, by name; another package adds its own by entry point.

    [project.entry-points."beaver_ftc.commands"]         # in the pyproject.toml of the package
    "class grade" = "my_package.grading:Grade"

A row names a study (`studies/engine/command.py`) or a function whose parameters are the options. It is
imported when the command is called. Its docstring is its help; the first line of it is read from the source,
so that `--help` answers at once.
"""

import re
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

GROUP = "beaver_ftc.commands"
COMMANDS = {
    "run": "beaver_ftc.cli.run:command",
    "check": "beaver_ftc_assurance.commands.check:command",
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
    "evidence": "beaver_ftc_assurance.commands.evidence:command",
    "reproduce": "beaver_ftc.studies.reproduce.reproduction:Reproduce",
    "matrix": "beaver_ftc.studies.matrix.command:Matrix",
    "power": "beaver_ftc.studies.power.shown:Power",
    "smallest": "beaver_ftc.studies.smallest.survey:Smallest",
    "bench": "beaver_ftc.studies.bench.measure:Bench",
    "derive": "beaver_ftc_aircraft.commands:derive",
    "verify": "beaver_ftc.studies.verify:Verify",
    "detectability": "beaver_ftc.studies.detectability:Detectability",
    "separate": "beaver_ftc_assurance.commands.separate:command",
    "identify": "beaver_ftc_logs.commands:identify",
    "diagnose": "beaver_ftc_logs.commands:diagnose",
    "live": "beaver_ftc_live.commands.live:command",
    "sitl": "beaver_ftc_links.commands:command",
    "import gtm": "beaver_ftc_aircraft.commands:gtm",
    "challenge new": "beaver_ftc_live.commands.challenge:new",
    "challenge submit": "beaver_ftc_live.commands.challenge:submit",
    "challenge grade": "beaver_ftc_live.commands.challenge:grade",
}


def registered() -> dict[str, str]:
    """Every command by name, ours first: `module:function` or `module:Study`. Imports none of them."""
    from importlib.metadata import entry_points

    others = {point.name: point.value for point in entry_points(group=GROUP)}
    return COMMANDS | {name: others[name] for name in sorted(others) if name not in COMMANDS}


def load(target: str) -> Any:
    """The study or function that a row names."""
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)


def summary(target: str) -> str:
    """The first line of its docstring, read from the source."""
    module, _, name = target.partition(":")
    spec = find_spec(module)
    source = Path(str(spec.origin)).read_text(encoding="utf-8") if spec else ""
    found = re.search(rf'^(?:class|def) {name}\b.*?"""(.*?)(?:"""|$)', source, re.DOTALL | re.MULTILINE)
    return found[1] if found else ""


def declare(*files: str, plugins: bool = True) -> Callable[[Any], Any]:
    """Say of a command that is a function what a study says in its class: FILES and PLUGINS."""

    def mark(command: Any) -> Any:
        command.FILES, command.PLUGINS = files, plugins
        return command

    return mark


def files_of_commands() -> Iterator[str]:
    """The names of all that any command writes into a result folder; imports one command after the other."""
    for target in registered().values():
        yield from getattr(load(target), "FILES", ())
