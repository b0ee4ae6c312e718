"""The rows of the compiled schemes: which file of kernels each name of plugins.yaml has."""

from beaver_ftc.plugins import DETECTORS, compiled_rows

_ROWS = compiled_rows(DETECTORS)
MODULES = tuple(dict.fromkeys(row["kernels"] for row in _ROWS.values()))  # in the order of their places
PLUGGED = 0  # the place of the kernels that serve the laws while a plug-in diagnoses


def place_of(name: str) -> int:
    """The place of a scheme's kernels among MODULES."""
    return MODULES.index(_ROWS[name]["kernels"]) if name in _ROWS else PLUGGED
