"""What the pages of recorded flights share: one style."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template

_TEMPLATES = Path(__file__).parent / "templates"


@cache
def template(name: str) -> "Template":
    """A page's template by its file name."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = Environment(loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined)
    return loader.get_template(name)
