"""A study: what to fly, and what to make of the rows. Its cases are flown on all cores and kept as they land.

Study       what to fly, and what to make of the rows
flown       all rows: flying.py flies the cases that are missing, kept.py keeps them
piece       a batch of cases, whose rows are one part, that is one file
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.files import Document
from beaver_ftc.results.folder import result_folder
from beaver_ftc.studies.engine.flying import Flying, Lost
from beaver_ftc.studies.engine.kept import GO_ON, kept_parts
from beaver_ftc.studies.engine.store import batches_of
from beaver_ftc.studies.engine.workers import LocalWorkers, Number, ThisProcess, Work, Workers
from beaver_ftc.studies.present.page import Makers, contents, write_files

Progress = Callable[[float], None]
Fly = Callable[[Any], Any]
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
    request = {"cases": repr(list(study.cases)), "asked": repr(study.follows_from)}
    with (
        kept_parts(out, study.name, request, study.row) as parts,
        contextlib.closing(Flying(parts.landed, parts.land, make, study.lost or _fail)) as flying,
    ):
        rounds = count()
        part = study.part or (OF_A_PART if study.rounds else 1)

        def fly(cases: Sequence[Any]) -> list[Any]:
            """Fly one round of cases; its pieces have the number of the round in their names."""
            number = next(rounds)
            pieces = {f"{number:06}-{n:06}": runs for n, runs in batches_of(len(cases), part)}
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


def fly_all(fly: Fly, cases: Sequence[Any], workers: int, progress: Progress | None = None) -> list[Any]:
    """fly(case) of every case, in order. No row is kept in a file."""
    make = partial(_workers, Work(fly), workers)
    pieces = batches_of(len(cases), 1)
    with contextlib.closing(Flying(_nothing, _nothing, make, _fail)) as flying:
        rows_of_piece = _fly_pieces(flying, dict(pieces), cases, progress)
    return [rows_of_piece[n][0] for n in range(len(cases))]


def _nothing(number: Number, runs_or_rows: Any) -> None:
    """In place of a store: no rows have landed before, and none are kept."""


def _workers(work: Work, workers: int, cases: int) -> Workers:
    """Worker processes; this process if one worker is requested."""
    return LocalWorkers(work, min(workers, cases)) if workers > 1 else ThisProcess(work)


def _fail(case: Any, why: str) -> Any:
    """In place of the row of a lost case, raise SimulationFailed."""
    raise SimulationFailed(f"{case}: {why}{GO_ON}")
