"""From a text to a model: every mistake at once, one line each, at its line in the file."""

from collections.abc import Callable
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from beaver_ftc.documents.base import Conflict
from beaver_ftc.documents.document import MAX_PROBLEMS, Document, MalformedDocumentError, Problem, parse
from beaver_ftc.documents.files import UnreadableError, read_text
from beaver_ftc.documents.problems import ScenarioError, problems_of
from beaver_ftc.documents.repair import repaired

_Model = TypeVar("_Model", bound=BaseModel)


@lru_cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def parse_document(text: str, source: str, keys: str = "the keys of `beaver-ftc schema`") -> Document:
    """The text's one mapping; `keys` says what it should hold. Raises ScenarioError."""
    try:
        document = parse(text)
    except MalformedDocumentError as error:
        raise ScenarioError(source, [error.problem]) from None
    if not isinstance(document.data, dict):
        says = "is empty" if document.data is None else "is not a mapping"
        problem = Problem(document.line(()), (), f"{says}, allowed: a mapping with {keys}")
        raise ScenarioError(source, [*document.problems, problem])
    return document


def read_file(
    model: type[_Model], path: Path, most_bytes: int, keys: str = "the keys of `beaver-ftc schema`"
) -> _Model:
    """A file as a model. Raises ScenarioError with one line a mistake."""
    try:
        text = read_text(path, most_bytes)
    except UnreadableError as error:
        raise ScenarioError(str(path), [Problem(error.line, (), str(error))]) from None
    return validate(model, parse_document(text, str(path), keys), str(path))


def _all_of(
    error: ValidationError, model: type[BaseModel], document: Document, folder: Path | None
) -> list[Problem]:
    """The mistakes that an error names, and those that show once unknown keys and types are as meant."""
    found = list(islice(problems_of(error, document, _schema(model)), MAX_PROBLEMS))
    known = {problem.location for problem in found}
    mended = repaired(document, found, known)
    while mended is not None and len(found) < MAX_PROBLEMS:
        try:
            model.model_validate(mended.data, context={"folder": folder})
            break
        except ValidationError as hidden:
            seen = list(islice(problems_of(hidden, mended, _schema(model)), MAX_PROBLEMS))
        more = [problem for problem in seen if problem.location not in known]
        found, known = found + more, known | {problem.location for problem in more}
        mended = repaired(mended, more, known)
    return found


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
        problems += _all_of(error, model, document, folder)
        known = {problem.location for problem in problems}
        hidden = [(at, says) for at, says in conflicts_in(document.data) if at not in known]
        problems += [Problem(document.line(at), at, says) for at, says in hidden]
    if problems or instance is None:
        raise ScenarioError(source, problems)
    return instance
