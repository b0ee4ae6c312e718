"""A study's cases flown on all cores, kept as they land: what is stopped or killed goes on where it was.

While a study is under way its rows are in a hidden folder beside the result, `.<name>.flown`. The same
command finds them there. Once the result is written they go.
"""

import contextlib
import json
import math
import shutil
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results.writer import result_folder
from beaver_ftc.studies.engine.store import (
    Identity,
    Parts,
    RowsAsJson,
    clear_disk_errors,
    locked,
    remove_leftovers,
    write_whole,
)
from beaver_ftc.studies.engine.workers import (
    Case,
    LocalWorkers,
    Number,
    Row,
    Task,
    ThisProcess,
    Work,
    Workers,
)
from beaver_ftc.studies.present.page import Files, write_files

Progress = Callable[[float], None]
Fly = Callable[[Any], Any]
Lost = Callable[[Any, str], Any]
GO_ON = "; what has been flown is kept, the same command goes on with it"
POLL_S = 0.2
MOST_LOSSES = 3
TASKS_A_SLOT = 4  # towards the end tasks get smaller, so that no worker is left with a long last one
LOST = "the process that flies it ends, each time it is tried"


class Batch(NamedTuple):
    """Cases that land together; each has a `run`."""

    number: Number
    cases: tuple[Any, ...]


class Source(Protocol):
    """Where batches come from."""

    def next_batch(self) -> Batch | None:
        """The next batch to fly; None while (or when) there is none."""

    def cases_left(self) -> int:
        """How many cases are still to come after those handed out."""

    def landed(self, batch: Batch, rows: list[Row]) -> None:
        """All rows of a batch, in the order of its cases."""


class Batches:
    """A source that knows all its batches beforehand.

    of: number of cases in them. note: told of each that has landed. parts: where they are kept.
    """

    def __init__(
        self, batches: Iterable[Batch], of: int, note: Callable[[Batch, list[Row]], Any],
        parts: Parts | None = None,
    ) -> None:  # fmt: skip
        self._coming, self._left, self._note, self._parts = iter(batches), of, note, parts

    def next_batch(self) -> Batch | None:
        batch = next(self._coming, None)
        self._left -= len(batch.cases) if batch else 0
        return batch

    def cases_left(self) -> int:
        return self._left

    def landed(self, batch: Batch, rows: list[Row]) -> None:
        if self._parts is not None:
            self._parts.land(batch.number, rows)
        self._note(batch, rows)


class Campaign:
    """Workers at work on one source: tasks are handed out, rows gathered, whole batches landed.

    A lost worker's task is flown again. One that is lost twice is taken apart into single cases, so that the
    case that kills its process is found: lost alone three times, it is given the row of a case that was lost.
    lost: the row of a case that kills its process.
    """

    def __init__(self, source: Source, workers: Workers, lost: Callable[[Any, str], Row]) -> None:
        self._source, self._workers, self._lost = source, workers, lost
        self._waiting: deque[Task] = deque()
        self._flying = 0
        self._batches: dict[Number, tuple[Batch, dict[int, Row]]] = {}
        self._losses: Counter[tuple[int, ...]] = Counter()

    def fly(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Fly until there is nothing left; once `stopped`, only what is in the air."""
        while True:
            self._hand_out(stopped())
            if not self._flying:
                return
            whole = [batch for outcome in self._workers.outcomes(POLL_S) for batch in self._gather(*outcome)]
            self._hand_out(stopped())  # first put the workers to work, then see to the disk
            for batch, rows in whole:
                self._source.landed(batch, [rows[case.run] for case in batch.cases])

    def _hand_out(self, stopped: bool) -> None:
        while self._flying < self._workers.slots and not stopped:
            if not self._waiting and not self._open_batch():
                return
            self._workers.submit(self._waiting.popleft())
            self._flying += 1

    def _open_batch(self) -> bool:
        batch = self._source.next_batch()
        if batch is None:
            return False
        self._batches[batch.number] = (batch, {})
        left = len(batch.cases) + self._source.cases_left()
        size = max(1, math.ceil(left / (self._workers.slots * TASKS_A_SLOT)))
        self._waiting.extend(_tasks(batch.number, batch.cases, size))
        return True

    def _gather(self, task: Task, rows: list[Row] | None) -> list[tuple[Batch, dict[int, Row]]]:
        """The batch that these rows complete, if they do."""
        self._flying -= 1
        batch, so_far = self._batches[task.batch]
        flown = self._fly_again(task) if rows is None else zip(task.cases, rows, strict=True)
        so_far.update((case.run, row) for case, row in flown)
        if len(so_far) < len(batch.cases):
            return []
        del self._batches[task.batch]
        return [(batch, so_far)]

    def _fly_again(self, task: Task) -> list[tuple[Any, Row]]:
        """See to a lost task; the (case, row) it yields all the same."""
        key = tuple(case.run for case in task.cases)
        self._losses[key] += 1
        if len(key) == 1 and self._losses[key] >= MOST_LOSSES:
            return [(task.cases[0], self._lost(task.cases[0], LOST))]
        size = 1 if self._losses[key] > 1 else len(key)
        self._waiting.extendleft(reversed(_tasks(task.batch, task.cases, size)))
        return []


def _tasks(batch: Number, cases: Sequence[Any], size: int) -> list[Task]:
    return [Task(batch, tuple(cases[i : i + size])) for i in range(0, len(cases), size)]


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
    return _all_rows(None, cases, Work(partial(_fly_case, fly)), workers, progress, _fail)


def conduct(source: Batches, work: Work, workers: int, lost: Callable[[Any, str], Any]) -> None:
    """Fly all batches of a source: in this process if but one worker is asked for."""
    flying: Workers
    if not source.cases_left():
        return
    most = max(1, min(workers, source.cases_left()))
    flying = ThisProcess(work) if workers <= 1 else LocalWorkers(work, most)
    with contextlib.closing(flying):
        Campaign(source, flying, lost).fly()


def _begin(kept: Path, identity: Identity, codec: RowsAsJson) -> Parts:
    """The parts of this very study; those of another, or of other versions, are of no use to it."""
    manifest, parts = kept / "study.json", Parts(kept / "parts", codec, GO_ON)
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
    parts: Parts | None, cases: Sequence[Any], work: Work, workers: int, progress: Progress | None, lost: Any
) -> list[Any]:
    """What has landed in the parts is read from there: the same rows, whenever they were flown."""
    rows: dict[int, Any] = {}

    def take(number: int, flown: list[Any] | None) -> None:
        found = flown if parts is None else parts.landed(number, [number])
        if found is not None:
            rows[number] = found[0]
            if progress:
                progress(len(rows) / len(cases))

    for number in range(len(cases)):
        take(number, None)
    missing = [Batch(n, (Case(n, case),)) for n, case in enumerate(cases) if n not in rows]
    source = Batches(missing, len(missing), lambda batch, flown: take(batch.cases[0].run, flown), parts)
    conduct(source, work, workers, lost)
    return [rows[number] for number in range(len(cases))]


def _fly_case(fly: Fly, case: Case) -> Any:
    return fly(case.what)


def _fail(case: Any, why: str) -> Any:
    raise SimulationFailed(f"{case.what}: {why}{GO_ON}")
