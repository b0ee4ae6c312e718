"""From a text to a model: every mistake at once, one line each, at its line in the file.

report.py has the form of a line, and allowed.py the words for a mistake.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from beaver_ftc.documents.document import (
    MAX_PROBLEMS,
    Conflict,
    Document,
    Location,
    MalformedDocumentError,
    Problem,
    copied,
    has,
    parse,
)
from beaver_ftc.documents.files import AbsentFileError, UnreadableError, read_text
from beaver_ftc.documents.report import ScenarioError

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
        problem = Problem(document.line(()), (), f"{says}, allowed: a mapping with {keys}", no_mapping=True)
        raise ScenarioError(source, [*document.problems, problem])
    return document


def text_of(path: Path | str, most_bytes: int, if_absent: Callable[[], str] | None = None) -> str:
    """A file's text. if_absent: what to say where there is no such file. Raises ScenarioError."""
    try:
        return read_text(path, most_bytes)
    except UnreadableError as error:
        says = if_absent() if if_absent and isinstance(error, AbsentFileError) else str(error)
        raise ScenarioError(str(path), [Problem(error.line, (), says)]) from None


def read_file(
    model: type[_Model], path: Path, most_bytes: int, keys: str = "the keys of `beaver-ftc schema`"
) -> _Model:
    """A file as a model. Raises ScenarioError with one line a mistake."""
    return validate(model, parse_document(text_of(path, most_bytes), str(path), keys), str(path))


def _all_of(
    error: ValidationError, model: type[BaseModel], document: Document, folder: Path | None
) -> list[Problem]:
    """The mistakes that an error names, and those that show once unknown keys and types are as meant."""
    from beaver_ftc.documents.allowed import problems_of  # what is right needs no words

    found: list[Problem] = []
    known: set[Location] = set()
    while True:
        seen = islice(problems_of(error, document, _schema(model)), MAX_PROBLEMS)
        more = [problem for problem in seen if problem.location not in known]
        found += more
        known.update(problem.location for problem in more)
        mended = _repaired(document, more, known)
        if mended is None or len(found) >= MAX_PROBLEMS:
            return found
        try:
            model.model_validate(mended.data, context={"folder": folder})
        except ValidationError as hidden:
            document, error = mended, hidden
        else:
            return found


def _repaired(document: Document, problems: Iterable[Problem], known: set[Location]) -> Document | None:
    """The document with unknown keys and types as they were meant, or without; None if none is unknown.

    A mistyped key or type hides what else is wrong in its section: nothing there can be held against a
    schema. known: gets the keys that were renamed: a value given to another key is not to be judged by this
    one.
    """
    data, lines, changed = copied(document.data), dict(document.lines), False
    for problem in problems:
        section, key = _place(data, problem.location)
        if section is None:
            continue
        if problem.unknown_key:
            value = section.pop(key)
            if problem.meant and problem.meant not in section:
                section[problem.meant] = value
                renamed = (*problem.location[:-1], problem.meant)
                known.add(renamed)
                lines |= _moved(lines, problem.location, renamed)
            changed = True
        elif problem.meant and key == "type":
            section[key], changed = problem.meant, True
    return replace(document, data=data, lines=lines) if changed else None


def _place(data: Any, location: Location) -> tuple[dict[str, Any] | None, Any]:
    """The mapping that a location ends in and the key there; None where the data has no such place."""
    section, key = None, None
    for key in location:
        if not has(data, key):
            return None, key
        section, data = data, data[key]
    return section if isinstance(section, dict) else None, key


def _moved(lines: dict[Location, int], old: Location, new: Location) -> dict[Location, int]:
    depth = len(old)
    return {(*new, *at[depth:]): line for at, line in lines.items() if at[:depth] == old}


def validate(
    model: type[_Model],
    document: Document,
    source: str,
    folder: Path | None = None,
    conflicts_in: Callable[[dict[str, Any]], Iterable[Conflict]] = lambda data: (),
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
