"""Names in prose: every word in backticks that looks like a name of this project exists in it.

A function, file, key, column, property, option or command that is gone is a line. Names of others
(numpy's, an autopilot's) stand in `foreign.yaml`, each used on a page. Blocks are not prose: they are run.
"""

import ast
import re
import subprocess
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

from beaver_ftc.documents.errors import nearest
from tools.data import yaml_of
from tools.docs.marks import Page
from tools.docs.pages import COMMENT, ROOT, Finding, blanked, is_generated

FOREIGN = Path(__file__).with_name("foreign.yaml")
_BLOCK = re.compile(r"^ *(`{3,}|~{3,}).*?^ *\1`* *$|^ {4}\S[^\n]*$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)*)`(?!`)")
_WORD = re.compile(r"(?<![\w-])(?:--)?[A-Za-z_][\w-]*")
_TEXT = re.compile(r"[\w./-]+")
_FILLED = re.compile(
    r"<[\w ]+>|\{[\w, ]+\}|\*|\.\.\.|\b[A-Z]+\b|(?<=[a-z]_)[A-Z_]+(?=_[a-z])"
)  # a reader fills it in
_FILE = re.compile(r"[\w./-]+\.(?:py|md|ya?ml|xml|json|csv|parquet|html|js|png|svg|toml|ipynb)")
_TEST = re.compile(r"(?<=def )test_\w+|BEAVER_FTC_\w+")
_READ = (".yaml", ".yml", ".js", ".html", ".j2", ".toml", ".xml", ".json", ".c", "Makefile")
_OF_A_MODULE = re.compile(r"([a-z_]+)\.([a-z_]\w*)")
_SHORT = 2  # letters of a symbol, not of a name


@cache
def files() -> frozenset[str]:
    """Files of the repository, as git lists them."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    return frozenset(listed.stdout.split("\n"))


@cache
def by_module() -> dict[str, frozenset[str]]:
    """The names in modules of the packages, by the name of the file; of several so called, those of all."""
    found: dict[str, frozenset[str]] = {}
    for name in files():
        if name.startswith("src/") and name.endswith(".py"):
            names = frozenset(said(ast.parse((ROOT / name).read_text(encoding="utf-8"))))
            found[Path(name).stem] = found.get(Path(name).stem, frozenset()) | names
    return found


@cache
def known() -> frozenset[str]:
    """Every name: of code, data, files, columns of a log, properties of JSBSim and options of commands."""
    from beaver_ftc.aircraft import builtin_names, load
    from beaver_ftc.cli.main import every_command
    from beaver_ftc.control.profile import COLUMNS
    from beaver_ftc.diagnosis.isolation import estimator_names
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.plant.channels import log_columns

    texts = [*files(), *Plant(100).fdm.query_property_catalog("").split()]
    for aircraft in map(load, builtin_names()):
        estimators = estimator_names("all", aircraft)
        texts += log_columns(aircraft, estimators, 3, aircraft.power_setting, COLUMNS, True)
    for command in every_command().values():
        texts += [word for option in command.params for word in (*option.opts, *option.secondary_opts)]
    for name in files():
        if name.startswith("tests/"):
            texts += _TEST.findall((ROOT / name).read_text(encoding="utf-8", errors="replace"))
        elif name.endswith(".py"):
            texts += said(ast.parse((ROOT / name).read_text(encoding="utf-8")))
        elif name.endswith(_READ) and not name.startswith("tools/"):
            texts.append((ROOT / name).read_text(encoding="utf-8"))
    return frozenset(word for form in (_WORD, _TEXT) for text in texts for word in form.findall(text))


def said(tree: ast.Module) -> Iterator[str]:
    """Names and texts of Python code, docstrings left out."""
    described = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if id(node) not in described:
            yield from (value for _, value in ast.iter_fields(node) if isinstance(value, str))


def wrong(span: str, own: frozenset[str] = frozenset()) -> str | None:
    """The name in a span that is none; own: words of the page's blocks and names of others."""
    text = " ".join(span.split())
    if text in own:
        return None
    for word in text.split():
        if _FILE.fullmatch(word) and not is_file(word, own):
            return word
    placed = _OF_A_MODULE.fullmatch(text)
    if (
        placed
        and not _FILE.fullmatch(text)
        and placed[2] not in by_module().get(placed[1], {placed[2]})
        and text not in known()
    ):
        return text
    words = _WORD.findall(_FILLED.sub(" ", text))
    if " " in text and not re.search(r"^(beaver-ftc|python3?|make) |\w: ", text):  # prose
        words = [word for word in words if "_" in word or word.startswith("--")]
    return next((word for word in words if not is_name(word, own)), None)


def is_file(name: str, own: frozenset[str]) -> bool:
    """Whether it lies in the repository, or the code or the page's blocks write it."""
    last = Path(name)
    written = "src/" not in name and (last.name in known() or last.name in own or last.stem in own)
    return written or any(f"/{file}".endswith(f"/{name.removeprefix('./')}") for file in files())


def is_name(word: str, own: frozenset[str]) -> bool:
    """Whether a word is known, too short to be a name, or joined of parts that the code joins."""
    word = re.sub(r"_\d+$", "", word)
    if len(word) <= _SHORT or word in known() or word in own:
        return True
    if word.startswith("_"):  # the end of some names
        return any(name.endswith(word) for name in known())
    cuts = [k for k, letter in enumerate(word) if letter in "_-" and k]
    return any(word[k:] in known() and is_name(word[:k], own) for k in cuts)


def spans(text: str) -> Iterator[tuple[int, str]]:
    """(line, span) of everything in backticks that is prose."""
    prose = blanked(text, _BLOCK, COMMENT)
    for found in _SPAN.finditer(prose):
        yield prose.count("\n", 0, found.start()) + 1, found[1]


def shown(text: str) -> frozenset[str]:
    """The words of a page's blocks."""
    blocks = [found[0] for found in _BLOCK.finditer(text)]
    return frozenset(word for block in blocks for form in (_WORD, _TEXT) for word in form.findall(block))


def foreign() -> dict[str, str]:
    """{name of others: whose}."""
    return {str(name): whose for whose, names in yaml_of(FOREIGN).items() for name in names}


def check(pages: Sequence[Page], every: bool = True) -> list[Finding]:
    """A finding for each name that is none; every: these are all pages, so that each foreign name is used."""
    theirs = foreign()
    findings: list[Finding] = []
    for page in pages:
        own = shown(page.text) | theirs.keys()
        for line, span in () if is_generated(page.text) else spans(page.text):
            name = wrong(span, own)
            if name is not None:
                near = nearest(name, sorted(known()), 0.8)
                hint = f", did you mean {near}?" if near else ""
                findings.append(Finding(page.name, line, f"`{name}` in `{span}` is no name here{hint}"))
    if every:
        where, text = FOREIGN.relative_to(ROOT).as_posix(), "\n".join(page.text for page in pages)
        idle = [name for name in theirs if name not in text]
        findings += [
            Finding(where, 1, f"{name}: no page has it, allowed: names that are used") for name in idle
        ]
    return findings
