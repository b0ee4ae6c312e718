"""What a Python caller gives as a scenario or a fault: checked as a file would be.

A mistake is a BadInput with the key's path, `faults[0].magnitude: 30 is out of range, allowed: ...`.
"""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from beaver_ftc.documents.base import Section
from beaver_ftc.documents.document import Document, Problem
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.problems import ScenarioError
from beaver_ftc.documents.validation import validate
from beaver_ftc.scenario.change import Change
from beaver_ftc.scenario.environment import Gust
from beaver_ftc.scenario.faults import Fault
from beaver_ftc.scenario.loader import load_scenario, validate_scenario
from beaver_ftc.scenario.overrides import plain
from beaver_ftc.scenario.schema import Scenario

ScenarioLike = Scenario | str | PathLike[str] | Mapping[str, Any]

UNNAMED = "unnamed"


class _OneFault(Section):
    fault: Fault


class _OneGust(Section):
    gust: Gust


class _OneChange(Section):
    change: Change


OneThing = TypeVar("OneThing", bound=Section)


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


def fault_of(given: Mapping[str, Any], at_s: float) -> Fault:
    """The fault that a mapping without `at_s` describes, from at_s on. Raises BadInput with the key."""
    return _begun(_OneFault, "fault", given, at_s, "of `type`, `actuator` and its size").fault


def gust_of(given: Mapping[str, Any], at_s: float) -> Gust:
    """The gust that a mapping without `at_s` describes, from at_s on. Raises BadInput with the key."""
    return _begun(_OneGust, "gust", given, at_s, "of `velocity_mps` and its times").gust


def change_of(given: Mapping[str, Any], at_s: float) -> Change:
    """The change that a mapping without `at_s` describes, from at_s on. Raises BadInput with the key."""
    return _begun(_OneChange, "change", given, at_s, "of law, scheme, sensors or declared_sensors").change


def _begun(model: type[OneThing], what: str, given: Mapping[str, Any], at_s: float, keys: str) -> OneThing:
    """What the mapping describes, as the only field of a model; mistakes are named without that field."""
    data = plain(given)
    if not isinstance(data, dict):
        raise BadInput(f"{given!r:.60} is no {what}, allowed: a mapping {keys}")
    if "at_s" in data:
        raise BadInput(f"at_s: has no meaning here, allowed: a {what} that begins now, at {at_s:g} s")
    try:
        return validate(model, Document({what: {**data, "at_s": at_s}}), "")
    except ScenarioError as error:
        problems = [Problem(one.line, one.location[1:], one.says) for one in error.problems]
        raise ScenarioError("", problems) from None


def is_same_again(new: Any, known: Any) -> bool:
    """Whether a fault that does not add to its like is there already, to stay."""
    begun = known.type == new.type and known.at_s <= new.at_s
    return bool(
        begun and not getattr(new, "adds", True) and known == new.model_copy(update={"at_s": known.at_s})
    )
