"""What a command printed, in the dress of the page on which it stands."""

import re
from pathlib import Path

_FENCE = re.compile(r"(`{3,})(\w*)\n((?:\$ .*\n)*)")
_MARKDOWN = re.compile(r"python -m tools\.docs (?:table|reference) [\w-]+")
# a block in a fence, code in a line, or the start of a link to a file
_CODE_OR_LINK = re.compile(
    r"(?P<code>^(?P<mark>`{3,}).*?^(?P=mark)`*$|(?P<ticks>`+)[^\n]*?(?P=ticks))|\]\((?!\w+:|[#/])",
    re.M | re.S,
)
_ROW = re.compile(r"^\|.*\|$", re.MULTILINE)  # of a table


def dressed(old: str, text: str, command: str) -> str:
    """What was printed in the dress of what stands: a fence with its language (and lines `$ ...`), or bare.

    Where nothing stands yet, a table is bare and all else is fenced.
    """
    fence = _FENCE.match(old)
    if fence:
        mark, language, prompts = fence[1], fence[2], fence[3]
        return f"{mark}{language}\n{prompts}{text}\n{mark}\n"
    if old.strip() or _MARKDOWN.fullmatch(command):
        return f"{compact(text)}\n"
    return f"```text\n{text}\n```\n"


def compact(text: str) -> str:
    """Markdown with narrower tables: a reader of the page does not see the blanks beside their bars."""
    return _ROW.sub(lambda row: re.sub(r" ?(?<!\\)\| ?", "|", row[0]), text)


def linked(text: str, page: str) -> str:
    """Links of what is printed are as seen from docs/; README lies above it. Code has no links."""
    below = len(Path(page).parts) - 2
    up = "docs/" if below < 0 else "../" * below
    return _CODE_OR_LINK.sub(lambda found: found["code"] or f"]({up}", text)
