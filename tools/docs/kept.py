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

PACKAGE = ("src", "aircraft", "scenarios", "evidence", "examples", "pyproject.toml", "tests/acceptance")
# What a command of the package can read, and what lays out its folder; what one of `tools/` can read.
RUNS = (*PACKAGE, "tools/docs/commands.py", "tools/check_certificate.py")
CODE = (*PACKAGE, "benchmarks", "tools", "tests/data")
PAGES = ("docs", "README.md", "CONTRIBUTING.md")
# Commands of `tools/` that read no page: the text of a page can change, and they are not run again.
READS_CODE = tuple(f"python -m tools.docs {printer}" for printer in ("table ", "reference ", "constants"))
_FILE_OF_READER = re.compile(r"^ *```(?:yaml|python)\n.*?^ *```$", re.MULTILINE | re.DOTALL)
_UNUSED_S = 14.0 * 86400.0


class Kept:
    """Outputs of earlier runs. needed: environment variables that lead to data.

    Digests of what a command can read: _package, a command of the package; _code, one of READS_CODE; _pages,
    another one of `tools/`. _folder: None if nothing is kept.
    """

    def __init__(self, needed: Collection[str]) -> None:
        base = cache_base()
        self._folder = base and base / "printed"
        data = "".join(f"{name}={os.environ.get(name)};" for name in sorted(needed))
        self._package = _digest(RUNS, data + _files_of_readers())
        self._code = _digest(CODE, data)
        self._pages = _digest(PAGES, self._code)

    def _file(self, line: str) -> Path | None:
        """The file of a command: its name changes with the command and with all that the command can read."""
        readable = self._code if line.startswith(READS_CODE) else self._pages
        if "python -m " not in line:
            readable = self._package
        name = sha256(f"{readable} {line}".encode()).hexdigest()[:24]
        return self._folder and self._folder / f"{name}.pickle"

    def get(self, line: str) -> Output | None:
        """What this command printed when everything that it can read was as it is now."""
        file = self._file(line)
        if file is None or not file.exists():
            return None
        os.utime(file)
        return pickle.loads(file.read_bytes())

    def put(self, line: str, output: Output) -> None:
        """Keep an output without a fault; remove files that were not used for a fortnight."""
        file = self._file(line)
        if file is None or output.fault:
            return
        file.parent.mkdir(parents=True, exist_ok=True)
        for old in file.parent.iterdir():
            if old.stat().st_mtime < time.time() - _UNUSED_S:
                old.unlink(missing_ok=True)
        write_whole(file, pickle.dumps(output))


def _digest(places: Collection[str], more: str) -> str:
    """SHA-256 of the files of these places and of the text `more`."""
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
