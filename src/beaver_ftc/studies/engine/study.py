"""A study's cases flown on all cores, kept as they land: what is stopped or killed goes on where it was.

While a study is under way its rows are in a hidden folder beside the result, `.<name>.flown`. The same
command finds them there. Once the result is written they go.
"""

import contextlib
import json
import shutil
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
OF_A_PART = 32  # cases that a study in rounds keeps together


FlyRound = Callable[[Sequence[Any]], list[Any]]
"""Flies one round of cases after the other, and gives their rows in order."""


@dataclass(frozen=True)
class Study:
    """A study: its cases, how each is flown, the document of all their rows, and its files.

    name: of the result folder. fly: from a case to its row, a value of the type `row`; it can be pickled, as
    the cases can. document: of all rows. files: their names, with what makes the content of each from the
    document; None is no file. follows_from: what the rows follow from beside the cases. lost: the row of a
    case that kills its process each time; without it that is a SimulationFailed. warm_up: of the workers.
    part: how many cases are kept together; by default one, and OF_A_PART of a round. rounds: in place of
    `cases`, where the next case follows from the rows before: flies round after round, and gives what the
    document is of.
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
    """The same; the document with the folder that it is kept in, as commands answer it."""
    return run_study(study, out, workers, progress) | {"folder": str(out / study.name)}


@contextlib.contextmanager
def flown(study: Study, out: Path, workers: int = 1, progress: Progress | None = None) -> Iterator[Any]:
    """Yield the rows of all cases, in their order whatever the number of workers; or what `rounds` gives.
    They are kept as they land, a part of cases at a time, and read from there: the same rows, whenever they
    were flown. On success they go."""
    make = partial(_workers, Work(study.fly, study.warm_up), workers)
    with (
        _keeping(study, out) as parts,
        contextlib.closing(Flying(parts.landed, parts.land, make, study.lost or _fail)) as flying,
    ):
        rounds = count()
        part = study.part or (OF_A_PART if study.rounds else 1)

        def fly(cases: Sequence[Any]) -> list[Any]:
            number = next(rounds)
            pieces = {f"{number:06}-{n:06}": runs for n, runs in store.batches_of(len(cases), part)}
            _fly_pieces(flying, pieces, cases, progress)
            return [row for piece, runs in pieces.items() for row in parts.landed(piece, runs)]

        yield study.rounds(fly) if study.rounds else fly(study.cases)


def _fly_pieces(
    flying: Flying, pieces: Mapping[Any, range], cases: Sequence[Any], progress: Progress | None
) -> dict[Number, Any]:
    """Fly cases by the piece; the rows of each."""
    found: dict[Number, Any] = {}

    def there(piece: Number, rows: Any) -> None:
        found[piece] = rows
        if progress:
            progress(len(found) / len(pieces))

    flying.fly(pieces.items(), lambda runs: [cases[n] for n in runs], there)
    return found


@contextlib.contextmanager
def _keeping(study: Study, out: Path) -> Iterator[store.Parts]:
    """The parts of a study while it is under way; on success they go, without any so does the folder."""
    kept = out / f".{study.name}.flown"
    new = not out.exists()
    with clear_disk_errors(kept):
        kept.mkdir(parents=True, exist_ok=True)
    with files.locked(kept):
        parts = _begin(kept, study)
        try:
            yield parts
        except BaseException as ended:
            if parts and GO_ON not in str(ended):
                say_once(f"{study.name}: stopped{GO_ON}")
            if not parts:  # nothing to go on with
                shutil.rmtree(kept, ignore_errors=True)
                with contextlib.suppress(OSError):
                    if new:
                        out.rmdir()
            raise
        shutil.rmtree(kept, ignore_errors=True)


def fly_all(fly: Fly, cases: Sequence[Any], workers: int, progress: Progress | None = None) -> list[Any]:
    """fly(case) of every case, in order, kept nowhere."""

    def is_new(number: Number, runs: Sequence[int]) -> None:
        """No rows have landed before."""

    def forget(number: Number, rows: Any) -> None:
        """Rows are not kept."""

    make = partial(_workers, Work(fly), workers)
    pieces = store.batches_of(len(cases), 1)
    with contextlib.closing(Flying(is_new, forget, make, _fail)) as flying:
        found = _fly_pieces(flying, dict(pieces), cases, progress)
    return [found[n][0] for n in range(len(cases))]


def _workers(work: Work, workers: int, cases: int) -> Workers:
    """This process if but one worker is asked for."""
    return LocalWorkers(work, min(workers, cases)) if workers > 1 else ThisProcess(work)


def _begin(kept: Path, study: Study) -> store.Parts:
    """The parts of this very study; those of another, or of other versions, are of no use to it."""
    asked = {"cases": repr(list(study.cases)), "asked": repr(study.follows_from)}
    mine = identity.of("study", asked)
    manifest = kept / "study.json"
    parts = store.Parts(kept / "parts", store.RowsAsJson(study.row), GO_ON)
    there = identity.known(manifest, "study")
    with clear_disk_errors(kept):
        if there is None and parts:  # nothing says whose they are
            files.set_aside(parts.folder, f"{manifest.name} {files.UNREADABLE}")
        if there != mine:
            parts.remove()
            files.write_whole(manifest, json.dumps(mine).encode())
        files.remove_leftovers(kept)
        parts.folder.mkdir(exist_ok=True)
    return parts


def _fail(case: Any, why: str) -> Any:
    raise SimulationFailed(f"{case}: {why}{GO_ON}")
