"""How the page is told: faults in words, numbers short, messages as JSON."""

import json
from collections.abc import Mapping
from math import isfinite
from typing import Any

WHEN = {"at_s", "end_s"}  # of a fault: not what it is


def in_words(fault: Mapping[str, Any]) -> str:
    """What is broken, how, and by how much."""
    where = fault.get("sensor", fault.get("actuator", fault["type"]))
    unsaid = {"type", "actuator", "sensor", *WHEN}
    sizes = ", ".join(f"{key} {value}" for key, value in fault.items() if key not in unsaid)
    return f"{where}: {str(fault['type']).replace('_', ' ')}" + (f" ({sizes})" if sizes else "")


def encode(told: dict[str, Any]) -> bytes:
    """One message to a page."""
    return json.dumps(told, separators=(",", ":"), allow_nan=False).encode()


def short(value: float) -> float | None:
    """Seven digits are enough to draw; what is not finite is none."""
    return float(f"{value:.7g}") if isfinite(value) else None
