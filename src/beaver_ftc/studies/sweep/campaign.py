"""A sweep from beginning to end: fly what is missing, then say what it all shows."""

import json
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed
from beaver_ftc.results.metrics import as_json, versions
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine.store import clear_disk_errors, write_whole
from beaver_ftc.studies.engine.study import Campaign, Source
from beaver_ftc.studies.engine.workers import LocalWorkers, Work, Workers, cores
from beaver_ftc.studies.sweep.one_flight import Job, Keep, fly_one, keep_flight, lost, scenario_of, warm_up
from beaver_ftc.studies.sweep.sampling import Assignment, Plan
from beaver_ftc.studies.sweep.search import SearchSource, found
from beaver_ftc.studies.sweep.store import Store, SweepSource, identity_of

if TYPE_CHECKING:
    from beaver_ftc.studies.sweep.outcomes import Flights


Document = dict[str, Any]


class SweepStopped(BeaverFtcError):
    """The user stopped the sweep; what has been flown is kept."""

    exit_code = 130


@dataclass(frozen=True)
class Options:
    """How to fly a sweep; nothing here changes what comes out."""

    out: Path = Path("runs")
    workers: int | None = None  # of local processes, one a core; of Ray, two tasks a CPU
    backend: str = "local"
    address: str | None = None
    resume: bool = False
    keep: Keep = field(default_factory=Keep)
    report: bool = True
    search: str | None = None
    source: str = "FILE"


class _Flown(Source, Protocol):
    def tables(self) -> Any:
        """Every batch's table, in order."""


def named_for(sweep: Sweep, search: str | None) -> Sweep:
    """The sweep under the name of its result folder: a search has its own."""
    if search is None:
        return sweep
    return replace(sweep, file=sweep.file.model_copy(update={"name": f"{sweep.name}-search-{search}"}))


def run_sweep(
    sweep: Sweep,
    options: Options,
    progress: Callable[[Counter[str]], None] = lambda counts: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Document:
    """Fly a sweep into `out/<name>/` and return its summary.

    progress: told of the number of flights in all, `total`, and so far: `done`, `failed` (no metrics),
    `faulted`, and `detected` of these.

    Raises BadInput for a folder that holds another or an unfinished sweep, SimulationFailed where the folder
    cannot be written or no flight could be flown, SweepStopped once `stopped` says so.
    """
    sweep = named_for(sweep, options.search)
    so_far = Counter(total=sweep.flights)
    folder = options.out / sweep.name
    options = replace(options, keep=replace(options.keep, folder=(folder / "flights").resolve()))
    with Store(folder, sweep) as store:
        store.begin(identity_of(sweep, options.search), options.resume)
        if not store.is_compacted(sweep.flights):

            def landed(counts: Counter[str]) -> None:
                so_far.update(counts)
                progress(so_far)

            store.reopen()
            source = _source(sweep, options, store, landed)
            _fly_missing(source, sweep, options, so_far, stopped)
            store.compact(source.tables())
        store.parts.remove()
        return conclude(sweep, options, store)


def _source(sweep: Sweep, options: Options, store: Store, landed: Callable[[Counter[str]], None]) -> _Flown:
    if options.search:
        return SearchSource(sweep, options.search, store, landed)
    return SweepSource(sweep, store, landed)


def _fly_missing(
    source: _Flown, sweep: Sweep, options: Options, so_far: Counter[str], stopped: Callable[[], bool]
) -> None:
    if so_far["done"] < so_far["total"]:
        with closing(_workers(sweep, options)) as workers:
            Campaign(source, workers, partial(lost, sweep)).fly(stopped)
    if so_far["done"] < so_far["total"]:
        raise SweepStopped(
            f"{sweep.name}: stopped, {so_far['done']} of {so_far['total']} flights are kept; "
            "go on with the same command and --resume"
        )


def _workers(sweep: Sweep, options: Options) -> Workers:
    job = Job(sweep, options.keep)
    work = Work(partial(fly_one, job), partial(warm_up, job))
    if options.backend == "ray":
        from beaver_ftc.studies.engine.ray_workers import RayWorkers

        return RayWorkers(work, options.address, options.workers)
    return LocalWorkers(work, options.workers or cores())


def conclude(sweep: Sweep, options: Options, store: Store) -> Document:
    """Write what the flights of a complete `results.parquet` show; `summary.json`, last, says all is done."""
    from beaver_ftc.studies.sweep.outcomes import Flights, replay_command, worst_flights
    from beaver_ftc.studies.sweep.summary import evaluate, summarise

    flights = Flights.read(store.results, sweep)
    document = summarise(flights, sweep)
    if options.search:
        document["search"] = found(options.search, store.results, sweep)
    command = replay_command(options.source, options.out, options.search)
    document["worst"] = worst_flights(flights, sweep, command)
    steered = options.search is not None  # its rates say nothing about the flights in general
    document["expectations"] = [] if steered else evaluate(sweep.file.expect, flights)
    document["passed"] = all(expectation["passed"] for expectation in document["expectations"])
    document["versions"] = dict(versions())
    _keep_worst(sweep, options, document)
    if options.report:
        _draw(sweep, flights, document, store)
    store.write("summary.json", as_json(document))
    if not flights.measured.any():
        raise SimulationFailed(f"{sweep.name}: no flight could be flown: {document['reasons'][0]['reason']}")
    return document


def _keep_worst(sweep: Sweep, options: Options, document: Document) -> None:
    if options.keep.policy == "worst":
        for flight in document["worst"]:
            keep_flight(sweep, assignment_of(sweep, options, flight["run"]), options.keep.folder, report=True)


def _draw(sweep: Sweep, flights: "Flights", document: Document, store: Store) -> None:
    from beaver_ftc.studies.sweep.pictures import write_figures
    from beaver_ftc.studies.sweep.summary_page import render

    with clear_disk_errors(store.folder):
        write_figures(flights, document, store.folder / "figures")
    store.write("report.html", render(document, store.folder))


def assignment_of(sweep: Sweep, options: Options, index: int) -> Assignment:
    """The values of one flight of a sweep, or of a search as far as it has come. Raises BadInput."""
    if not 0 <= index < sweep.flights:
        raise BadInput(f"{sweep.name}: there is no flight {index}, allowed: 0 to {sweep.flights - 1}")
    if options.search is None:
        return Plan(sweep).assignments([index])[0]
    store = Store(options.out / sweep.name, sweep)
    return SearchSource(sweep, options.search, store, lambda rows: None).assignment(index)


def replay(sweep: Sweep, options: Options, index: int) -> Document:
    """Fly one flight of a sweep again, as `run` would, into `out/<sweep>/flights/`; return its metrics."""
    from beaver_ftc.results.writer import run

    sweep = named_for(sweep, options.search)
    folder = options.out / sweep.name
    scenario = scenario_of(sweep, assignment_of(sweep, options, index))
    document = run(scenario, folder / "flights", options.report)
    _link(folder)
    return document | {"folder": str(folder / "flights" / scenario.name)}


def _link(folder: Path) -> None:
    """Let the sweep's report, if there is one, lead to the flight that has just been flown."""
    from beaver_ftc.studies.sweep.summary_page import render

    if (folder / "report.html").exists():
        document = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        write_whole(folder / "report.html", render(document, folder).encode("utf-8"))
