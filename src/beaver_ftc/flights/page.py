"""What the pages of recorded flights share: one style, one set of colours."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template

_TEMPLATES = Path(__file__).parent / "templates"
COLOURS = ("#0b5fa5", "#b5500b", "#2f7d32", "#7b3fa0", "#8a6d00", "#a0305a", "#3d7a8a", "#555555")


@cache
def template(name: str) -> "Template":
    """A page's template by its file name."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = Environment(loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined)
    return loader.get_template(name)
