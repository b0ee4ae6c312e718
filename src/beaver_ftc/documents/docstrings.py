"""What a docstring says of the parts of what it describes: of a command's options, of a section's keys."""

import re
from collections.abc import Iterable
from inspect import cleandoc


def split_docstring(docstring: str | None, names: Iterable[str]) -> tuple[str | None, dict[str, str]]:
    """The docstring without its end, and what it says there of each of these names: `name: ...`."""
    if docstring is None:
        return None, {}
    about, *said = re.split(rf"^({'|'.join(names)}): ", cleandoc(docstring), flags=re.MULTILINE)
    return about.rstrip(), {
        name: " ".join(text.split()) for name, text in zip(said[::2], said[1::2], strict=True)
    }
