"""A scenario with other values at dotted keys, checked as a file would be."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.documents.base import Location
from beaver_ftc.documents.document import Document
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.keys import UnusableKeyError, parse_key, with_values
from beaver_ftc.documents.validation import validate
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.consistency import conflicts_in_data

_Model = TypeVar("_Model", bound=BaseModel)


def changed(scenario: _Model, changes: Mapping[str, Any]) -> _Model:
    """The scenario with new values at dotted keys, `{"faults[0].magnitude": 0.2}`, checked as a whole.

    Raises BadInput that names the key.
    """
    if not isinstance(changes, Mapping):
        raise BadInput(f"{changes!r:.60} is no change, allowed: a mapping of dotted keys to values")
    data = scenario.model_dump(mode="json", by_alias=True, exclude_unset=True)
    for key, value in changes.items():
        try:
            data = with_values(data, {_parsed(key): plain(value)})
        except UnusableKeyError as error:
            raise BadInput(f"{key}: {str(error).replace('the base', 'the scenario')}") from None
    with checked_against(*aircraft_of(scenario)):
        return validate(type(scenario), Document(data), "", Path(), conflicts_in_data)


def aircraft_of(scenario: BaseModel) -> tuple[Aircraft, str | None]:
    """The aircraft a scenario flies, and what it calls it."""
    return getattr(scenario, "airframe", None) or load(), getattr(scenario, "aircraft", None)


def _parsed(key: Any) -> Location:
    if not isinstance(key, str):
        raise UnusableKeyError("is no dotted key, allowed: keys like faults[0].magnitude")
    return parse_key(key)


def plain(value: Any) -> Any:
    """Mappings, lists and numbers as a YAML file would give them: no NumPy, no tuples, no models."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True, exclude_unset=True)
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return str(value) if isinstance(value, PathLike) else value
