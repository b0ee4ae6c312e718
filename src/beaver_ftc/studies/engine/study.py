"""A study's cases flown on all cores, kept as they land: what is stopped or killed goes on where it was.

While a study is under way its rows are in a hidden folder beside the result, `.<name>.flown`. The same
command finds them there. Once the result is written they go.
"""

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results.writer import result_folder
from beaver_ftc.studies.engine.campaign import Batch, Batches, Campaign
from beaver_ftc.studies.engine.crew import Case, Crew, LocalCrew, ThisProcess, Work
from beaver_ftc.studies.engine.files import clear_disk_errors, locked, remove_leftovers, write_whole
from beaver_ftc.studies.engine.identity import Identity
from beaver_ftc.studies.engine.parts import Parts, RowsAsJson
from beaver_ftc.studies.present.files import Files, write_files

Progress = Callable[[float], None]
Fly = Callable[[Any], Any]
Lost = Callable[[Any, str], Any]
_GO_ON = "; what has been flown is kept, the same command goes on with it"


@dataclass(frozen=True)
class Study:
    """What is a study's own: its cases, how each is flown, what their rows amount to, and its files.

    name: of the result folder. fly: from a case to its row, a value of the type `row`; it can be pickled, as
    the cases can. document: of all rows. files: of the document. follows_from: what the rows follow from
    beside the cases. lost: the row of a case that kills its process each time; without it that is a
    SimulationFailed.
    """

    name: str
    cases: Sequence[Any]
    fly: Fly
    document: Callable[[list[Any]], Any]
    files: Callable[[Any], Files]
    row: Any = dict
    follows_from: Any = None
    lost: Lost | None = None


def run_study(study: Study, out: Path, workers: int = 1, progress: Progress | None = None) -> Any:
    """Fly a study and write `out/<name>/`; return its document."""
    rows = flown(
        out / study.name, study.cases, study.fly, study.row, follows_from=study.follows_from,
        workers=workers, progress=progress, lost=study.lost,
    )  # fmt: skip
    with rows as found, result_folder(out, study.name) as folder:
        document = study.document(found)
        write_files(folder, study.files(document))
    return document


@contextlib.contextmanager
def flown(
    folder: Path,
    cases: Sequence[Any],
    fly: Fly,
    row: Any = dict,
    *,
    follows_from: Any = None,
    workers: int = 1,
    progress: Progress | None = None,
    lost: Lost | None = None,
) -> Iterator[list[Any]]:
    """Yield the rows of all cases, in their order whatever the number of workers; on success they go.

    folder: of the result; the rest as in `Study`.
    """
    kept = folder.with_name(f".{folder.name}.flown")
    new = not folder.parent.exists()
    with clear_disk_errors(kept):
        kept.mkdir(parents=True, exist_ok=True)
    with locked(kept):
        identity = Identity.of("study", {"cases": repr(list(cases)), "asked": repr(follows_from)})
        parts = _begin(kept, identity, RowsAsJson(row))
        try:
            yield _all_rows(parts, cases, Work(partial(_fly_case, fly)), workers, progress, lost or _fail)
        except BaseException:
            if not parts:  # nothing to go on with
                _remove(kept, new)
            raise
        shutil.rmtree(kept, ignore_errors=True)


def _remove(kept: Path, parent: bool) -> None:
    """Remove the folder, and the one it is in, if that was made for it and is empty."""
    shutil.rmtree(kept, ignore_errors=True)
    with contextlib.suppress(OSError):
        if parent:
            kept.parent.rmdir()


def fly_all(fly: Fly, cases: Sequence[Any], workers: int = 1, progress: Progress | None = None) -> list[Any]:
    """fly(case) of every case, in order, kept nowhere."""
    rows: dict[int, Any] = {}

    def land(batch: Batch, landed: list[Any]) -> None:
        rows[batch.number] = landed[0]
        if progress:
            progress(len(rows) / len(cases))

    batches = [Batch(i, (Case(i, case),)) for i, case in enumerate(cases)]
    conduct(Batches(batches, len(cases), land), Work(partial(_fly_case, fly)), workers, _fail)
    return [rows[i] for i in range(len(cases))]


def conduct(source: Batches, work: Work, workers: int, lost: Callable[[Any, str], Any]) -> None:
    """Fly all batches of a source: in this process if but one worker is asked for."""
    crew: Crew
    if not source.cases_left():
        return
    crew = ThisProcess(work) if workers <= 1 else LocalCrew(work, max(1, min(workers, source.cases_left())))
    with contextlib.closing(crew):
        Campaign(source, crew, lost).fly()


def _begin(kept: Path, identity: Identity, codec: RowsAsJson) -> Parts:
    """The parts of this very study; those of another, or of other versions, are of no use to it."""
    manifest, parts = kept / "study.json", Parts(kept / "parts", codec, _GO_ON)
    try:
        there = json.loads(manifest.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        there = None
    with clear_disk_errors(kept):
        if there != identity.document:
            parts.remove()
            write_whole(manifest, json.dumps(identity.document).encode())
        remove_leftovers(kept)
        parts.folder.mkdir(exist_ok=True)
    return parts


def _all_rows(
    parts: Parts, cases: Sequence[Any], work: Work, workers: int, progress: Progress | None, lost: Any
) -> list[Any]:
    rows: dict[int, Any] = {}

    def land(batch: Batch, landed: list[Any]) -> None:
        parts.land(batch.number, landed)
        note(batch.number)

    def note(number: int) -> bool:
        found = parts.landed(number, [number])
        if found is None:
            return False
        rows[number] = found[0]
        if progress:
            progress(len(rows) / len(cases))
        return True

    missing = [Batch(n, (Case(n, case),)) for n, case in enumerate(cases) if not note(n)]
    if missing:
        conduct(Batches(missing, len(missing), land), work, workers, lost)
    return [rows[i] for i in range(len(cases))]


def _fly_case(fly: Fly, case: Case) -> Any:
    return fly(case.what)


def _fail(case: Any, why: str) -> Any:
    raise SimulationFailed(f"{case.what}: {why}{_GO_ON}")
