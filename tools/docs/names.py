"""Names in prose: every word in backticks that looks like a name of this project exists in it.

A function, file, key, column, property, option or command that is gone is a line. Names of others
(numpy's, an autopilot's) stand in `foreign.yaml`, each used on a page. Blocks are not prose: they are run.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from beaver_ftc.documents.errors import nearest
from tools.docs.known import Known, known
from tools.docs.marks import Page
from tools.docs.pages import Finding, is_generated

FOREIGN = Path(__file__).with_name("foreign.yaml")
_FENCED = re.compile(r"^ *(`{3,}|~{3,}).*?^ *\1`* *$", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"^ {4}\S.*$", re.MULTILINE)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_SPAN = re.compile(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)*)`(?!`)")
_WORD = re.compile(r"[A-Za-z_][\w-]*")
_NAME = r"[A-Za-z_][\w-]*"
_DOTTED = re.compile(rf"\.?{_NAME}(?:\[\]|\[\d+\])?(?:\.(?:{_NAME}|\d+)(?:\[\]|\[\d+\])?)*")
_FILLED = re.compile(r"<[\w ]+>|\{[\w, ]+\}|\*|\.\.\.")  # to be filled in by the reader
_CALL = re.compile(rf"\.?({_NAME}(?:\.{_NAME})*)\(.*\)", re.DOTALL)
_FILE = re.compile(
    r"[\w<>*./~{},-]*\.(?:py|md|ya?ml|xml|json|csv|parquet|html|js|png|svg|c|txt|toml|ipynb|bin|cff)"
)
_ITEM = re.compile(rf"""({_NAME}(?:\.{_NAME})*)\[["']([^"']+)["']\]""")
_KEYS = re.compile(rf"({_NAME}(?:\.{_NAME})*):(?!/)(?:\s|$)")
_VALUES = re.compile(rf"(?:: |\[|, )({_NAME})(?=$|,|\]|\}})")
_PROGRAM = re.compile(r"(?:beaver-ftc|python3?|pytest|make|pip)(?:\s|$)")
_SHORT = 2  # letters of a symbol, not of a name


@dataclass
class Names:
    """Checks spans of a page. shown: words of the page's blocks, which are run: a reader's own names."""

    known: Known
    foreign: frozenset[str]
    shown: frozenset[str] = frozenset()
    used: set[str] = field(default_factory=set)  # of the foreign ones

    def wrong(self, span: str) -> str | None:
        """The name in a span that is none; None where all are."""
        text = " ".join(span.split())
        if self._is_foreign(text):
            return None
        for looks, names in self._KINDS:
            if looks(text):
                return next((name for name in names(self, text) if not self._is_foreign(name)), None)
        return next((name for name in self._of_prose(text) if not self._is_foreign(name)), None)

    def _is_foreign(self, name: str) -> bool:
        if name in self.foreign:
            self.used.add(name)
        return name in self.foreign

    def _of_command(self, text: str) -> Iterator[str]:
        """A command line: the program's command, options, modules, files, targets."""
        program, *words = text.split()
        command = ""
        if program == "beaver-ftc":
            command = _command(words, self.known)
            if command and command not in self.known.commands and not _FILLED.fullmatch(command):
                yield command
        elif program == "pip":
            return
        elif program == "make":
            yield from (word for word in words if word not in self.known.targets and "=" not in word)
        elif program.startswith("python") and words[:1] == ["-m"]:
            yield from self._of_module(words[1])
        yield from self._of_options(words, command)
        yield from (word for word in words if _FILE.fullmatch(word) and not self._is_file(word))

    def _of_module(self, name: str) -> Iterator[str]:
        path = name.replace(".", "/")
        if f"{path}.py" not in self.known.files and path not in self.known.files:
            yield name

    def _of_options(self, words: Iterable[str], command: str = "") -> Iterator[str]:
        of = self.known.commands
        allowed = of[command] | of[""] if command and command in of else frozenset().union(*of.values())
        for word in words:
            option = word.partition("=")[0].rstrip(",]")
            if option.startswith("--") and option not in allowed and option not in self.shown:
                yield option

    def _of_short_command(self, text: str) -> Iterator[str]:
        """A command without the program, `sweep FILE --resume`, or an option with its value."""
        words = text.split()
        yield from self._of_options(words, _command(words, self.known))

    def _of_file(self, text: str) -> Iterator[str]:
        if not self._is_file(text):
            yield from self._of_path(text) if _FILLED.search(text) else (text,)

    def _is_file(self, text: str) -> bool:
        """Whether it is in the repository, or a command writes it, or the page's blocks have it."""
        name = text.removeprefix("./").rstrip("/")
        if _FILLED.search(name):
            return self._fits(name)
        base, stem = name.rpartition("/")[2], Path(name).stem
        return (
            (name.endswith((".png", ".svg")) and self._is_word(stem))
            or (stem in self.shown and not _FILLED.search(stem))
            or name in self.known.files
            or any(file.endswith(f"/{name}") for file in self.known.files)
            or ("." in base and base in self.known.code.texts)
            or name in self.shown
            or base in self.shown
            or any(text.endswith(f"/{base}") or base in text.split() for text in self.known.code.texts)
        )

    def _of_path(self, text: str) -> Iterator[str]:
        """With a slash: a file, a folder, a property of the aircraft, or parts that are names each."""
        text = text.strip("\"'")
        if self._is_file(text) or text in self.known.properties or self._fits(text):
            return
        if text.partition("/")[0] in ("aero", "fcs", "uncertainty", "atmosphere", "velocities", "attitude"):
            yield text
            return
        for part in text.split("/"):
            filled = _FILLED.search(part) or (part.isalpha() and part.isupper())
            if part and not (filled or self._is_word(part) or self._is_file(part)):
                yield text
                return

    def _fits(self, text: str) -> bool:
        """Whether something known has the form of a name with parts to be filled in."""
        pattern = re.compile("".join(
            re.escape(part) if part and not _FILLED.fullmatch(part) else r"[\w.-]+" if part else ""
            for part in re.split(f"({_FILLED.pattern})", text)
        ))  # fmt: skip
        if text in self.known.code.texts or self._is_made(_FILLED.sub("x", text)):
            return True
        of = (self.known.properties, self.known.columns, self.known.files, self.known.words, self.shown)
        return any(pattern.fullmatch(name) for names in of for name in names)

    def _of_call(self, text: str) -> Iterator[str]:
        called = _CALL.match(text)
        yield from self._of_dotted(called[1]) if called else ()

    def _of_keys(self, text: str) -> Iterator[str]:
        """YAML in a line: each key, and each value of one word."""
        words = (word for word in _KEYS.findall(text) + _VALUES.findall(text) if not word.isupper())
        yield from (word for word in words if list(self._of_dotted(word)))

    def _of_item(self, text: str) -> Iterator[str]:
        """`name["key"]`: what is looked up, by a key or a property, and where."""
        found = _ITEM.fullmatch(text)
        if found and not (found[2] in self.known.properties or self._is_word(found[2])):
            yield found[2]
        yield from self._of_dotted(found[1]) if found else ()

    def _of_dotted(self, text: str) -> Iterator[str]:
        """A word, or words joined by dots: a path of keys, a member of a module or of a class."""
        parts = [part for part in re.sub(r"\[\d*\]", "", text).split(".") if part]
        if len(parts) == 1:
            if not self._is_word(parts[0]):
                yield text
            return
        if self.known.resolves(text) or text in self.known.code.texts or text in self.shown:
            return
        first, *below = parts
        if first.startswith("beaver_ftc") and self._of_package(parts):
            return
        members = self.known.code.members
        holds = first in members and below[0] in members[first]
        loose = first not in members and not first.startswith("beaver_ftc")
        field_of = not self.known.is_section(first) and (loose or self._is_field(below[-1]))
        if not (holds or field_of) or not all(map(self._is_word, parts)):
            yield text

    def _of_package(self, parts: Sequence[str]) -> bool:
        folder = "/".join(("src", *parts))
        above, name = folder.rpartition("/")[0], parts[-1]
        inside = {f"{folder}.py", folder} & self.known.files
        return bool(inside) or (
            bool({f"{above}.py", above} & self.known.files)
            and name in self.known.code.members.get(above.rpartition("/")[2], self.known.words)
        )

    def _of_filled(self, text: str) -> Iterator[str]:
        """With parts to be filled in: a column, a property, or a path of keys."""
        parts = [part for part in text.split(".") if part and not _FILLED.search(part)]
        if not self._fits(text) and (len(parts) == 0 or not all(map(self._is_word, parts))):
            yield text

    def _is_field(self, name: str) -> bool:
        """Whether something has a field, a key or a method of this name."""
        return name in self.known.code.texts or any(
            name in names for names in self.known.code.members.values()
        )

    def _is_word(self, word: str) -> bool:
        """Whether a single word is known, or is a symbol too short to be a name, or to be filled in."""
        return (
            all(len(part) <= _SHORT for part in re.split("[_-]", word))
            or word in self.known.words
            or word in self.known.code.texts
            or word.replace("-", "_") in self.known.code.members
            or word in self.shown
            or word.isdigit()
            or bool(_FILLED.search(word) and self._fits(word))
            or self._is_made(word)
            or self._has_a_place(word)
        )

    def _has_a_place(self, word: str) -> bool:
        """Whether a name joined by hyphens has a part in capitals, for a name to be put in: `NAME-search`."""
        parts = word.split("-")
        places = [part for part in parts if part.isalpha() and part.isupper()]
        return (
            len(parts) > 1 and bool(places) and all(part in places or self._is_word(part) for part in parts)
        )

    def _is_made(self, text: str) -> bool:
        """Whether the code makes such a name of words that are known: `{axis}_measured_rad`."""
        for pattern in self.known.code.patterns:
            made = re.fullmatch(pattern, text)
            filled = "_".join(made.groups()) if made else text
            if 2 * len(filled) <= len(text) and all(map(self._is_part, re.split(r"[\W_]+", filled))):
                return True
        return False

    def _is_part(self, word: str) -> bool:
        return len(word) <= _SHORT or word.isdigit() or word in self.known.words

    def _of_prose(self, text: str) -> Iterator[str]:
        """Anything else: words with an underscore, and words joined by dots, are names there too."""
        for word in re.findall(r"(?<![\w.<>{}*/-])[A-Za-z]\w*(?:\.[A-Za-z_]\w*)*(?![\w<>{}*/(-])", text):
            if "_" in word.strip("_"):
                yield from self._of_dotted(word)

    _KINDS: tuple[tuple[Callable[[str], object], Callable[["Names", str], Iterator[str]]], ...] = (
        (_PROGRAM.match, _of_command),
        (lambda text: text.startswith("--"), _of_short_command),
        (lambda text: _command(text.split(), known()) in known().commands and " --" in text,
         _of_short_command),
        (_FILE.fullmatch, _of_file),
        (_ITEM.fullmatch, _of_item),
        (_CALL.fullmatch, _of_call),
        (lambda text: "/" in text and " " not in text and "//" not in text, _of_path),
        (_KEYS.search, _of_keys),
        (_DOTTED.fullmatch, _of_dotted),
        (re.compile(rf"[\w<>*{{}}.,-]*(?:{_FILLED.pattern})[\w<>*{{}}.,-]*").fullmatch,
         _of_filled),
    )  # fmt: skip


def _command(words: Sequence[str], of: Known) -> str:
    """The command that a line begins with, of one word or two (`challenge new`); else the first word."""
    said = [word for word in words if not word.startswith("-")]
    pair = " ".join(said[:2])
    return pair if pair in of.commands else "".join(said[:1])


def spans(text: str) -> Iterator[tuple[int, str]]:
    """(line, span) of everything in backticks that is prose."""
    prose = text
    for left_out in (_FENCED, _COMMENT, _INDENTED):
        prose = left_out.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), prose)
    for found in _SPAN.finditer(prose):
        yield prose.count("\n", 0, found.start()) + 1, found[1]


def shown(text: str) -> frozenset[str]:
    """The words of a page's blocks."""
    blocks = [found[0] for found in (*_FENCED.finditer(text), *_INDENTED.finditer(text))]
    return frozenset(
        word
        for block in blocks
        for form in (r"[A-Za-z_]\w*", r"[\w./-]+")
        for word in re.findall(form, block)
    )


def foreign() -> dict[str, str]:
    """{name of others: whose}."""
    listed = yaml.safe_load(FOREIGN.read_text(encoding="utf-8")) or {}
    return {str(name): whose for whose, names in listed.items() for name in names}


def check(pages: Sequence[Page], every: bool = True) -> list[Finding]:
    """A finding for each name that is none; every: these are all pages, so that each foreign name is used."""
    theirs = foreign()
    names = Names(known(), frozenset(theirs))
    findings: list[Finding] = []
    for page in pages:
        if is_generated(page.text):
            continue
        names.shown = shown(page.text)
        for line, span in spans(page.text):
            wrong = names.wrong(span)
            if wrong is not None:
                findings.append(Finding(page.name, line, _words(wrong, span, names.known)))
    if every:
        where = FOREIGN.relative_to(FOREIGN.parents[2]).as_posix()
        idle = [name for name in theirs if name not in names.used]
        findings += [
            Finding(where, 1, f"{name}: no page has it, allowed: names that are used") for name in idle
        ]
    return findings


def _words(wrong: str, span: str, of: Known) -> str:
    near = nearest(wrong, sorted(of.words), 0.8)
    where = "" if wrong == span else f" in `{' '.join(span.split())}`"
    return f"`{wrong}`{where} is no name here{f', did you mean {near}?' if near else ''}"
