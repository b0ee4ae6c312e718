"""A scenario from a file, a built-in name or a text: every mistake at once, one line each."""

from pathlib import Path
from typing import Any

from beaver_ftc.documents.document import Document, Problem
from beaver_ftc.documents.files import UnreadableError, read_text
from beaver_ftc.documents.problems import ScenarioError
from beaver_ftc.documents.validation import parse_document, validate
from beaver_ftc.scenario.builtin import builtin_names, builtin_path, looks_like_a_path, no_such, resolve
from beaver_ftc.scenario.consistency import conflicts_in_data
from beaver_ftc.scenario.schema import Scenario

MAX_BYTES = 4_000_000
"""A hand-written scenario is a few kB; a fully resolved one with reference tables in it stays below this."""


def load_scenario(path_or_name: str | Path) -> Scenario:
    """The scenario in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    path = resolve(path_or_name)
    return load_text(read_file(path, str(path_or_name)), source=str(path), folder=path.parent)


def builtin_scenarios() -> list[tuple[str, str, Path]]:
    """(name, description, file) of each built-in scenario."""
    return [
        (s.name, s.description, builtin_path(name))
        for name in builtin_names()
        for s in (load_scenario(name),)
    ]


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
    return validate(Scenario, document, source, folder, conflicts_in_data)


def read_file(path: Path, given: str, kind: str = "scenario") -> str:
    """The text of a file, or a ScenarioError: why not and, for a bare name, which built-in it is near."""
    try:
        return read_text(path, MAX_BYTES)
    except UnreadableError as error:
        says = str(error)
        if says.startswith("no such file") and not looks_like_a_path(given):
            says = no_such(given, kind)
        raise ScenarioError(str(path), [Problem(error.line, (), says)]) from None
