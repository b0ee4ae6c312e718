"""The commands that README, docs/ and `--help` show, taken out of their text.

A command is a line of a fenced `console` or `bash` block, a `run:` line of a fenced YAML block (a CI job), a
line of an indented block that starts with a program, or inline code that does.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from tools.docs.pages import is_generated

from .installation import ROOT

_EVERY = sorted(
    [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*/README.md")]
)
# What is generated shows the examples of `--help`, which test_help.py tries.
PAGES = [page for page in _EVERY if not is_generated(page.read_text(encoding="utf-8"))]
PROGRAMS = ("beaver-ftc", "pip", "pytest", "python", "make", "jsbsim", "fgfs", "ray")
_STARTS = re.compile(rf"({'|'.join(PROGRAMS)}) \S|pytest\b")
_FENCED = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(rf"(?<!`)`((?:{'|'.join(PROGRAMS)})\s[^`]+)`(?!`)")
_NAMED = re.compile(r"`([\w.-]+\.(?:yaml|py))`:\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_JOB = re.compile(r"^\s*- run: (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Command:
    """A command as it is shown: the page, and the line without prompt and comment."""

    page: str
    line: str


def commands_of(text: str) -> list[str]:
    """The commands that a Markdown text shows, in its order, each once."""
    found: list[tuple[int, str]] = []
    for block in _FENCED.finditer(text):
        found += [(block.start(), line) for line in _of_block(block[1], block[2])]
    prose = _FENCED.sub(lambda block: " " * len(block[0]), text)  # places in the text stay what they were
    for line in re.finditer(r"^ {4}(\S.*)$", prose, re.MULTILINE):
        if _STARTS.match(line[1]):
            found.append((line.start(), line[1]))
    found += [(code.start(), " ".join(code[1].split())) for code in _INLINE.finditer(prose)]
    return list(dict.fromkeys(_bare(line) for _, line in sorted(found, key=lambda entry: entry[0])))


def _of_block(kind: str, body: str) -> list[str]:
    if kind == "console":
        return [line.strip()[2:] for line in body.splitlines() if line.strip().startswith("$ ")]
    if kind in ("bash", "sh"):
        return [line for line in body.splitlines() if line.strip() and not line.startswith("#")]
    return _JOB.findall(body) if kind in ("yaml", "yml") else []


def _bare(line: str) -> str:
    """Without the comment that explains it."""
    return re.sub(r"\s+#.*$", "", line).strip()


def yaml_blocks(page: str) -> list[str]:
    """The YAML that a page shows, in its order."""
    return _blocks((ROOT / page).read_text(encoding="utf-8"), "yaml")


def python_blocks(page: Path, without: str = "\0") -> list[str]:
    """The Python that a page shows, in its order, but for the section with this heading."""
    before, _, after = page.read_text(encoding="utf-8").partition(without)
    return _blocks(before + after.partition("\n## ")[2], "python")


def _blocks(text: str, kind: str) -> list[str]:
    return [block[2] for block in _FENCED.finditer(text) if block[1] == kind]


def named_files(text: str) -> dict[str, str]:
    """{file: contents} of the blocks that a page asks to write into a file: "... into `mine.yaml`:"."""
    return {found[1]: found[2] for found in _NAMED.finditer(text)}


def files_of_pages() -> dict[str, str]:
    """The same of every page. A name stands for one file wherever it is."""
    found: dict[str, str] = {}
    for page in PAGES:
        for name, text in named_files(page.read_text(encoding="utf-8")).items():
            assert found.setdefault(name, text) == text, f"{_name(page)}: a second {name}"
    return found


@dataclass(frozen=True)
class Step:
    """One thing that a tutorial asks its reader to do: write a file, run a command, or run some Python."""

    kind: str  # file, command or python
    text: str
    name: str = ""  # of the file


def steps(text: str) -> list[Step]:
    """The steps of a tutorial in their order. What a mark says is printed is no step."""
    text = re.sub(
        r"<!-- printed: .*?<!-- /printed -->", lambda mark: " " * len(mark[0]), text, flags=re.DOTALL
    )
    found = [(block.start(), Step("file", block[2], block[1])) for block in _NAMED.finditer(text)]
    for block in _FENCED.finditer(text):
        if block[1] == "python" and not any(block[2] == step.text for _, step in found):
            found.append((block.start(), Step("python", block[2])))
        found += [
            (block.start() + at, Step("command", _bare(line)))
            for at, line in enumerate(_of_block(block[1], block[2]))
        ]
    prose = _FENCED.sub(lambda block: " " * len(block[0]), text)
    for line in re.finditer(r"^ {4}(\S.*)$", prose, re.MULTILINE):
        if _STARTS.match(line[1]):
            found.append((line.start(), Step("command", _bare(line[1]))))
    return [step for _, step in sorted(found, key=lambda entry: entry[0])]


def shown() -> list[Command]:
    """Every command of every page."""
    return [
        Command(_name(page), line) for page in PAGES for line in commands_of(page.read_text(encoding="utf-8"))
    ]


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def commands_of_help(text: str) -> list[str]:
    """The names of the commands that `beaver-ftc --help` lists."""
    listed = text.partition("\nCommands:\n")[2]
    rows = re.sub(r"\n {12}", " ", listed)
    return re.findall(r"(?:^  [a-z]+ +|; )([a-z][\w-]*): ", rows, re.MULTILINE)


def examples_of_help(text: str) -> list[str]:
    """The command lines that a help text gives as examples: lines that start with the program."""
    return [
        _bare(line.strip().removeprefix("$ "))
        for line in text.splitlines()
        if re.match(r"\s+(\$ )?beaver-ftc \S", line)
    ]
