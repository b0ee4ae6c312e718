"""The generated reference: pages made of what they describe, for the web site and for a terminal."""

from collections.abc import Callable

from beaver_ftc.documents.errors import BadInput, suggestion
from tools.docs import properties
from tools.docs.reference import columns, commands, keys

# Name of each page, and what prints it; the order is that of the site.
PAGES: dict[str, Callable[[], str]] = {
    **{name: lambda of=of: keys.page(*of) for name, of in keys.PAGES.items()},  # type: ignore[misc]
    "columns": columns.page,
    "commands": commands.page,
    "properties": properties.as_markdown,
}


def page(name: str = "") -> str:
    """The Markdown of a page. Raises BadInput for a name that none has."""
    if name not in PAGES:
        raise BadInput(f"reference: there is no page {name[:60]!r}{suggestion(name, PAGES)}")
    return PAGES[name]()
