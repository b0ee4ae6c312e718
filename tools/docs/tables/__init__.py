"""Table makers: every public function of a module of this package that takes nothing and returns Markdown.

`python -m tools.docs table NAME` prints what the function of that name returns (a `-` of NAME is a `_`). It
calls the package's public names or its commands; no number is typed in. What it draws it saves below
`images/`, which becomes `docs/images/`, and returns the line that shows it: `![...](images/name.png)`. A
table that few readers need it saves as CSV in the same way, by `aside`.
"""

import csv
import os
import pickle
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from filelock import FileLock

from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.studies.engine.study import Study, run_study
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.commands import BIN, SHARED
from tools.docs.values import Place, at, printed

T = TypeVar("T")
Column = str | Callable[[Any], str]
_MAKER = re.compile(r"^def ([a-z]\w*)\(\) -> str:", re.MULTILINE)


def makers() -> dict[str, str]:
    """{name: module} of every table maker; a name that two modules have is refused."""
    found: dict[str, str] = {}
    for path in sorted(Path(__file__).parent.glob("[!_]*.py")):
        for name in _MAKER.findall(path.read_text(encoding="utf-8")):
            if found.setdefault(name.replace("_", "-"), path.stem) != path.stem:
                raise BadInput(f"{path.name}: a second table is called {name}, allowed: one of each name")
    return found


def table(name: str = "") -> str:
    """What the maker of this name returns. Raises BadInput where there is none."""
    known, name = makers(), name.replace("_", "-")
    if name not in known:
        raise BadInput(f"{name}: no such table{suggestion(name, known)}")
    return getattr(import_module(f"tools.docs.tables.{known[name]}"), name.replace("-", "_"))()


def beaver(*arguments: str, cwd: Path, longest_s: float | None = None) -> subprocess.CompletedProcess[str]:
    """Run `beaver-ftc` in a folder: served by `make docs`, of this interpreter without it."""
    served = Path(os.environ.get(SHARED, "")) / BIN / "beaver-ftc"
    own = [sys.executable, "-c", "from beaver_ftc.cli.main import main; main()"]
    command = [str(served)] if SHARED in os.environ and served.exists() else own
    return subprocess.run(
        [*command, *arguments], cwd=cwd, capture_output=True, text=True, timeout=longest_s, check=False
    )


def picture(name: str, says: str, content: Any, **how: Any) -> str:
    """Save a picture beside the pages, and return the line that shows it. content: of a file, or a figure,
    drawn as `how` says; the same figure gives the same bytes."""
    path = Path("images", name)
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        stamps = ("Date", "Creator") if path.suffix == ".svg" else ("Software",)
        content.savefig(path, metadata=dict.fromkeys(stamps), **how)
    return f"![{says}]({path.as_posix()})"


def studied(study: Study, workers: int = 1) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The document of a study, and the pictures that it draws, by name."""
    with TemporaryDirectory() as out:
        document = run_study(study, Path(out), workers)
        return document, {path.name: path.read_bytes() for path in Path(out).rglob("*.png")}


def table_of(rows: Iterable[Any], columns: Mapping[str, Column], none: str = "-") -> str:
    """Rows of a study in Markdown."""
    return markdown_table(*head_and_rows(rows, columns, none)[:2])


def head_and_rows(rows: Iterable[Any], columns: Mapping[str, Column], none: str = "-") -> Table:
    """Rows of a study. columns: of each head, where its cell stands in a row and in what form, as in the mark
    of a number (`delay_s .2f`, `share *100 .0f`), or what makes the cell of the row. none: for what is null.
    """
    made = {head: column if callable(column) else _taken(column, none) for head, column in columns.items()}
    return Table(tuple(made), [[of(row) for of in made.values()] for row in rows])


def _taken(words: str, none: str) -> Callable[[Any], str]:
    place = Place.read(words)
    return lambda row: none if at(row, place.path) is None else printed(row, place)


def shared(make: Callable[[], T]) -> Callable[[], T]:
    """What a function returns, made once for all commands of one `make docs`, which each are a process.

    For what takes long and several tables are made of; it must be of data that can be pickled.
    """

    @wraps(make)
    def kept() -> T:
        folder = os.environ.get(SHARED)
        if folder is None:
            return make()
        path = Path(folder, f"{make.__module__}.{make.__qualname__}.pickle")
        with FileLock(f"{path}.lock"):
            if not path.exists():
                path.write_bytes(pickle.dumps(make()))
        return pickle.loads(path.read_bytes())

    return kept


def aside(name: str, title: str, table: Table) -> str:
    """Save a table as CSV beside the pages, and return the item of a list that links to it."""
    path = Path("images", "tables", f"{name}.csv")
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = ([_plain(cell) for cell in row] for row in (table.head, *table.rows))
        csv.writer(file, lineterminator="\n").writerows(rows)
    return f"- [{title}]({path.as_posix()})"


def _plain(cell: str) -> str:
    """Without marks of bold, code and links."""
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", cell.strip()).replace("**", "").replace("`", "")
