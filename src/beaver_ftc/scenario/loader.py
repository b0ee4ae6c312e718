"""A scenario from a file, a built-in name, a text or a mapping: every mistake at once, one line each."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from beaver_ftc.documents.document import Document, Problem
from beaver_ftc.documents.errors import BadInput, nearest
from beaver_ftc.documents.keys import plain
from beaver_ftc.documents.paths import data_root
from beaver_ftc.documents.problems import ScenarioError
from beaver_ftc.documents.validation import parse_document, text_of, validate
from beaver_ftc.scenario.consistency import conflicts
from beaver_ftc.scenario.schema import Scenario

MAX_BYTES = 4_000_000
"""A hand-written scenario is a few kB; a fully resolved one with reference tables in it stays below this."""
UNNAMED = "unnamed"

ScenarioLike = Scenario | str | PathLike[str] | Mapping[str, Any]


def load(scenario: ScenarioLike) -> Scenario:
    """The scenario of a built-in name, a file's path or a mapping; a Scenario is returned as it is.

    A mapping has the keys of a scenario file, `name` may be left out; its CSV files are in the working
    directory. Raises BadInput with one line a mistake.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, Mapping):
        return validate_scenario(Document({"name": UNNAMED, **plain(scenario)}), folder=Path())
    if isinstance(scenario, str | PathLike):
        return load_scenario(Path(scenario) if isinstance(scenario, PathLike) else scenario)
    raise BadInput(f"{scenario!r:.60} is no scenario, allowed: a built-in name, a path or a mapping")


def load_scenario(path_or_name: str | Path) -> Scenario:
    """The scenario in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    path = resolve(path_or_name)
    return load_text(read_file(path, str(path_or_name)), source=str(path), folder=path.parent)


def load_text(text: str, source: str = "<text>", folder: Path | None = None) -> Scenario:
    """The scenario in a text; `source` begins its error lines, `folder` is where its CSV files are."""
    document = parse_document(text, source)
    if is_of_a_sweep(document.data):
        says = f"this is a sweep file, allowed: a scenario; `beaver-ftc sweep {source}` flies it"
        raise ScenarioError(source, [Problem(document.line(("base",)), ("base",), says)])
    return validate_scenario(document, source, folder)


def is_of_a_sweep(data: dict[str, Any]) -> bool:
    """Whether a file's keys are those of a sweep: a base, and what becomes of it."""
    return "base" in data and not {"runs", "vary", "set", "expect"}.isdisjoint(data)


def validate_scenario(document: Document, source: str = "", folder: Path | None = None) -> Scenario:
    """The scenario in a document; without a source its error lines begin with the key."""
    return validate(Scenario, document, source, folder, conflicts)


def read_file(path: Path, given: str, kind: str = "scenario") -> str:
    """The text of a file, or a ScenarioError: why not and, for a bare name, which built-in it is near."""
    return text_of(path, MAX_BYTES, None if looks_like_a_path(given) else lambda: no_such(given, kind))


# What there is built in: where it lies, and the command that flies it.
_KINDS = {
    "scenario": ("scenarios", "run"),
    "sweep": ("scenarios/sweeps", "sweep"),
    "plan": ("evidence", "evidence"),
}


def _builtin(kind: str) -> dict[str, Path]:
    """Files of the built-in scenarios, sweeps or plans, by name; its file's name is a scenario's."""
    folder = data_root() / _KINDS[kind][0]
    return dict(sorted((path.stem, path) for path in folder.glob("*.yaml")))


def builtin_names() -> list[str]:
    """Names of the built-in scenarios, in alphabetical order."""
    return list(_builtin("scenario"))


def builtin_sweeps() -> list[str]:
    """Names of the sweeps that come with the project."""
    return list(_builtin("sweep"))


def builtin_plans() -> list[str]:
    """Names of the plans of evidence that come with the project."""
    return list(_builtin("plan"))


def builtin_path(name: str) -> Path:
    """The file of a built-in scenario."""
    return data_root() / "scenarios" / f"{name}.yaml"


def builtin_scenarios() -> list[tuple[str, str, Path]]:
    """(name, description, file) of each built-in scenario."""
    known = [(load_scenario(path), path) for path in _builtin("scenario").values()]
    return [(scenario.name, scenario.description, path) for scenario, path in known]


def no_such(given: str, kind: str) -> str:
    """What to say of a name that is no built-in `kind`, of _KINDS: perhaps it is of another."""
    names = {kind: list(_builtin(kind)) for kind in _KINDS}
    for other, (_, flies) in _KINDS.items():
        if other != kind and given in names[other]:
            return f"{given} is a {other}, allowed: a {kind}; `beaver-ftc {flies} {given}` flies it"
    says = f"no such file or built-in {kind}: {given[:100]!r}"
    allowed = f"allowed: a file, or one of the {len(names[kind])} names that `beaver-ftc list` prints"
    near = nearest(given, [name for known in (names[kind], *names.values()) for name in known])
    if near is None:
        return f"{says}, {allowed}"
    kinds = "" if near in names[kind] else f"the {next(of for of in _KINDS if near in names[of])} "
    return f"{says}, did you mean {kinds}{near}? {allowed}"


def resolve(name_or_path: str | Path, kind: str = "scenario") -> Path:
    """The file a built-in name of one of _KINDS stands for; anything else is a path already."""
    return _builtin(kind).get(str(name_or_path)) or Path(name_or_path)


def has_key(path_or_name: str | Path, kind: str, key: str) -> bool:
    """Whether a file (or name of a built-in `kind`) that can be read has this key at its top."""
    path = resolve(path_or_name, kind)
    try:
        return path.is_file() and key in parse_document(read_file(path, str(path)), str(path)).data
    except ScenarioError:
        return False


def looks_like_a_path(given: str) -> bool:
    """A built-in name has no folder and no dot."""
    return any(mark in given for mark in "/\\.")
