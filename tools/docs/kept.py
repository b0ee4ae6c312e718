"""What commands of the marks printed, kept in the user's cache until a file changes that they can read."""

import os
import pickle
import re
import time
from collections.abc import Collection, Iterator
from hashlib import sha256
from pathlib import Path

from beaver_ftc.documents.files import cache_base
from beaver_ftc.studies.engine.files import write_whole
from tools.docs.commands import Output
from tools.docs.pages import ROOT

CODE = (
    "src",
    "aircraft",
    "scenarios",
    "evidence",
    "examples",
    "benchmarks",
    "tools",
    "tests/acceptance",
    "tests/data",
    "pyproject.toml",
)
RUNS = (  # what a command of the package can read, and what lays out its folder
    *("src", "aircraft", "scenarios", "evidence", "examples", "pyproject.toml"),
    *("tests/acceptance", "tools/docs/commands.py", "tools/check_certificate.py"),
)
PAGES = ("docs", "README.md", "CONTRIBUTING.md")
# none of these reads a page: text can be changed without a flight
MAKES_TABLE = "python -m tools.docs table "
READS_CODE = (MAKES_TABLE, "python -m tools.docs reference ", "python -m tools.docs constants")
_FILE_OF_READER = re.compile(r"^ *```(?:yaml|python)\n.*?^ *```$", re.MULTILINE | re.DOTALL)
_UNUSED_S = 14.0 * 86400.0


class Kept:
    """Outputs of earlier runs. needed: environment variables that lead to data."""

    def __init__(self, needed: Collection[str]) -> None:
        base = cache_base()
        self._folder = base / "printed" if base else None
        named = "".join(f"{name}={os.environ.get(name)};" for name in sorted(needed))
        self._code = _digest(CODE, named)
        self._pages = _digest(PAGES, self._code)
        self._shown = _digest(RUNS, named + _files_of_readers())

    def _file(self, line: str) -> Path | None:
        whole = self._code if line.startswith(READS_CODE) else self._pages
        state = whole if "python -m " in line else self._shown
        return self._folder and self._folder / f"{sha256(f'{state} {line}'.encode()).hexdigest()[:24]}.pickle"

    def get(self, line: str) -> Output | None:
        """What this command printed when everything that it can read was as it is now."""
        file = self._file(line)
        if file is None or not file.exists():
            return None
        os.utime(file)
        found: Output = pickle.loads(file.read_bytes())
        return found

    def put(self, line: str, output: Output) -> None:
        """Keep what can be used; drop what nobody has asked for in a fortnight."""
        file = self._file(line)
        if file is None or output.fault:
            return
        file.parent.mkdir(parents=True, exist_ok=True)
        for old in file.parent.iterdir():
            if old.stat().st_mtime < time.time() - _UNUSED_S:
                old.unlink(missing_ok=True)
        write_whole(file, pickle.dumps(output))


def _digest(places: Collection[str], more: str) -> str:
    """A name for the contents of these files and folders, and of the environment that runs them."""
    digest = sha256(more.encode())
    for path in _files(places):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(ROOT)} {len(content)} ".encode() + content)
    return digest.hexdigest()


def _files_of_readers() -> str:
    """The YAML and Python that the pages show: of a page, a command of the package reads nothing else."""
    pages = (path for path in _files(PAGES) if path.suffix == ".md")
    return "".join("".join(_FILE_OF_READER.findall(path.read_text(encoding="utf-8"))) for path in pages)


def _files(places: Collection[str]) -> Iterator[Path]:
    for place in places:
        found = (ROOT / place).rglob("*") if (ROOT / place).is_dir() else [ROOT / place]
        yield from sorted(path for path in found if path.is_file() and "__pycache__" not in path.parts)
