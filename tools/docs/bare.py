"""Numbers in prose that no command prints: what is left to be marked, cited or left out.

Not counted: code, equations, what stands between marks, headings, links, dates, versions, numbers of
sections, equations, figures and tables, and sentences or rows of a table that cite a source. A whole number
up to twelve is a word in figures.
"""

import re
from collections.abc import Iterator

from tools.docs.marks import Page

_LEFT_OUT = re.compile(
    r"^ *(`{3,}|~{3,}).*?^ *\1`* *$"  # fenced code
    r"|^ {4}(?![-*\d])[^\n]*$"  # indented code
    r"|^#+ [^\n]*$"
    r"|<!-- printed:.*?<!-- /printed -->"
    r"|<!--=.*?<!--/-->"
    r"|<!--.*?-->"
    r"|\$\$.*?\$\$|\$[^$\n]+\$"
    r"|``.*?``|`[^`]+`"
    r"|\]\([^)]*\)|https?://\S+"
    r"|\b\d{4}-\d\d(?:-\d\d)?\b"  # dates
    r"|\b[vV]?\d+\.\d+\.\d+\S*"  # versions
    r"|\b(?:section|sections|eq\.|equation|equations|fig\.|figure|figures|table|row|rows|step|part|page|Python|C"
    r"|version)s? \(?\d+[\d.a-z]*\)?(?:(?:,| and| to|-) ?\(?\d+[\d.a-z]*\)?)*",
    re.MULTILINE | re.DOTALL | re.IGNORECASE,
)
_NUMBER = re.compile(r"(?<![\w.^_-])[-−]?\d[\d.,]*(?:e[+-]?\d+)?(?![\w.-]*\w-?\d)")
_CITES = re.compile(r"\[[A-Z][\w-]*\d[\w-]*\b[^\]]*\]|\[[A-Z]{2,}\]")
_SENTENCE = re.compile(r"(?<=[.:;])(?<!sec\.)(?<!eq\.)(?<!fig\.)\s+|\n\s*\n|\n(?=[-|])")
_WORDS = 12


def numbers(page: Page) -> Iterator[tuple[int, str]]:
    """(line, sentence) of each sentence of the page with a number that no command prints."""
    prose = _LEFT_OUT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), page.text)
    start = 0
    for end in [*(found.end() for found in _SENTENCE.finditer(prose)), len(prose)]:
        sentence = prose[start:end]
        if not _CITES.search(page.text[start:end]):
            found = [number for number in _NUMBER.finditer(sentence) if _is_measured(number[0])]
            if found:
                line = prose.count("\n", 0, start + found[0].start()) + 1
                yield line, " ".join(page.text[start:end].split())
        start = end


def _is_measured(number: str) -> bool:
    """Whether it is more than a count of few."""
    text = number.rstrip(".,").replace(",", "")
    return not (text.isdigit() and int(text) <= _WORDS)
