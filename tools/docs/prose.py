"""How pages are written: tables have captions, symbols are in the glossary, sentences have verbs, and a
page ends with the next step. On pages of results, a command prints the numbers of prose.

A page that is older than a rule may break it as often as `prose.yaml` says, and no more often.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import yaml

from tools.docs import bare
from tools.docs.marks import Page, parsed
from tools.docs.pages import ROOT, Finding, is_generated

ALLOWED = Path(__file__).with_name("prose.yaml")
VERBS = Path(__file__).with_name("verbs.txt")
GLOSSARY = ROOT / "docs/reference/glossary.md"
CAPTION, SYMBOL, VERB, NEXT, NUMBER = "caption", "symbol", "verb", "next", "number"
RESULTS = "docs/results/"
_HOME = ("README.md", "docs/README.md")  # they are the way to all pages
_FENCE = re.compile(r"^ *(`{3,}|~{3,}).*?^ *\1`* *$", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"<!--.*?-->", re.DOTALL)
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
_RELATION = re.compile(r"\$[^$]*(?:[=<>]|\\(?:le|ge|in|approx|ne)(?![a-z]))[^$]*\$")  # a verb in signs
_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z`*\"(])")
_CAPTION = ("*Table ", "*Figure ")  # a caption may be a noun with what it needs
_LEAST_WORDS = 4  # shorter is a label
_PLAIN = re.compile(r"`[^`]*`|\$[^$]*\$|!?\[([^\]]*)\]\([^)]*\)")


def check(pages: Sequence[Page]) -> list[Finding]:
    """A finding for each rule that a page breaks more often than it may."""
    allowed, found = _allowed(), counts(pages)
    return [
        Finding(page.name, line, words)
        for page in pages
        if page.name in found
        for kind, line, words in faults(page.name, page.text)
        if found[page.name][kind] > allowed.get(page.name, {}).get(kind, 0)
    ]


@cache
def _allowed() -> Mapping[str, Mapping[str, int]]:
    return yaml.safe_load(ALLOWED.read_text(encoding="utf-8")) or {}


def counts(pages: Sequence[Page]) -> dict[str, dict[str, int]]:
    """{page: {rule: how often it is broken}} of pages that break one."""
    written = (page for page in pages if not is_generated(page.text))
    found = {page.name: Counter(kind for kind, *_ in faults(page.name, page.text)) for page in written}
    return {name: dict(broken) for name, broken in found.items() if broken}


def faults(name: str, text: str) -> Iterator[tuple[str, int, str]]:
    """(rule, line, what is wrong) of a page."""
    bare_text = _MARK.sub(_blank, _FENCE.sub(_blank, text))
    yield from _tables(bare_text)
    yield from _symbols(bare_text)
    yield from _verbless(bare_text)
    if name.startswith("docs/") and name not in _HOME and not _names_a_next_step(bare_text):
        yield (
            NEXT,
            bare_text.count("\n"),
            "the page names no next step, allowed: a last section `## Next` with a link",
        )
    yield from _unprinted(name, text)


def _unprinted(name: str, text: str) -> Iterator[tuple[str, int, str]]:
    """Sentences of a page of results with a number that no command prints."""
    for line, words in bare.numbers(parsed(text, name)) if name.startswith(RESULTS) else ():
        yield NUMBER, line, f'a number that no command prints: "{words[:80]}", allowed: a mark, or no number'


def _blank(found: re.Match[str]) -> str:
    """As many lines, so that places stay what they were."""
    return re.sub(r"[^\n]", " ", found[0])


def _names_a_next_step(text: str) -> bool:
    last = text.rpartition("\n## ")[2]
    return last.startswith("Next\n") and "](" in last


def _tables(text: str) -> Iterator[tuple[str, int, str]]:
    """Tables whose paragraph above is no caption."""
    lines = text.split("\n")
    for number, line in enumerate(lines):
        if not _RULE.match(line.strip()) or number < 1:
            continue
        above = [row.strip() for row in lines[: number - 1]]
        while above and not above[-1]:
            above.pop()
        begin = len(above)
        while begin and above[begin - 1]:
            begin -= 1
        paragraph = " ".join(above[begin:])
        if not re.match(r"\*Table \d+\. .*\*$", paragraph):
            head = lines[number - 1].strip()
            yield CAPTION, number, f"no caption above the table {head[:60]}, allowed: *Table N. Sentence.*"


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
            elif symbol not in _NO_SYMBOLS:
                yield from _letters(symbol)


def _letters(word: str) -> Iterator[str]:
    """A word of a formula: a differential or frame length as a whole, else letter by letter, as it is set."""
    if word in ("dt", "tol"):
        yield word
    else:
        yield from word


def _symbols(text: str) -> Iterator[tuple[str, int, str]]:
    known = known_symbols()
    for found in _MATHS.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        for symbol in dict.fromkeys(symbols_of(found[0])):
            if symbol not in known:
                yield SYMBOL, line, f"${symbol}$ is not in docs/reference/glossary.md"


@cache
def verbs() -> frozenset[str]:
    """The verbs of verbs.txt in each of their forms; a line is a verb, with its irregular forms behind it."""
    found: set[str] = set()
    for line in VERBS.read_text(encoding="utf-8").splitlines():
        for verb, *irregular in [line.split()] if line.strip() else []:
            found.update((verb, *irregular, *_forms(verb)))
    return frozenset(found)


def _forms(verb: str) -> Iterator[str]:
    """Third person, past and -ing of a verb, doubled consonants included."""
    stem = verb.removesuffix("e")
    yield verb + ("es" if re.search(r"(s|sh|ch|x|z|o)$", verb) else "s")
    if re.search(r"[^aeiou]y$", verb):
        yield from (verb[:-1] + "ies", verb[:-1] + "ied")
    for root in (stem, verb, verb + verb[-1]):
        yield from (root + "ed", root + "ing")


def _verbless(text: str) -> Iterator[tuple[str, int, str]]:
    """Sentences of paragraphs and of items of lists in which no word is a verb."""
    for line, paragraph in _paragraphs(text.partition("\n## Next\n")[0]):  # there are labels of links
        if paragraph.startswith(_CAPTION):
            continue
        for sentence in _SENTENCE.split(paragraph):
            if not sentence.rstrip("*_ ").endswith((".", "!", "?")):
                continue
            plain = _PLAIN.sub(lambda found: f" {found[1] or 'X'} ", sentence)
            words = re.findall(r"[A-Za-z']+", plain)
            if _RELATION.search(sentence) or any(_is_verb(word) for word in words):
                continue
            if len(words) >= _LEAST_WORDS:
                yield VERB, line, f'a sentence without a verb: "{sentence[:80]}"'


def _is_verb(word: str) -> bool:
    return word.lower() in verbs() or word.lower().endswith("n't")


def _paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """(line, text) of each paragraph and item; no headings, tables, pictures, indented code."""
    begin, gathered = 0, list[str]()
    for number, line in enumerate([*text.split("\n"), ""], 1):
        item = re.match(r"\s*(?:[-*+]|\d+\.) (?=\S)", line)
        leaves = not line.strip() or line.startswith(("#", "|", "    ", "!", "$$", "<", "  <"))
        if leaves or item:
            if "".join(gathered).strip():
                yield begin, " ".join(gathered)
            gathered = [line[item.end() :]] if item and not leaves else []
            begin = number
        elif gathered:
            gathered.append(line.strip())
        else:
            gathered, begin = [line.strip()], number
