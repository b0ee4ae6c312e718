"""Where the aircraft and the built-in scenarios live: in an installed wheel, or at the repository's root."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_INSTALLED = _PACKAGE / "data"


def data_root() -> Path:
    """The folder that holds `aircraft/` and `scenarios/`; JSBSim's root directory."""
    return _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parents[1]


def inside(folder: Path, file: str) -> Path | None:
    """A file named in another one, resolved, if it lies in that one's folder or below; None if it does not.

    No absolute path, no `..`, no link that leads out.
    """
    root = folder.resolve()
    try:
        path = (root / file).resolve()
    except (OSError, ValueError, RuntimeError):
        return None
    outside = Path(file).is_absolute() or ".." in Path(file).parts or not path.is_relative_to(root)
    return None if outside else path
