"""`python -m tools.words`: avoided terms in identifiers, docstrings, comments, messages and pages.

The table *Avoided terms* of WORDS.md is what is looked for, the table *Exceptions* where a term may stand.
The table *Avoided in a folder* has terms that are looked for there alone. A term of several words is looked
for in text alone. Exit status 1 if there is a finding.
"""

import io
import re
import sys
import tokenize
from collections.abc import Iterator
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = "WORDS.md"
CODE = ("src/**/*.py", "tools/**/*.py")
PAGES = ("*.md", "docs/**/*.md")
UNREAD = (PAGE, "CHANGELOG.md", "tools/words.py")  # they quote the terms, or earlier texts
_TEXT = {tokenize.COMMENT, tokenize.STRING}
_PARTS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def rows(heading: str, text: str) -> list[list[str]]:
    """The cells of each row of the first table below a heading of WORDS.md."""
    section = text.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def _terms(cell: str) -> list[str]:
    return [term.strip() for term in cell.split(",")]


@cache
def rules(text: str) -> list[tuple[str, re.Pattern[str], str, list[str]]]:
    """(avoided term, what finds it, pattern of the files, those of files where it may stand)."""
    excepted = [(term, place) for term, where, _ in rows("Exceptions", text) for place in _terms(where)]
    everywhere = [(term, "*") for avoid, *_ in rows("Avoided terms", text) for term in _terms(avoid)]
    there = [(term, where) for avoid, where, _ in rows("Avoided in a folder", text) for term in _terms(avoid)]
    found = [(term, where, [at for of, at in excepted if of == term]) for term, where in everywhere]
    found += [(term, where, []) for term, where in there]
    return [
        (term, re.compile(rf"\b{re.escape(term).replace(re.escape('*'), '[a-z]*')}\b", re.IGNORECASE), *rest)
        for term, *rest in found
    ]


def _code(text: str) -> Iterator[tuple[int, str]]:
    """(line, words) of identifiers, comments and strings; an identifier as its parts."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            yield token.start[0], " ".join(_PARTS.findall(token.string))
        elif token.type in _TEXT:
            for i, line in enumerate(token.string.splitlines()):
                yield token.start[0] + i, line.replace("_", " ")


def _page(text: str) -> Iterator[tuple[int, str]]:
    """(line, words) of a page: all of it, code blocks too, which people read as well."""
    yield from enumerate(text.splitlines(), 1)


def findings(name: str, text: str, words: str) -> list[str]:
    """What a file has of the avoided terms, one line each; name: below the root, words: of WORDS.md."""
    wanted = [
        (term, pattern)
        for term, pattern, where, excepted in rules(words)
        if fnmatchcase(name, where) and not any(fnmatchcase(name, place) for place in excepted)
    ]
    read = _code if name.endswith(".py") else _page
    return list(
        dict.fromkeys(
            f"{name}:{line}: {term!r}: see {PAGE}"
            for line, said in read(text)
            for term, pattern in wanted
            if pattern.search(said)
        )
    )


def main() -> int:
    """Print the findings; 1 if there is one."""
    words = (ROOT / PAGE).read_text(encoding="utf-8")
    names = sorted(
        {path.relative_to(ROOT).as_posix() for of in (*CODE, *PAGES) for path in ROOT.glob(of)} - {*UNREAD}
    )
    found = [
        one for name in names for one in findings(name, (ROOT / name).read_text(encoding="utf-8"), words)
    ]
    for one in found:
        print(one)
    print(f"{len(names)} files, {len(found)} findings")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
