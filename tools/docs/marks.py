"""The marks of a page: which command prints a block, a table or a number, and where it stands.

    <!-- printed: COMMAND -->            a block, up to <!-- /printed -->
    <!-- from NAME: COMMAND -->          a document in JSON, of which numbers of the page are taken
    <!--=NAME path.to.value .2f-->0.12<!--/-->

After a command: `| dear | probe: COMMAND | needs NAME | machine | at REVISION DATE DIGEST`. In fenced code,
marks are text.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from tools.docs.pages import ROOT, Finding
from tools.docs.values import Place

_COMMENT = re.compile(r"<!--.*?(?:-->|$)")
_PRINTED = re.compile(r"<!-- printed: (\S.*?) -->")
_FROM = re.compile(r"<!-- from ([\w-]+): (\S.*?) -->")
_END = "<!-- /printed -->"
_NUMBER = re.compile(r"<!--=(.*?)-->(.*?)<!--/-->")
_FENCE = re.compile(r" *(`{3,}|~{3,})")
_BEGINS = re.compile(r"\s*(?:[-*+>]|\d+\.)?\s*<!--=")
_OPTION = re.compile(
    r"(?P<dear>dear)|probe: (?P<probe>.+)|needs (?P<needs>[A-Z_]+)|(?P<machine>machine)"
    r"|at (?P<at>\S+ \d{4}-\d\d-\d\d \S+)"
)
_OPTIONS = "allowed: dear, probe: COMMAND, needs NAME, machine, at REVISION DATE DIGEST"
_ALLOWED = "allowed: printed: COMMAND, /printed, from NAME: COMMAND, =NAME path format, /"


@dataclass(frozen=True)
class Origin:
    """What prints something: a command, and if it is dear, what is known of the last time it did.

    probe: a cheap command whose output changes with that of the command. needs: the environment variable that
    leads to data which the repository has not. at: revision, date, and digest of what the probe printed.
    """

    command: str
    dear: bool = False
    probe: str = ""
    needs: str = ""
    at: tuple[str, ...] = ()


@dataclass(frozen=True)
class Printed:
    """What a command prints, by the mark at `mark`: of a block, from begin to end of the text; of a document
    of which numbers are taken, nowhere."""

    origin: Origin
    line: int
    mark: tuple[int, int]
    begin: int = 0
    end: int = 0


@dataclass(frozen=True)
class Number:
    """A number in prose: where it stands, and how it is taken out of a document."""

    name: str
    place: Place
    line: int
    begin: int
    end: int


@dataclass
class Page:
    """A page with its marks, and what is wrong with them."""

    name: str
    text: str
    blocks: list[Printed] = field(default_factory=list)
    documents: dict[str, Printed] = field(default_factory=dict)  # by the name that numbers call it by
    numbers: list[Number] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    @property
    def origins(self) -> list[Origin]:
        """Of every block and document."""
        return [one.origin for one in (*self.blocks, *self.documents.values())]

    def wrong(self, line: int, words: str) -> None:
        """Note what is wrong."""
        self.findings.append(Finding(self.name, line, words))


def read(path: Path, root: Path = ROOT) -> Page:
    """Read a page and its marks."""
    return parsed(path.read_text(encoding="utf-8"), path.relative_to(root).as_posix())


def parsed(text: str, name: str) -> Page:
    """The marks of a page's text."""
    page = Page(name, text)
    opened: Printed | None = None
    for number, start, line in _outside_fences(text):
        begins = _PRINTED.fullmatch(line.strip())
        if opened is not None:
            if line.strip() == _END:
                page.blocks.append(replace(opened, end=start))
                opened = None
            elif "<!--" in line:
                page.wrong(number, f"a mark inside what is printed: {line.strip()}, allowed: {_END}")
            continue
        if begins:
            origin = _origin(begins[1], page, number)
            opened = Printed(origin, number, (start, start + len(line)), start + len(line) + 1)
        else:
            _read_line(page, number, start, line)
    if opened is not None:
        page.wrong(opened.line, f"what is printed has no end, allowed: {_END} on a line of its own")
    _match_numbers(page)
    return page


def _outside_fences(text: str) -> Iterator[tuple[int, int, str]]:
    """(number, start, line) of each line that is not of a fenced block."""
    start, fence = 0, ""
    for number, line in enumerate(text.split("\n"), 1):
        opens = _FENCE.match(line)
        if fence:
            fence = "" if line.strip() == fence else fence
        elif opens:
            fence = opens[1]
        else:
            yield number, start, line
        start += len(line) + 1


def _read_line(page: Page, number: int, start: int, line: str) -> None:
    """The marks of a line outside of what is printed."""
    document = _FROM.fullmatch(line.strip())
    if document:
        if document[1] in page.documents:
            page.wrong(number, f"a second document is called {document[1]}, allowed: one of each name")
        origin = _origin(document[2], page, number)
        page.documents[document[1]] = Printed(origin, number, (start, start + len(line)))
        return
    if _BEGINS.match(line):
        page.wrong(
            number, "a number's mark begins the line and makes it HTML, allowed: a word or | before it"
        )
    for found in _NUMBER.finditer(line):
        _read_number(page, number, start, found)
    rest = _NUMBER.sub("", line)
    for comment in _COMMENT.findall(rest):
        page.wrong(number, f"no mark: {comment}, {_ALLOWED}")


def _read_number(page: Page, line: int, start: int, found: re.Match[str]) -> None:
    try:
        name, _, words = found[1].partition(" ")
        begin, end = start + found.start(2), start + found.end(2)
        page.numbers.append(Number(name, Place.read(words), line, begin, end))
    except ValueError:
        page.wrong(line, f"no mark of a number: {found[0]}, allowed: <!--=NAME path.to.value *100 .2f-->")


def _origin(text: str, page: Page, line: int) -> Origin:
    """A command with its options; what is wrong with them is noted."""
    command, dear, words = text.partition(" | dear")
    found: dict[str, str] = {}
    for word in words.split(" | ")[1:]:
        option = _OPTION.fullmatch(word)
        if option is None:
            page.wrong(line, f"no option of what is dear: {word}, {_OPTIONS}")
        else:
            found |= {str(option.lastgroup): option[str(option.lastgroup)]}
    if dear and not found.keys() - {"at"}:
        page.wrong(line, f"dear without a probe: {command}, allowed: | dear | probe: COMMAND")
    at = tuple(found.get("at", "").split())
    return Origin(command, bool(dear), found.get("probe", ""), found.get("needs", ""), at)


def _match_numbers(page: Page) -> None:
    """Every number is of a document of the page, every document has a number."""
    for number in page.numbers:
        if number.name not in page.documents:
            known = ", ".join(page.documents) or "none; <!-- from NAME: COMMAND --> makes one"
            page.wrong(number.line, f"no document is called {number.name}, allowed: {known}")
    used = {number.name for number in page.numbers}
    for name, document in page.documents.items():
        if name not in used:
            page.wrong(document.line, f"no number is taken from {name}, allowed: a document that one is from")
    page.numbers = [number for number in page.numbers if number.name in page.documents]
