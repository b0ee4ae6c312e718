"""A scenario from a file, a built-in name, a text or a mapping: every mistake at once, one line each."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from beaver_ftc.documents.document import Document, Problem
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.validation import ScenarioError, parse_document, plain, validate
from beaver_ftc.scenario.builtin import read_file, resolve
from beaver_ftc.scenario.consistency import conflicts
from beaver_ftc.scenario.schema import Scenario

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
