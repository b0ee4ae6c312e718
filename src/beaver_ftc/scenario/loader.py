"""A scenario from a file, a built-in name or a text: every mistake at once, one line each."""

from collections.abc import Callable
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from beaver_ftc.errors import suggestion
from beaver_ftc.scenario.base import Conflict
from beaver_ftc.scenario.builtin import builtin_names, looks_like_a_path, resolve
from beaver_ftc.scenario.consistency import conflicts, outline_of_data
from beaver_ftc.scenario.document import MAX_PROBLEMS, Document, MalformedDocumentError, Problem, parse
from beaver_ftc.scenario.files import UnreadableError, read_text
from beaver_ftc.scenario.problems import ScenarioError, problems_of
from beaver_ftc.scenario.schema import Scenario

MAX_BYTES = 4_000_000
"""A hand-written scenario is a few kB; a fully resolved one with reference tables in it stays below this."""

_Model = TypeVar("_Model", bound=BaseModel)


def load_scenario(path_or_name: str | Path) -> Scenario:
    """The scenario in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    path = resolve(path_or_name)
    return load_text(read_file(path, str(path_or_name)), source=str(path), folder=path.parent)


def load_text(text: str, source: str = "<text>", folder: Path | None = None) -> Scenario:
    """The scenario in a text; `source` begins its error lines, `folder` is where its CSV files are."""
    return validate_scenario(parse_document(text, source), source, folder)


def validate_scenario(document: Document, source: str = "", folder: Path | None = None) -> Scenario:
    """The scenario in a document; without a source its error lines begin with the key."""
    return validate(Scenario, document, source, folder, _conflicts)


@lru_cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _conflicts(data: dict[str, Any]) -> list[Conflict]:
    return conflicts(outline_of_data(data))


def read_file(path: Path, given: str) -> str:
    """The text of a file, or a ScenarioError: why not and, for a bare name, which built-in it is near."""
    try:
        return read_text(path, MAX_BYTES)
    except UnreadableError as error:
        says = str(error)
        if says.startswith("no such file") and not looks_like_a_path(given):
            says = f"no such file or built-in scenario{suggestion(given, builtin_names())}"
        raise ScenarioError(str(path), [Problem(error.line, (), says)]) from None


def parse_document(text: str, source: str) -> Document:
    """The text's one mapping. Raises ScenarioError."""
    try:
        document = parse(text)
    except MalformedDocumentError as error:
        raise ScenarioError(source, [error.problem]) from None
    if not isinstance(document.data, dict):
        says = "is empty" if document.data is None else "is not a mapping"
        problem = Problem(
            document.line(()), (), f"{says}, allowed: a mapping with the keys of `beaver-ftc schema`"
        )
        raise ScenarioError(source, [*document.problems, problem])
    return document


def validate(
    model: type[_Model],
    document: Document,
    source: str,
    folder: Path | None = None,
    conflicts_in: Callable[[dict[str, Any]], list[Conflict]] = lambda data: [],
) -> _Model:
    """The document's data as a model. Raises ScenarioError with all mistakes, duplicate keys included.

    A model looks for contradictions between its sections once each is right in itself; `conflicts_in` finds
    them in data that is not.
    """
    problems, instance = list(document.problems), None
    try:
        instance = model.model_validate(document.data, context={"folder": folder})
    except ValidationError as error:
        problems += islice(problems_of(error, document, _schema(model)), MAX_PROBLEMS)
        known = {problem.location for problem in problems}
        hidden = [(at, says) for at, says in conflicts_in(document.data) if at not in known]
        problems += [Problem(document.line(at), at, says) for at, says in hidden]
    if problems or instance is None:
        raise ScenarioError(source, problems)
    return instance
