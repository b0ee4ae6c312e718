"""The rows of a study that is not complete, so that the same command can continue it.

They are in a hidden folder beside the result, `.<name>.flown`, which is removed when the result is written:

    study.json    the identity of the study
    parts/        a file for each piece of its cases
"""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import Document
from beaver_ftc.results.folder import clear_disk_errors
from beaver_ftc.studies.engine import files, identity
from beaver_ftc.studies.engine.store import Parts, RowsAsJson

GO_ON = "; what has been flown is kept, the same command goes on with it"


@contextlib.contextmanager
def kept_parts(out: Path, name: str, request: Document, row: Any) -> Iterator[Parts]:
    """Yield the parts of a study of this name, in its hidden folder, which is locked. The folder is emptied
    at the end of the block, and removed after the lock. If the block raises, it stays with the parts that
    have landed; without any, it is removed, and so is `out` if it is new and empty.

    request: determines the rows, together with versions and code. row: type of a row.
    """
    hidden = out / f".{name}.flown"
    is_new = not out.exists()
    with clear_disk_errors(hidden):
        hidden.mkdir(parents=True, exist_ok=True)
    try:
        with files.locked(hidden):
            parts = _begin(hidden, identity.of_request("study", request), row)
            try:
                yield parts
            except BaseException as ended:
                if not parts:  # no rows to continue with
                    files.empty(hidden)
                elif GO_ON not in str(ended):
                    say_once(f"{name}: stopped{GO_ON}")
                raise
            files.empty(hidden)
    finally:
        # A folder with parts cannot be removed, nor one that another process has locked meanwhile.
        with contextlib.suppress(OSError):
            hidden.rmdir()
            if is_new:
                out.rmdir()


def _begin(hidden: Path, mine: Document, row: Any) -> Parts:
    """The parts of a study with the identity `mine`. Parts of another study, or of other versions, are
    removed; parts without a readable manifest are set aside."""
    manifest = hidden / "study.json"
    parts = Parts(hidden / "parts", RowsAsJson(row), GO_ON)
    earlier = identity.read_identity(manifest, "study")
    with clear_disk_errors(hidden):
        if earlier is None and parts:  # they may belong to another study
            files.set_aside(parts.folder, f"{manifest.name} {files.UNREADABLE}")
        if earlier != mine:
            parts.remove()
            files.write_whole(manifest, json.dumps(mine).encode())
        files.remove_leftovers(hidden)
        parts.folder.mkdir(exist_ok=True)
    return parts
