"""Where the aircraft and the built-in scenarios live: in an installed wheel, or at the repository's root."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

_VERSIONS_KEPT = 5
_PACKAGE = Path(__file__).resolve().parents[1]
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


def cache_base() -> Path | None:
    """The user's folder for compiled code; None where nothing can be written."""
    return next((folder for folder in _candidates() if _is_writable(folder)), None)


def _candidates() -> Iterator[Path]:
    """Folders that may keep compiled code, best first."""
    if "NUMBA_CACHE_DIR" in os.environ:
        yield Path(os.environ["NUMBA_CACHE_DIR"])
    with contextlib.suppress(RuntimeError):  # no home at all
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "beaver-ftc"
    with contextlib.suppress(FileNotFoundError):  # nor anywhere for temporary files
        yield Path(tempfile.gettempdir()) / f"beaver-ftc-{_user()}"


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _is_writable(folder: Path) -> bool:
    """Whether the folder is ours to write. Code is loaded from it, so nobody else may own it."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return os.access(folder, os.W_OK) and folder.stat().st_uid == _user()
    except OSError:
        return False


def folder_of_version(base: Path, version: str) -> Path:
    """The folder of one version's code. Before a new one comes, old ones go."""
    if not (base / version).exists():
        _discard_old(base)
    return base / version


def _discard_old(base: Path) -> None:
    """Remove what earlier versions have left, but for the latest: someone may be flying with them."""
    folders = [folder for folder in base.glob("[0-9a-f]" * 16) if folder.is_dir()]
    folders.sort(key=lambda folder: folder.stat().st_mtime, reverse=True)
    for folder in folders[_VERSIONS_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)
