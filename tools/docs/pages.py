"""Where the pages are, and what is known of a place on them."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from beaver_ftc.documents.errors import BadInput, suggestion

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Finding:
    """What is wrong at a line of a page, in one line; or, if it is only said, what a reader should know."""

    page: str
    line: int
    words: str
    said: bool = False

    def __str__(self) -> str:
        return f"{self.page}:{self.line}: {self.words}"


COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


def blanked(text: str, *patterns: re.Pattern[str]) -> str:
    """As many lines and letters, with blanks in the place of what these find."""
    for pattern in patterns:
        text = pattern.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    return text


def every_page(root: Path) -> list[Path]:
    """README and every page of docs/."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def is_generated(text: str) -> bool:
    """Whether a page is printed as a whole: its text comes from code, whose tests hold it."""
    return text.startswith("<!-- printed: python -m tools.docs reference ")


def chosen(names: Iterable[str], root: Path = ROOT) -> list[Path]:
    """The pages of these names (`docs/explanation/detection.md`, `detection.md` or `detection`),
    all of them without any.

    Raises BadInput for a name that no page has.
    """
    known: dict[str, Path] = {}
    for page in every_page(root):
        known.update({page.relative_to(root).as_posix(): page})
        known.setdefault(page.name, page)
        known.setdefault(page.stem, page)
    found = list(dict.fromkeys(names))
    for name in found:
        if name not in known:
            pages = [page.relative_to(root).as_posix() for page in every_page(root)]
            raise BadInput(f"{name}: no such page{suggestion(name, pages)}")
    return [known[name] for name in found] or every_page(root)
