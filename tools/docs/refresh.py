"""Pages with what their commands print: written again, or compared with what stands."""

import hashlib
import json
import os
import re
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import zip_longest
from typing import Any

from beaver_ftc.documents.errors import BadInput
from tools.docs import pictures, values
from tools.docs.commands import Output, outputs
from tools.docs.dress import dressed, linked
from tools.docs.kept import Kept
from tools.docs.marks import Origin, Page, Printed
from tools.docs.pages import ROOT, Finding

DECIDES = ("src", "aircraft", "scenarios")  # what a number of a flight depends on
_AT = re.compile(r"(?: \| at [^|]*)? -->$")  # at the end of a mark: when it was flown
_LONGEST = 90  # of what is quoted in a finding


@dataclass(frozen=True)
class Wanted:
    """Which commands are run: of cheap origins, of dear ones that `dear` says, and probes of the others."""

    dear: bool = False
    probes: bool = False
    only: str = ""
    again: bool = False  # also what is kept of an earlier run

    def flies(self, origin: Origin) -> bool:
        """Whether the command itself is run, not its probe."""
        return not origin.dear or (self.dear and self.only in origin.command and not missing(origin))

    def commands(self, origins: Iterable[Origin]) -> tuple[list[str], list[str]]:
        """(cheap, dear) command lines of these origins."""
        cheap: list[str] = []
        dear: list[str] = []
        for origin in origins:
            if self.flies(origin):
                (dear if origin.dear else cheap).append(origin.command)
            if origin.probe and (self.probes or (origin.dear and self.flies(origin))):
                cheap.append(origin.probe)
        return cheap, dear


def missing(origin: Origin) -> str:
    """What an origin needs that is not here."""
    return origin.needs if origin.needs and not os.environ.get(origin.needs) else ""


def outputs_of(pages: Sequence[Page], wanted: Wanted) -> dict[str, Output]:
    """{command: what it printed} of what the pages' marks want; cheap ones run if nothing of them is kept."""
    origins = [origin for page in pages for origin in page.origins]
    cheap, dear = wanted.commands(origins)
    needed = {origin.needs for origin in origins}
    kept = Kept(needed)
    known = {} if wanted.again else {line: found for line in set(cheap) if (found := kept.get(line))}
    printed = outputs([line for line in cheap if line not in known], set(dear), needed)
    for line in set(cheap) & printed.keys():
        kept.put(line, printed[line])
    return known | printed


class Refreshed:
    """A page with everything that was printed in its place. changes: where it differs from what stood; drawn:
    pictures that look otherwise than what lies in docs/images.
    """

    def __init__(self, page: Page, printed: dict[str, Output], wanted: Wanted) -> None:
        self.page, self.printed, self.wanted = page, printed, wanted
        self.findings = list(page.findings)
        self.changes: list[Finding] = []
        self.drawn: dict[str, bytes] = {}
        self._edits: list[tuple[int, int, str]] = []
        self._documents: dict[str, Any] = {}
        for block in page.blocks:
            self._block(block)
        for name, document in page.documents.items():
            self._document(name, document)
        for number in page.numbers:
            self._number(number)
        self.findings.sort(key=lambda finding: finding.line)
        self.changes.sort(key=lambda finding: finding.line)

    @property
    def text(self) -> str:
        """The page again."""
        text = self.page.text
        for begin, end, new in sorted(self._edits, reverse=True):
            text = text[:begin] + new + text[end:]
        return text

    def _block(self, block: Printed) -> None:
        output = self._output(block)
        if output is None:
            return
        old = self.page.text[block.begin : block.end]
        new = dressed(old, linked(output.text, self.page.name), block.origin.command)
        self._put(block.begin, block.end, new, block.origin.command)
        self._pictures(block, output, moved=new != old)

    def _document(self, name: str, document: Printed) -> None:
        output = self._output(document)
        if output is None:
            return
        try:
            self._documents[name] = json.loads(output.text)
        except json.JSONDecodeError as error:
            self._find(document.line, f"{document.origin.command} prints no JSON: {error}")

    def _number(self, number: Any) -> None:
        if number.name not in self._documents:
            return
        try:
            new = values.printed(self._documents[number.name], number.place)
        except BadInput as error:
            self._find(number.line, f"{number.name} {error}")
            return
        command = self.page.documents[number.name].origin.command
        what = f"{number.name} {number.place.path} of {command}"
        self._put(number.begin, number.end, new, what)

    def _output(self, made: Printed) -> Output | None:
        """What its command printed, if it was run and can be used."""
        origin = made.origin
        output = self.printed[origin.command] if self.wanted.flies(origin) else None
        if output is not None and output.fault:
            self._find(made.line, f"{origin.command} {output.fault}")
            return None
        if origin.dear:
            self._dear(made)
        return output

    def _dear(self, made: Printed) -> None:
        """Flown: when, and by what code. Not flown: whether it is of today's code."""
        origin, probe = made.origin, self.printed.get(made.origin.probe)
        if probe is not None and probe.fault:
            self._find(made.line, f"{origin.probe} {probe.fault}")
            return
        digest = digest_of(probe.text) if probe else "-"
        if self.wanted.flies(origin):
            at = f" | at {revision()} {datetime.now(UTC):%Y-%m-%d} {digest} -->"
            self._edits.append((*made.mark, _AT.sub(at, self.page.text[slice(*made.mark)])))
        elif missing(origin):
            self._find(made.line, f"{origin.command} is not checked: it needs {origin.needs}", said=True)
        elif not origin.at:
            self._find(made.line, f"never printed: python -m tools.docs {self.page.name} --dear")
        elif probe is not None and origin.at[2] != digest:
            says = f"not flown again since {origin.at[0]}"
            self._find(
                made.line,
                f"the probe has changed, {origin.at[2]} stands, {digest} is printed by {origin.probe}: "
                f"python -m tools.docs {self.page.name} --dear, or a sentence in the page: {says}",
                said=says in self.page.text.replace("`", ""),
            )
        elif changed_since(origin.at[0]):
            since = f"{origin.at[0]} ({origin.at[1]})"
            self._find(made.line, f"the code has changed since {since}: {origin.command}", said=True)

    def _put(self, begin: int, end: int, new: str, command: str) -> None:
        """Put text in the place of what stands, and note where they differ first."""
        old = self.page.text[begin:end]
        self._edits.append((begin, end, new))
        if old == new:
            return
        row, stands, prints = _first_difference(old, new)
        at = self.page.text.count("\n", 0, begin) + 1 + row
        words = f"stands {_quoted(stands)}, printed {_quoted(prints)} by {command}"
        self.changes.append(Finding(self.page.name, at, words))

    def _pictures(self, block: Printed, output: Output, moved: bool) -> None:
        """Take what is drawn where it looks different, or where the text beside it says other numbers: a
        marker that has moved is too few pixels to be noticed by itself."""
        for name, content in output.pictures.items():
            path = ROOT / "docs" / "images" / name
            if moved or not pictures.look_the_same(path, content):
                self.drawn[name] = content
                words = f"docs/images/{name} is not what is drawn by {block.origin.command}"
                self.changes.append(Finding(self.page.name, block.line, words))

    def _find(self, line: int, words: str, said: bool = False) -> None:
        self.findings.append(Finding(self.page.name, line, words, said))


def _first_difference(old: str, new: str) -> tuple[int, str, str]:
    """(row, what stands, what is printed) where two texts differ first."""
    rows = enumerate(zip_longest(old.splitlines(), new.splitlines(), fillvalue=""))
    return next(((row, *both) for row, both in rows if both[0] != both[1]), (0, old, new))


def _quoted(text: str) -> str:
    text = text.strip()
    return f'"{text[:_LONGEST]}{"..." if len(text) > _LONGEST else ""}"' if text else "nothing"


def digest_of(text: str) -> str:
    """What a mark keeps of what a probe printed."""
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _git(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def revision() -> str:
    """The last revision of the code that decides numbers; a + where it has changed since."""
    name = _git("log", "-1", "--format=%h", "--", *DECIDES).stdout.strip() or "unknown"
    return f"{name}+" if changed_since(name) else name


def changed_since(name: str) -> bool:
    """Whether the code that decides numbers has changed since a revision, as far as git knows."""
    return _git("diff", "--quiet", name.rstrip("+"), "--", *DECIDES).returncode != 0


def refreshed(pages: Sequence[Page], wanted: Wanted) -> tuple[list[Refreshed], dict[str, Output]]:
    """The pages with everything that is printed now; and what every command printed."""
    printed = outputs_of(pages, wanted)
    return [Refreshed(page, printed, wanted) for page in pages], printed


def write(made: Refreshed) -> Iterator[str]:
    """Write a page and its pictures again: the files that were written."""
    if made.text != made.page.text:
        (ROOT / made.page.name).write_text(made.text, encoding="utf-8")
        yield made.page.name
    for name, content in made.drawn.items():
        pictures.write(ROOT / "docs" / "images" / name, content)
        yield f"docs/images/{name}"


def slowest(printed: dict[str, Output], count: int) -> list[str]:
    """The commands that take longest, to make the check quicker."""
    ranked = sorted(printed.items(), key=lambda entry: -entry[1].processor_s)
    return [f"{output.processor_s:6.1f} s  {line}" for line, output in ranked[:count]]
