"""Which commands there are: a row each, by name; another package adds its own by entry point.

    [project.entry-points."beaver_ftc.commands"]         # in the pyproject.toml of the package
    "class grade" = "my_package.grading:Grade"
    [project.entry-points."beaver_ftc.command_groups"]   # a class whose docstring says what they are for
    class = "my_package.grading:Group"

A row names a study (`studies/engine/command.py`) or a function whose parameters are the options. It is
imported when the command is called. Its docstring is its help; the first line of it is read from the source,
so that `--help` answers at once.
"""

import re
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from beaver_ftc.extensions import entries, loaded

__all__ = ["COMMANDS", "GROUP", "GROUPS", "declare", "files_of_commands", "groups", "registered", "summary"]

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
    "power": "beaver_ftc.studies.power.shown:Power",
    "smallest": "beaver_ftc.studies.smallest.survey:Smallest",
    "decay": "beaver_ftc.studies.decay.survey:Decay",
    "bench": "beaver_ftc.studies.bench.measure:Bench",
    "verify": "beaver_ftc.studies.verify:Verify",
    "detectability": "beaver_ftc.studies.detectability:Detectability",
}


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
