"""What packages beside the core add to it: services, functions to call after an import, and commands.

    [project.entry-points."beaver_ftc.services"]         # in the pyproject.toml of the package
    derive = "my_package:derive"                         # what the core calls by this name

    [project.entry-points."beaver_ftc.when_imported"]
    "gymnasium.envs.registration" = "my_package:register"

Commands are in `commands.py`. The core imports none of these packages before one of its functions is wanted.
`importlib.metadata` finds the same entry points, and takes 40 ms to import and to search: half of the time in
which `--help` answers.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from beaver_ftc.documents.errors import BadInput

__all__ = [
    "OF_THE_CORE", "SERVICES", "WHEN_IMPORTED", "entries", "folders", "loaded", "offered", "required",
    "watch_imports",
]  # fmt: skip

SERVICES, WHEN_IMPORTED = "beaver_ftc.services", "beaver_ftc.when_imported"
# Services of the core itself, for what stands on a lower floor; no package can replace them.
OF_THE_CORE = {
    "admit": "beaver_ftc.plant.admission:admit",
    "cores": "beaver_ftc.studies.engine.workers:cores",
    "scenarios": "beaver_ftc.scenario.builtin:builtin_names",
}
_METADATA = (".dist-info", ".egg-info")


def entries(group: str) -> dict[str, str]:
    """{name: `module:attribute`} of a group of entry points, sorted by name; of a name the first on the path.

    An entry of a package whose files are not there is left out.
    """
    return {
        name: target
        for (of, name), target in sorted(_all_entries().items())
        if of == group and find_spec(target.partition(":")[0].partition(".")[0]) is not None
    }


@cache
def _all_entries() -> dict[tuple[str, str], str]:
    """{(group, name): target} of our groups, of every package on the path."""
    found: dict[tuple[str, str], str] = {}
    for folder in _metadata_folders():
        try:
            with open(os.path.join(folder, "entry_points.txt"), encoding="utf-8") as file:
                text = file.read()
        except OSError:
            continue
        if "[beaver_ftc." in text:
            for group, name, target in _read(text):
                found.setdefault((group, name), target)
    return found


def _metadata_folders() -> Iterator[str]:
    for place in sys.path:
        try:
            names = os.listdir(place or ".")
        except OSError:
            continue
        yield from (os.path.join(place, name) for name in names if name.endswith(_METADATA))


def _read(text: str) -> Iterator[tuple[str, str, str]]:
    """(group, name, target) of each line of an entry_points.txt."""
    group = ""
    for line in text.splitlines():
        name, equals, target = line.partition("=")
        if line.startswith("["):
            group = line.strip(" []")
        elif equals and group.startswith("beaver_ftc."):
            yield group, name.strip(), target.strip()


def folders(group: str) -> list[Path]:
    """The folders of the packages that a group of entry points names."""
    packages = sorted({target.partition(":")[0].partition(".")[0] for target in entries(group).values()})
    specs = (find_spec(package) for package in packages)
    return [Path(place) for spec in specs if spec for place in spec.submodule_search_locations or ()]


def loaded(target: str) -> Any:
    """What `module:attribute` names."""
    module, _, attribute = target.partition(":")
    return getattr(import_module(module), attribute)


def offered(service: str) -> Callable[..., Any] | None:
    """The function of a service; None if no installed package offers it."""
    target = OF_THE_CORE.get(service) or entries(SERVICES).get(service)
    return None if target is None else loaded(target)


def required(service: str, by: str) -> Callable[..., Any]:
    """The function of a service; by: what the user asked for. Raises BadInput if no package offers it."""
    found = offered(service)
    if found is None:
        raise BadInput(
            f"{by}: no installed package offers {service!r}, allowed: with all of `pip install beaver-ftc`"
        )
    return found


def watch_imports() -> None:
    """Call each function of WHEN_IMPORTED with its module: now if that is imported, else right after."""
    waiting = {}
    for module, target in entries(WHEN_IMPORTED).items():
        if module in sys.modules:
            loaded(target)(sys.modules[module])
        else:
            waiting[module] = target
    if waiting:
        sys.meta_path.insert(0, _Waiting(waiting))


class _Waiting(MetaPathFinder):
    """Finds modules by the usual finders, and has a function called once each of them is executed."""

    def __init__(self, waiting: dict[str, str]) -> None:
        self._waiting = waiting

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The usual spec of a module waited for, whose loader calls the function; None of any other."""
        function = self._waiting.pop(fullname, None)
        if function is None:
            return None
        if not self._waiting:
            sys.meta_path.remove(self)
        spec = find_spec(fullname)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_call(module: ModuleType) -> None:
            execute(module)
            loaded(function)(module)

        spec.loader.exec_module = execute_and_call  # type: ignore[method-assign]
        return spec
