"""What packages beside the core add to it: detectors and laws, services, functions to call after an import.

    [project.entry-points."beaver_ftc.detectors"]        # in the pyproject.toml of the package
    my-detector = "my_package:MyDetector"

    [project.entry-points."beaver_ftc.services"]
    derive = "my_package:derive"                         # what the core calls by this name

    [project.entry-points."beaver_ftc.when_imported"]
    "gymnasium.envs.registration" = "my_package:register"

Commands are in `commands.py`. The core imports none of these packages before one of its functions is wanted.
`importlib.metadata` finds the same entry points, and takes 40 ms to import and to search: half of the time in
which `--help` answers.

Detectors and laws are built in (plugins.yaml), or come by entry point, or are registered for one run:

    beaver-ftc run mine.yaml --plugin my_package:MyDetector

A scenario names them by `fdi.scheme` and `control.law`. It is data: it names what is registered, never a
module, and reading it imports nothing. What `--plugin` registers is handed on to worker processes in an
environment variable.
"""

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from inspect import getdoc, isclass, signature
from math import inf
from pathlib import Path
from types import ModuleType
from typing import Any

from beaver_ftc.documents.errors import NO_FAILURE, BadInput, Stopped, suggestion

__all__ = [
    "DETECTORS", "LAWS", "OF_THE_CORE", "OURS", "SERVICES", "WHEN_IMPORTED", "Range", "Registered", "entries",
    "folders", "is_compiled", "loaded", "made", "needs_leaders", "offered", "options_of", "plugin_class",
    "refusal", "register", "registered", "required", "settings", "tunable", "watch_imports", "wrong_options",
]  # fmt: skip

SERVICES, WHEN_IMPORTED = "beaver_ftc.services", "beaver_ftc.when_imported"
# Services of the core itself, for what stands on a lower floor; no package can replace them.
OF_THE_CORE = {
    "admit": "beaver_ftc.plant.admission:admit",
    "cores": "beaver_ftc.studies.engine.processes:cores",
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
            for group, name, target in _read_entry_points(text):
                found.setdefault((group, name), target)
    return found


def _metadata_folders() -> Iterator[str]:
    for place in sys.path:
        try:
            names = os.listdir(place or ".")
        except OSError:
            continue
        yield from (os.path.join(place, name) for name in names if name.endswith(_METADATA))


def _read_entry_points(text: str) -> Iterator[tuple[str, str, str]]:
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


DETECTORS, LAWS = "beaver_ftc.detectors", "beaver_ftc.laws"
OURS = "beaver-ftc"
VARIABLE = "BEAVER_FTC_PLUGINS"  # what is registered for this run: NAME=MODULE:CLASS, separated by spaces
_GIVEN = re.compile(r"(?:([A-Za-z0-9_-]+)=)?([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):([A-Za-z_]\w*)")
_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_ARGUMENTS = {3: DETECTORS, 4: LAWS}  # of `step`, with self

_ROWS = Path(__file__).with_suffix(".yaml")
_METHODS = ("reset", "step")


@dataclass(frozen=True)
class Registered:
    """A detector or law by name. target: `module:Class`, empty for what the compiled frame does itself."""

    group: str
    name: str
    target: str
    package: str
    says: str = ""

    def description(self) -> str:
        """One line; of another package's class the first of its docstring, or why it cannot be loaded."""
        if self.says:
            return self.says
        try:
            return (getdoc(plugin_class(self.group, self.name)) or "").partition("\n")[0]
        except BadInput as error:
            return f"broken: {error}"


@dataclass(frozen=True)
class Range:
    """Between which limits a parameter is tuned, and whether on the scale of its logarithm or of its odds."""

    low: float
    high: float
    scale: str = "log"


@cache
def _ours(group: str) -> dict[str, dict[str, Any]]:
    """Our own by name: what is said of each, and its class, if it is not in the compiled frame itself."""
    from beaver_ftc.documents.document import parse

    rows: dict[str, dict[str, Any]] = parse(_ROWS.read_text(encoding="utf-8")).data[group]
    return rows


def is_compiled(group: str, name: str) -> bool:
    """Whether the compiled frame does this scheme or law itself."""
    return name in _ours(group) and "class" not in _ours(group)[name]


def compiled_rows(group: str) -> dict[str, dict[str, Any]]:
    """Rows of plugins.yaml whose kernels are compiled, by name; of a plug-in of ours they fly in its
    place."""
    return {name: row for name, row in _ours(group).items() if "kernels" in row}


def needs_leaders(group: str, name: str) -> bool:
    """Whether a scheme or law of ours needs a surface for each of roll, pitch and yaw."""
    return bool(_ours(group).get(name, {}).get("leader_of_each_axis"))


def options_of(group: str, name: str) -> dict[str, dict[str, Any]]:
    """The options of what the compiled frame does itself, as plugins.yaml has them."""
    return _ours(group)[name].get("options", {})


def tunable(group: str, name: str) -> dict[str, Range]:
    """What may be tuned of a detector or law: its row in plugins.yaml says it, or `tunable` of its class.

    A key without a dot is an option of the method, one with dots is a key of the scenario. Raises BadInput.
    """
    given = _ours(group)[name].get("tunable", {}) if name in _ours(group) else _tunable_of_class(group, name)
    return {key: _range(name, key, limits) for key, limits in given.items()}


def _tunable_of_class(group: str, name: str) -> Mapping[str, Any]:
    given = getattr(plugin_class(group, name), "tunable", {})
    if isinstance(given, Mapping):
        return given
    raise BadInput(f"plug-in {name}: tunable is a {type(given).__name__}, allowed: option: (low, high)")


def _range(name: str, key: str, limits: Any) -> Range:
    try:
        low, high, *scale = limits
        found = Range(float(low), float(high), *scale)
    except (TypeError, ValueError):
        found = Range(0.0, 0.0)
    most = {"log": inf, "odds": 1.0}.get(found.scale, 0.0)
    if not 0.0 < found.low < found.high < most:
        allowed = 'allowed: (low, high) with 0 < low < high, or (low, high, "odds") below 1'
        raise BadInput(f"{name}: tunable {key}: {limits!r:.60}; {allowed}")
    return found


def settings(group: str, name: str, given: Mapping[str, float]) -> dict[str, float]:
    """Every option of what the compiled frame does itself: as given, else its default."""
    return {key: row["default"] for key, row in options_of(group, name).items()} | dict(given)


def wrong_options(group: str, name: str, given: Mapping[str, float]) -> list[tuple[tuple[str, str], str]]:
    """What is wrong with the options given to what the compiled frame does itself: where, and what."""
    known, wrong = options_of(group, name) if is_compiled(group, name) else given, []
    for key, value in given.items():
        row = known.get(key)
        if row is None:
            says = f"has no such option{suggestion(key, known)}" if known else "has no options, allowed: {}"
            wrong.append((("options", key), f"{name} {says}"))
        elif isinstance(row, dict):
            low, high, whole = row.get("low", 0), row["high"], row.get("whole", False)
            if not low <= value <= high or (whole and value != int(value)):
                what = "whole numbers" if whole else "numbers"
                wrong.append((("options", key), f"{value:g}, allowed: {what} from {low:g} to {high:g}"))
    return wrong


def registered(group: str) -> dict[str, Registered]:
    """Everything registered under DETECTORS or LAWS, by name, ours first; imports none of it."""
    rows = _ours(group).items()
    ours = {name: Registered(group, name, row.get("class", ""), OURS, row["says"]) for name, row in rows}
    others = {entry.name: entry for entry in _from_packages(group) if entry.name not in ours}
    return ours | others | {entry.name: entry for entry in _of_this_run(group)}


def _from_packages(group: str) -> Iterable[Registered]:
    from importlib.metadata import entry_points

    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        yield Registered(group, point.name, point.value, point.dist.name if point.dist else "")


def register(given: str) -> Registered:
    """Register `MODULE:CLASS`, or `NAME=MODULE:CLASS`, for this process and those it starts.

    Without a name it is the class's own, in lower case with hyphens: MyDetector is my-detector. (A scenario
    may write it either way.) The module is one that is installed, or in the working folder. Raises BadInput.
    """
    entry = _read(given)
    known = registered(entry.group).get(entry.name)
    if known == entry:
        return entry
    if known is not None:
        raise BadInput(f"--plugin {given}: there is a {entry.name} already, allowed: NAME=MODULE:CLASS")
    text = f"{entry.name}={entry.target}"
    os.environ[VARIABLE] = " ".join(filter(None, (os.environ.get(VARIABLE), text)))
    return entry


def _of_this_run(group: str) -> list[Registered]:
    return [entry for entry in _read_all(os.environ.get(VARIABLE, "")) if entry.group == group]


@lru_cache
def _read_all(texts: str) -> tuple[Registered, ...]:
    return tuple(map(_read, texts.split()))


def _read(given: str) -> Registered:
    """What `--plugin` says: its class is loaded, to see whether it is a detector or a law."""
    matched = _GIVEN.fullmatch(given)
    if not matched:
        raise BadInput(f"--plugin: {given[:200]!r} is no class, allowed: MODULE:CLASS or NAME=MODULE:CLASS")
    name, module, attribute = matched.groups()
    folder = os.getcwd()
    if folder not in sys.path:
        sys.path.append(folder)  # last: nothing there can take the place of an installed module
    target = f"{module}:{attribute}"
    found = _load(f"--plugin {given}", target)
    group = _ARGUMENTS.get(len(signature(found.step).parameters))  # type: ignore[attr-defined]
    if group is None:
        allowed = (
            "allowed: step(measured, command) of a detector, step(measured, reference, verdict) of a law"
        )
        raise BadInput(f"--plugin {given}: step{signature(found.step)} is neither, {allowed}")  # type: ignore[attr-defined]
    return Registered(group, name or _hyphenated(attribute), target, "--plugin")


def _hyphenated(name: str) -> str:
    return _WORDS.sub("-", name).lower()


def _entry(group: str, name: str) -> Registered | None:
    """What is registered by a name; of this run's, the class's own name will do as well."""
    by_class = (entry for entry in _of_this_run(group) if entry.target.rpartition(":")[2] == name)
    return registered(group).get(name) or next(by_class, None)


def refusal(group: str, name: str) -> str | None:
    """What is wrong with a scheme's or law's name in a scenario, and what is allowed; None if nothing is."""
    if name in _ours(group) or _entry(group, name):
        return None
    known = registered(group)
    what = "scheme" if group == DETECTORS else "law"
    if _GIVEN.fullmatch(name):
        return (
            f"{name[:100]!r} is a class; a scenario names what is registered, allowed: {', '.join(known)}, "
            f"or what --plugin MODULE:CLASS registers on the command line"
        )
    return f"unknown {what} {name[:100]!r}{suggestion(name, known)}"


def plugin_class(group: str, name: str) -> type:
    """The class behind a name that is not compiled in. Raises BadInput, naming it, if there is none."""
    entry = _entry(group, name)
    if entry is None or not entry.target:
        raise BadInput(f"plug-in {name}: not registered{suggestion(name, registered(group))}")
    return _load(f"plug-in {name}", entry.target)


def _load(what: str, target: str) -> type:
    """The class that `module:Class` names. SystemExit is only another failure: the exit status is ours."""
    module, _, attribute = target.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except (KeyboardInterrupt, Stopped):
        raise
    except BaseException as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"{what}: cannot load {target}: {type(error).__name__}: {reason}") from error
    missing = [method for method in _METHODS if not callable(getattr(found, method, None))]
    if not isclass(found) or missing:
        needs = f"lacks {' and '.join(missing)}" if missing else "is not a class"
        raise BadInput(f"{what}: {target} {needs}, allowed: a class with reset and step")
    return found


def made(group: str, name: str) -> Any:
    """An instance of the class behind a name. Raises BadInput, naming it, if there can be none."""
    try:
        return plugin_class(group, name)()
    except NO_FAILURE:
        raise
    except BaseException as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"plug-in {name}: cannot be made: {type(error).__name__}: {reason}") from error
