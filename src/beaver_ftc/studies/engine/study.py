"""The cases of a study are flown on all cores and kept as they land, so that an interrupted study can
continue.

As long as a study is not complete, its rows are in a hidden folder beside the result, `.<name>.flown`. The
same command reads them there and flies the other cases. The folder is removed when the result is written.

    Study       what to fly, and what to make of the rows
    _keeping    the hidden folder, locked, for this study alone
    flown       all rows: flying.py flies the cases that are missing, store.py keeps them
    piece       a batch of cases, whose rows are one part, that is one file
"""

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import SimulationFailed, say_once
from beaver_ftc.documents.files import Document
from beaver_ftc.results.folder import clear_disk_errors, result_folder
from beaver_ftc.studies.engine import files, identity, store
from beaver_ftc.studies.engine.flying import Flying, Lost
from beaver_ftc.studies.engine.workers import LocalWorkers, Number, ThisProcess, Work, Workers
from beaver_ftc.studies.present.page import Makers, contents, write_files

Progress = Callable[[float], None]
Fly = Callable[[Any], Any]
GO_ON = "; what has been flown is kept, the same command goes on with it"
OF_A_PART = 32  # cases in a file of a study in rounds


FlyRound = Callable[[Sequence[Any]], list[Any]]
"""Flies a round of cases and returns their rows in order."""


@dataclass(frozen=True)
class Study:
    """A study: its cases, how each is flown, the document of all their rows, and its files.

    - name: of the result folder. cases: can be pickled, as `fly` can.
    - fly: from a case to its row, a value of the type `row`.
    - document: from all rows, in the order of the cases, to the document.
    - files: by name, the function from the document to the content of a file; a content None is no file.
    - follows_from: all that determines the rows beside the cases. If it changes, the kept rows are not used.
    - lost: makes the row of a case that kills its process each time; without it, such a case raises
      SimulationFailed.
    - warm_up: called once in each worker.
    - part: number of cases in a file; by default one, in rounds OF_A_PART.
    - rounds: in place of `cases`, if later cases follow from earlier rows. It receives a function that flies
      a round, and returns the argument of `document`.
    """

    name: str
    cases: Sequence[Any]
    fly: Fly
    document: Callable[[Any], Any]
    files: Makers
    row: Any = dict
    follows_from: Any = None
    lost: Lost | None = None
    warm_up: Callable[[], None] | None = None
    part: int | None = None
    rounds: Callable[[FlyRound], Any] | None = None


def run_study(study: Study, out: Path, workers: int = 1, progress: Progress | None = None) -> Any:
    """Fly a study and write `out/<name>/`; return its document."""
    with flown(study, out, workers, progress) as rows, result_folder(out, study.name, study.files) as folder:
        document = study.document(rows)
        write_files(folder, contents(study.files, document))
    return document


def run_into(study: Study, out: Path, workers: int = 1, progress: Progress | None = None) -> Document:
    """Fly a study and write its folder; return its document with the path of the folder, as the answer of a
    command."""
    return run_study(study, out, workers, progress) | {"folder": str(out / study.name)}


@contextlib.contextmanager
def flown(study: Study, out: Path, workers: int = 1, progress: Progress | None = None) -> Iterator[Any]:
    """Yield the rows of all cases, in the order of the cases, or the result of `rounds`.

    Rows are always read from the files in which they are kept, so that a resumed study has exactly the same
    rows. The files are removed at the end of the block, unless it raises.
    """
    make = partial(_workers, Work(study.fly, study.warm_up), workers)
    with (
        _keeping(study, out) as parts,
        contextlib.closing(Flying(parts.landed, parts.land, make, study.lost or _fail)) as flying,
    ):
        rounds = count()
        part = study.part or (OF_A_PART if study.rounds else 1)

        def fly(cases: Sequence[Any]) -> list[Any]:
            """Fly one round of cases; its pieces have the number of the round in their names."""
            number = next(rounds)
            pieces = {f"{number:06}-{n:06}": runs for n, runs in store.batches_of(len(cases), part)}
            _fly_pieces(flying, pieces, cases, progress)
            return [row for piece, runs in pieces.items() for row in parts.landed(piece, runs)]

        yield study.rounds(fly) if study.rounds else fly(study.cases)


def _fly_pieces(
    flying: Flying, pieces: Mapping[Any, range], cases: Sequence[Any], progress: Progress | None
) -> dict[Number, Any]:
    """Fly cases; return the rows of each piece. pieces: the runs of each, by name. progress: takes the share
    of pieces that have landed."""
    rows_of_piece: dict[Number, Any] = {}

    def on_landed(piece: Number, rows: Any) -> None:
        """Keep the rows of a piece, and report progress."""
        rows_of_piece[piece] = rows
        if progress:
            progress(len(rows_of_piece) / len(pieces))

    flying.fly(pieces.items(), lambda runs: [cases[n] for n in runs], on_landed)
    return rows_of_piece


@contextlib.contextmanager
def _keeping(study: Study, out: Path) -> Iterator[store.Parts]:
    """Yield the parts of a study, in its hidden folder, which is locked. The folder is emptied at the end of
    the block, and removed after the lock. If the block raises, it stays with the parts that have landed;
    without any, it is removed, and so is `out` if it is new and empty."""
    hidden = out / f".{study.name}.flown"
    is_new = not out.exists()
    with clear_disk_errors(hidden):
        hidden.mkdir(parents=True, exist_ok=True)
    try:
        with files.locked(hidden):
            parts = _begin(hidden, study)
            try:
                yield parts
            except BaseException as ended:
                if not parts:  # no rows to continue with
                    files.empty(hidden)
                elif GO_ON not in str(ended):
                    say_once(f"{study.name}: stopped{GO_ON}")
                raise
            files.empty(hidden)
    finally:
        # A folder with parts cannot be removed, nor one that another process has locked meanwhile.
        with contextlib.suppress(OSError):
            hidden.rmdir()
            if is_new:
                out.rmdir()


def fly_all(fly: Fly, cases: Sequence[Any], workers: int, progress: Progress | None = None) -> list[Any]:
    """fly(case) of every case, in order. No row is kept in a file."""
    make = partial(_workers, Work(fly), workers)
    pieces = store.batches_of(len(cases), 1)
    with contextlib.closing(Flying(_nothing, _nothing, make, _fail)) as flying:
        rows_of_piece = _fly_pieces(flying, dict(pieces), cases, progress)
    return [rows_of_piece[n][0] for n in range(len(cases))]


def _nothing(number: Number, runs_or_rows: Any) -> None:
    """In place of a store: no rows have landed before, and none are kept."""


def _workers(work: Work, workers: int, cases: int) -> Workers:
    """Worker processes; this process if one worker is requested."""
    return LocalWorkers(work, min(workers, cases)) if workers > 1 else ThisProcess(work)


def _begin(hidden: Path, study: Study) -> store.Parts:
    """The parts of this study. Parts of another study, or of other versions, are removed; parts without a
    readable manifest are set aside."""
    request = {"cases": repr(list(study.cases)), "asked": repr(study.follows_from)}
    mine = identity.of_request("study", request)
    manifest = hidden / "study.json"
    parts = store.Parts(hidden / "parts", store.RowsAsJson(study.row), GO_ON)
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


def _fail(case: Any, why: str) -> Any:
    """In place of the row of a lost case, raise SimulationFailed."""
    raise SimulationFailed(f"{case}: {why}{GO_ON}")
