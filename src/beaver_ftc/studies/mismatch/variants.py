"""Variants of a scenario with another `design_model`.

A variant is a name of VARIANTS, or key=value of `design_model`, or several of these joined by +, such as
`linearised+coefficients.Cm_alpha=0.9`.
"""

import re

import yaml

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.scenario.schema import Scenario

DECLARED = "declared"
VARIANTS: dict[str, Document] = {
    DECLARED: {},
    "engine-neglected": {"engine_terms": False},
    "linearised": {"linearised": True},
    "frozen-alpha": {"frozen_alpha": True},
    "heavy": {"mass": 1.1},
}


def variant_of(scenario: Scenario, text: str) -> Scenario:
    """The scenario with one variant's design model, named after both. Raises BadInput for an unknown one."""
    pieces = [_changes(piece.strip()) for piece in text.split("+")]
    changes = {f"design_model.{key}": value for piece in pieces for key, value in piece.items()}
    if text != DECLARED:
        ending = re.sub(r"[^\w-]", "-", text)
        changes["name"] = f"{scenario.name}-{ending}"[:100]
    changes["expect"] = {}  # expectations hold for the declared design model alone
    try:
        return scenario.with_(changes)
    except BadInput as error:
        raise BadInput("\n".join(f"--variant {text}: {line}" for line in str(error).splitlines())) from None


def _changes(piece: str) -> Document:
    """Keys of `design_model` and values, of a name of VARIANTS or of a text `key=value`."""
    if piece in VARIANTS:
        return VARIANTS[piece]
    key, equals, text = piece.partition("=")
    if not equals:
        raise BadInput(
            f"--variant {piece}: no such variant, "
            f"allowed: {', '.join(VARIANTS)}, or key=value of design_model"
        )
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        value = None
    if not isinstance(value, bool | int | float):
        raise BadInput(f"--variant {piece}: {text!r} is no value, allowed: a number, true or false")
    return {key: value if isinstance(value, bool) else float(value)}
