"""Where the aircraft and the built-in scenarios live: in an installed wheel, or at the repository's root."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_INSTALLED = _PACKAGE / "data"


def data_root() -> Path:
    """The folder that holds `aircraft/` and `scenarios/`; JSBSim's root directory."""
    return _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parents[1]
