"""The standard sets, and the leaderboard made from them."""

from pathlib import Path
from typing import Any

from beaver_ftc.studies.compare.table import as_markdown

Document = dict[str, Any]

MARK = "<!-- everything below is written by `beaver-ftc compare --benchmark` -->"


def write_leaderboard(document: Document, path: Path) -> None:
    """Replace what stands below the mark; what stands above it was written by hand and stays."""
    above = path.read_text(encoding="utf-8").partition(MARK)[0] if path.exists() else "# Benchmark\n\n"
    versions = ", ".join(f"{name} {version}" for name, version in document["versions"].items())
    path.write_text(f"{above}{MARK}\n\nMade with {versions}.\n\n{as_markdown(document)}", encoding="utf-8")
