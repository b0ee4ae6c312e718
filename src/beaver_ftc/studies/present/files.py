"""What a study leaves in its folder: for each file its content, or how it is made of those before it."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Content = Any  # text, bytes, a figure, a folder of these, or a function that makes one, given the folder
Files = Mapping[str, Content]


def write_files(folder: Path, files: Files) -> None:
    """Write each file of a folder, in order; a content of None is no file."""
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        _write(folder / name, content)


def _write(path: Path, content: Content) -> None:
    if isinstance(content, Mapping):
        write_files(path, content)
    elif isinstance(content, str):
        path.write_text(content, encoding="utf-8")
    elif isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, Callable):  # type: ignore[arg-type]
        _write(path, content(path.parent))
    elif content is not None:
        save(content, path)


def save(figure: "Figure", path: Path) -> Path:
    """Write a figure as PNG or SVG; the same figure gives the same bytes."""
    from matplotlib import rc_context

    svg = path.suffix == ".svg"
    metadata = {"Date": None, "Creator": "beaver-ftc"} if svg else {"Software": "beaver-ftc"}
    with rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path, metadata=metadata)
    return path
