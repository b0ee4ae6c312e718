"""Wrong designs by name: variants of a scenario that differ in `design_model` alone.

A variant is a name of VARIANTS, or key=value pairs of `design_model`, joined by +:
`engine-neglected`, `mass=1.1`, `linearised+coefficients.Cm_alpha=0.9`. `declared` is the scenario as it is.
"""

from typing import TYPE_CHECKING, Any

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.problems import ScenarioError, key_path
from beaver_ftc.scenario.loader import load_text

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

DECLARED = "declared"
VARIANTS: dict[str, dict[str, Any]] = {
    DECLARED: {},
    "engine-neglected": {"engine_terms": False},
    "linearised": {"linearised": True},
    "frozen-alpha": {"frozen_alpha": True},
    "heavy": {"mass": 1.1},
}


def variant_of(scenario: "Scenario", text: str) -> "Scenario":
    """The scenario with one variant's design model, named after both. Raises BadInput for an unknown one."""
    data = scenario.model_dump(mode="json", by_alias=True, exclude_none=True)
    for piece in text.split("+"):
        _merge(data["design_model"], _changes(piece.strip()))
    if text != DECLARED:
        data["name"] = f"{scenario.name}-{_as_name(text)}"[:100]
    data.pop("expect", None)  # what was expected of the scenario's own design need not hold for another
    return _validated(data, text)


def _validated(data: dict[str, Any], text: str) -> "Scenario":
    import yaml

    try:
        return load_text(yaml.safe_dump(data))
    except ScenarioError as error:
        says = (f"--variant {text}: {key_path(each.location)}: {each.says}" for each in error.problems)
        raise BadInput("\n".join(says)) from None


def _changes(piece: str) -> dict[str, Any]:
    if piece in VARIANTS:
        return VARIANTS[piece]
    key, equals, value = piece.partition("=")
    if not equals:
        raise BadInput(
            f"--variant {piece}: no such variant, "
            f"allowed: {', '.join(VARIANTS)}, or key=value of design_model"
        )
    return _nested(key.split("."), _value(piece, value))


def _value(piece: str, text: str) -> Any:
    import yaml

    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        value = None
    if not isinstance(value, bool | int | float):
        raise BadInput(f"--variant {piece}: {text!r} is no value, allowed: a number, true or false")
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _nested(keys: list[str], value: Any) -> dict[str, Any]:
    return {keys[0]: _nested(keys[1:], value) if len(keys) > 1 else value}


def _merge(into: dict[str, Any], changes: dict[str, Any]) -> None:
    for key, value in changes.items():
        if isinstance(value, dict) and isinstance(into.get(key), dict):
            _merge(into[key], value)
        else:
            into[key] = value


def _as_name(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in text)
