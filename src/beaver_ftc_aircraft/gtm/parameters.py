"""What the tables do not say of the aircraft: parameters.yaml, read once."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

FILE = Path(__file__).with_name("parameters.yaml")
OUTPUTS = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
GEAR = "gear/down"  # 0: up, else down
DAMAGE_CASE = "failures/damage-case"  # 0: none, else the number of the case


@lru_cache(maxsize=1)
def parameters() -> dict[str, Any]:
    """The whole file."""
    found: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return found


def surfaces(kind: str) -> dict[str, dict[str, Any]]:
    """The surfaces of a kind."""
    return {name: of for name, of in parameters()["surfaces"].items() if of["kind"] == kind}


def cases() -> dict[str, dict[str, Any]]:
    """The damage there is, in the order of its numbers, from 1."""
    found: dict[str, dict[str, Any]] = parameters()["damage"]
    return found


def can_be_taken() -> tuple[str, ...]:
    """Surfaces that some damage takes away."""
    return tuple(
        name for name in parameters()["surfaces"] if any(name in of["takes"] for of in cases().values())
    )
