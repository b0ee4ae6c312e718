"""Wrong designs by name: variants of a scenario that differ in `design_model` alone.

A variant is a name of VARIANTS, or key=value pairs of `design_model`, joined by +:
`engine-neglected`, `mass=1.1`, `linearised+coefficients.Cm_alpha=0.9`. `declared` is the scenario as it is.
"""

from typing import TYPE_CHECKING, Any

from beaver_ftc.documents.errors import BadInput

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
    pieces = [_changes(piece.strip()) for piece in text.split("+")]
    changes = {f"design_model.{key}": value for piece in pieces for key, value in piece.items()}
    if text != DECLARED:
        changes["name"] = f"{scenario.name}-{_as_name(text)}"[:100]
    changes["expect"] = {}  # what was expected of the scenario's own design need not hold for another
    try:
        return scenario.with_(changes)
    except BadInput as error:
        raise BadInput("\n".join(f"--variant {text}: {line}" for line in str(error).splitlines())) from None


def _changes(piece: str) -> dict[str, Any]:
    """Dotted keys of `design_model` and their values."""
    if piece in VARIANTS:
        return VARIANTS[piece]
    key, equals, value = piece.partition("=")
    if not equals:
        raise BadInput(
            f"--variant {piece}: no such variant, "
            f"allowed: {', '.join(VARIANTS)}, or key=value of design_model"
        )
    return {key: _value(piece, value)}


def _value(piece: str, text: str) -> Any:
    import yaml

    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        value = None
    if not isinstance(value, bool | int | float):
        raise BadInput(f"--variant {piece}: {text!r} is no value, allowed: a number, true or false")
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _as_name(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in text)
