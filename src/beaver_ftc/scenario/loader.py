"""A scenario from a file, a built-in name or a text: every mistake at once, one line each, never a traceback."""

from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from beaver_ftc.scenario.base import suggestion
from beaver_ftc.scenario.builtin import builtin_names, looks_like_a_path, resolve
from beaver_ftc.scenario.document import Document, MalformedDocument, Problem, parse
from beaver_ftc.scenario.files import Unreadable, read_text
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
    """The scenario in a text; `source` is what its error lines begin with, `folder` where its CSV files are."""
    return validate(Scenario, parse_document(text, source), source, folder)


def read_file(path: Path, given: str) -> str:
    """The text of a file, or a ScenarioError that says why not (and, for a bare name, which built-in it is near)."""
    try:
        return read_text(path, MAX_BYTES)
    except Unreadable as error:
        says = str(error)
        if says.startswith("no such file") and not looks_like_a_path(given):
            says = f"no such file or built-in scenario{suggestion(given, builtin_names())}"
        raise ScenarioError(str(path), [Problem(error.line, (), says)]) from None


def parse_document(text: str, source: str) -> Document:
    """The text's one mapping. Raises ScenarioError."""
    try:
        document = parse(text)
    except MalformedDocument as error:
        raise ScenarioError(source, [error.problem]) from None
    if not isinstance(document.data, dict):
        says = "is empty" if document.data is None else "is not a mapping"
        problem = Problem(document.line(()), (), f"{says}, allowed: a mapping with the keys of `beaver-ftc schema`")
        raise ScenarioError(source, [*document.problems, problem])
    return document


def validate(model: type[_Model], document: Document, source: str, folder: Path | None = None) -> _Model:
    """The document's data as a model. Raises ScenarioError with all mistakes, duplicate keys included."""
    problems, instance = list(document.problems), None
    try:
        instance = model.model_validate(document.data, context={"folder": folder})
    except ValidationError as error:
        schema = model.model_json_schema()
        problems += problems_of(error, document, schema)
        problems += _hidden_conflicts(model, error, document, schema, folder)
    if problems or instance is None:
        raise ScenarioError(source, problems)
    return instance


def _hidden_conflicts(
    model: type[_Model], error: ValidationError, document: Document, schema: dict[str, Any], folder: Path | None
) -> list[Problem]:
    """Conflicts between sections, which are only checked once each section is right in itself.

    The sections with mistakes are left out and the rest is looked at again, for the conflicts it has on its own.
    """
    wrong = {detail["loc"][0] for detail in error.errors(include_url=False) if detail["loc"]}
    if not wrong or not isinstance(document.data, dict):
        return []
    rest = {key: value for key, value in document.data.items() if key not in wrong}
    try:
        model.model_validate(rest, context={"folder": folder})
    except ValidationError as again:
        found = problems_of(again, Document(rest, document.lines), schema)
        return [problem for problem in found if problem.location and problem.location[0] in rest]
    return []
