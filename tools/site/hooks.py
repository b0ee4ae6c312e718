"""What mkdocs is to do besides: public names, the flight of the front page, equations, links out of docs/.

Nothing of it is written into the source tree.
"""

import re
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from posixpath import normpath
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # tools/, wherever mkdocs was started

ASSETS = ("site.css", "iframe-worker.js", "math.js")
MATHJAX, MATHJAX_FILE = "assets/mathjax.js", "static/mathjax/es5/tex-svg-full.js"
REPLAY = "replay.html"
_PICTURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)$", re.MULTILINE)  # of the front page, in whose place is
_FRAME = f'<iframe class="replay" src="{REPLAY}" title="a flight, replayed" loading="lazy"></iframe>'
_MARK = re.compile(r"^<!-- (?:printed|/printed|from ).*?-->$|<!--[=/].*?-->", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]*)\]\(((?:\.\./)+[^)#\s]+)(?:#[^)]*)?\)")  # out of its folder
_SHOWN = (".cff", ".css", ".csv", ".js", ".json", ".md", ".py", ".toml", ".xml", ".yaml", ".yml")  # as text
_NAMES = re.compile(r"^<!-- printed: \S+ -m tools\.docs table python-names -->\n.*?^<!-- /", re.M | re.S)
SOURCES = "REFERENCES.md"  # a file of its own beside the README, here a page


def on_files(files: Files, config: Any) -> Files:
    """Add what is made: the replay, assets, linked files of the repository."""
    files.append(File.generated(config, SOURCES.lower(), abs_src_path=str(ROOT / SOURCES)))
    files.append(File.generated(config, REPLAY, content=_replay()))
    for name in ASSETS:
        asset = ROOT / "tools" / "site" / "assets" / name
        files.append(File.generated(config, f"assets/{name}", abs_src_path=str(asset)))
    files.append(File.generated(config, MATHJAX, abs_src_path=str(_mathjax())))
    for path in sorted({path for file in files.documentation_pages() for path in _outside(file)}):
        shown = File.generated(config, _copy_of(path), abs_src_path=str(ROOT / path))
        files.append(shown)
    return files


@cache
def _replay() -> str:
    from tools.site.replay import page

    return page()


def _mathjax() -> Path:
    found = find_spec("mathjax")
    for folder in found.submodule_search_locations or () if found else ():
        if (Path(folder) / MATHJAX_FILE).is_file():
            return Path(folder) / MATHJAX_FILE
    raise PluginError("MathJax is not there, allowed: an environment with `pip install '.[docs]'`")


def _outside(file: File) -> Iterator[str]:
    """Files of the repository outside docs/ that a page links to."""
    for _, link in _LINK.findall(file.content_string):
        path = _in_repository(file.src_uri, link)
        if path and (ROOT / path).is_file():
            yield path


def _in_repository(page: str, link: str) -> str:
    """The path of a link's target from the root; empty if it is inside docs/, or none."""
    path = normpath(PurePosixPath("docs", page).parent / link)
    inside = path.startswith(("docs/", ".."))
    return "" if inside or not (ROOT / path).exists() else path


def _copy_of(path: str) -> str:
    """Where a file of the repository is on the site; as text, so that a browser shows it."""
    return f"files/{path}.txt" if path.endswith(_SHOWN) else f"files/{path}"


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Take out the marks of what is printed; link into the site what is linked out of docs/."""
    markdown = _MARK.sub("", _NAMES.sub(_public_names, markdown))
    if page.file.src_uri == "README.md":
        markdown = _PICTURE.sub(_FRAME, markdown, count=1)
        page.meta.setdefault("hide", ["navigation", "toc"])
    if page.file.src_uri in _reference_pages():
        page.meta.setdefault("hide", ["toc"])  # their tables are wide
        page.meta.setdefault("search", {"boost": 0.5})  # who searches for a word wants what explains it
    above = "../" * page.file.src_uri.count("/")

    def inward(link: re.Match[str]) -> str:
        path = _in_repository(page.file.src_uri, link[2])
        if path == SOURCES:
            return f"[{link[1]}]({above}{SOURCES.lower()})"
        if (ROOT / path).is_dir():
            return f"{link[1]}" if path else link[0]
        return f"[{link[1]}]({above}{_copy_of(path)})"

    return _LINK.sub(inward, markdown)


def _public_names(printed: re.Match[str]) -> str:
    """From docstrings, with links to the source, in place of the tables."""
    from tools.docs.tables import python_names

    return f"{python_names.directives()}\n\n<!-- /"


@cache
def _reference_pages() -> frozenset[str]:
    from tools.docs.reference import PAGES

    return frozenset(f"reference/{name}.md" for name in PAGES)


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Load what sets equations on pages that have some."""
    if 'class="arithmatex"' not in output:
        return output
    above = "../" * page.url.count("/")
    scripts = (f'<script src="{above}{name}" defer></script>' for name in ("assets/math.js", MATHJAX))
    return output.replace("</body>", "".join(scripts) + "</body>")
