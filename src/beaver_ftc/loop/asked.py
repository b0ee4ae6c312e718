"""What is asked of a flight in progress: numbers that are none, names that are nearly right."""

from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import Plant

Vector = NDArray[np.float64]


def near(name: str, plant: Plant) -> str:
    """The property of JSBSim's that was meant, as a question; nothing if none is near."""
    catalogue: Any = plant.fdm.query_property_catalog("")
    known = [line.split(" ")[0] for line in catalogue.splitlines()]
    match = get_close_matches(str(name), known, n=1)
    return f", did you mean {match[0]}?" if match else ""


def vector(given: ArrayLike, size: int, what: str, unit: str) -> Vector:
    """So many finite numbers, or BadInput."""
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (size,) or not np.isfinite(array).all():
        shown = " ".join(repr(given).split())
        raise BadInput(f"{what}: {shown:.80} is not usable, allowed: {size} finite numbers, {unit}")
    return array
