"""A study's cases flown on all cores, kept as they land: what is stopped or killed goes on where it was.

While a study is under way its rows are in a hidden folder beside the result, `.<name>.flown`. The same
command finds them there. Once the result is written they go.
"""

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine.campaign import Batch, Batches, Campaign
from beaver_ftc.studies.engine.crew import Case, Crew, LocalCrew, ThisProcess, Work
from beaver_ftc.studies.engine.files import clear_disk_errors, locked, remove_leftovers, write_whole
from beaver_ftc.studies.engine.identity import Identity
from beaver_ftc.studies.engine.parts import Parts, RowsAsJson

Progress = Callable[[float], None]
Fly = Callable[[Any], Any]
_GO_ON = "; what has been flown is kept, the same command goes on with it"


@contextlib.contextmanager
def flown(
    folder: Path,
    cases: Sequence[Any],
    fly: Fly,
    row: Any = dict,
    *,
    asked: Any = None,
    workers: int = 1,
    progress: Progress | None = None,
    lost: Callable[[Any, str], Any] | None = None,
) -> Iterator[list[Any]]:
    """Yield the rows of all cases, in their order whatever the number of workers; on success they go.

    folder: of the result. fly: from a case to its row, a value of the type `row`; it can be pickled, as the
    cases can. asked: what the rows follow from beside the cases. lost: the row of a case that kills its
    process each time; without it that is a SimulationFailed.
    """
    kept = folder.with_name(f".{folder.name}.flown")
    new = not folder.parent.exists()
    with clear_disk_errors(kept):
        kept.mkdir(parents=True, exist_ok=True)
    with locked(kept):
        identity = Identity.of("study", {"cases": repr(list(cases)), "asked": repr(asked)})
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
