"""The rows of the compiled schemes: which file of kernels each name of plugins.yaml has."""

from beaver_ftc.plugins import DETECTORS, compiled_rows

_ROWS = compiled_rows(DETECTORS)
_PLUGGED = f"{__package__}.plugged"  # of all schemes that are Python plug-ins
MODULES = (*dict.fromkeys(row["kernels"] for row in _ROWS.values()), _PLUGGED)  # in the order of their places
PLUGGED = MODULES.index(_PLUGGED)


def place_of(name: str) -> int:
    """The place of a scheme's kernels among MODULES."""
    return MODULES.index(_ROWS[name]["kernels"]) if name in _ROWS else PLUGGED
