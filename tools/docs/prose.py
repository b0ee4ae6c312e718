"""How pages are written: tables have captions, symbols are in the glossary, a page ends with the next step.
On pages of results, a command prints the numbers of prose.

Numbers that need no command: in code and equations, between marks, in headings and links, dates, versions,
numbers of sections, equations, figures and tables, and in sentences or rows of a table that cite a source. A
whole number up to twelve is a word in figures.
"""

import re
from collections.abc import Iterator, Sequence
from functools import cache

from tools.docs.marks import Page
from tools.docs.pages import COMMENT, ROOT, Finding, blanked, is_generated

GLOSSARY = ROOT / "docs/reference/glossary.md"
RESULTS = "docs/results/"
_HOME = ("README.md", "docs/README.md")  # they are the way to all pages
_FENCE = re.compile(r"^ *(`{3,}|~{3,}).*?^ *\1`* *$", re.MULTILINE | re.DOTALL)
_RULE = re.compile(r"^\|(?: ?:?-+:? ?\|)+$")
_MATHS = re.compile(r"\$\$(.+?)\$\$|(?<!\$)\$([^$\n]+?)\$(?!\$)", re.DOTALL)
_WORDS_IN_MATHS = re.compile(r"\\(?:text|mathrm|begin|end|operatorname|tag)\{[^}]*\}|`[^`]*`")
_INDEX = re.compile(r"[_^](?:\{[^{}]*\}|\\\w+|.)")
_GREEK = (
    r"(?:var)?(?:alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|phi|psi|omega"
    r"|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Phi|Psi|Omega)"
)
_SYMBOL = re.compile(rf"\\{_GREEK}(?![A-Za-z])|(?<![\\A-Za-z])[A-Za-z]+")
_NO_SYMBOLS = frozenset(("sin", "cos", "tan", "exp", "ln", "log", "max", "min", "deg", "rad", "Hz"))
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


def check(pages: Sequence[Page]) -> list[Finding]:
    """A finding for each place where a page breaks a rule."""
    written = (page for page in pages if not is_generated(page.text))
    return [Finding(page.name, *found) for page in written for found in faults(page)]


def faults(page: Page) -> Iterator[tuple[int, str]]:
    """(line, what is wrong) of a page."""
    text = blanked(page.text, _FENCE, COMMENT)
    yield from _tables(text)
    yield from _symbols(text)
    if page.name.startswith("docs/") and page.name not in _HOME and not _names_a_next_step(text):
        says = "the page names no next step, allowed: a last section `## Next` with a link"
        yield text.count("\n"), says
    for line, words in numbers(page.text) if page.name.startswith(RESULTS) else ():
        yield line, f'a number that no command prints: "{words[:80]}", allowed: a mark, or no number'


def _names_a_next_step(text: str) -> bool:
    last = text.rpartition("\n## ")[2]
    return last.startswith("Next\n") and "](" in last


def _tables(text: str) -> Iterator[tuple[int, str]]:
    """Tables whose paragraph above is no caption."""
    lines = text.split("\n")
    for number, line in enumerate(lines):
        if _RULE.match(line.strip()) and number:
            above = "\n".join(lines[: number - 1]).rstrip()
            paragraph = re.split(r"\n\s*\n", above)[-1].strip()
            if not re.fullmatch(r"\*Table \d+\. .*\*", paragraph, re.DOTALL):
                head = lines[number - 1].strip()
                yield number, f"no caption above the table {head[:60]}, allowed: *Table N. Sentence.*"


@cache
def known_symbols() -> frozenset[str]:
    """The symbols of the tables of the glossary, without index and accent."""
    found: set[str] = set()
    for line in GLOSSARY.read_text(encoding="utf-8").splitlines():
        if line.startswith("|"):
            found.update(symbol for cell in line.split("|")[1:3] for symbol in symbols_of(cell))
    return frozenset(found)


def symbols_of(text: str) -> Iterator[str]:
    """The symbols of each formula in a text, without index and accent."""
    for found in _MATHS.finditer(text):
        formula = _WORDS_IN_MATHS.sub(" ", found[1] or found[2])
        formula = re.sub(r"\\(?:d|t)?frac(\d)(\d)|\\frac(\w)(\w)", r" \3 \4 ", formula)
        while (bare := _INDEX.sub(" ", formula)) != formula:
            formula = bare
        for symbol in _SYMBOL.findall(formula):
            if symbol.startswith("\\"):
                yield symbol
            elif symbol not in _NO_SYMBOLS:  # other words are set letter by letter
                yield from [symbol] if symbol in ("dt", "tol") else symbol


def _symbols(text: str) -> Iterator[tuple[int, str]]:
    known = known_symbols()
    for found in _MATHS.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        for symbol in dict.fromkeys(symbols_of(found[0])):
            if symbol not in known:
                yield line, f"${symbol}$ is not in docs/reference/glossary.md"


def numbers(text: str) -> Iterator[tuple[int, str]]:
    """(line, sentence) of each sentence with a number that no command prints."""
    prose = blanked(text, _LEFT_OUT)
    start = 0
    for end in [*(found.end() for found in _SENTENCE.finditer(prose)), len(prose)]:
        sentence = prose[start:end]
        if not _CITES.search(text[start:end]):
            found = [number for number in _NUMBER.finditer(sentence) if _is_measured(number[0])]
            if found:
                line = prose.count("\n", 0, start + found[0].start()) + 1
                yield line, " ".join(text[start:end].split())
        start = end


def _is_measured(number: str) -> bool:
    """Whether it is more than a count of few."""
    text = number.rstrip(".,").replace(",", "")
    return not (text.isdigit() and int(text) <= _WORDS)
