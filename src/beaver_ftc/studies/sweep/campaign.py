"""A sweep from beginning to end: fly what is missing, then say what it all shows."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed
from beaver_ftc.documents.files import read_json
from beaver_ftc.results.folder import clear_disk_errors
from beaver_ftc.results.metrics import as_json, versions
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine.files import write_whole
from beaver_ftc.studies.engine.processes import cores
from beaver_ftc.studies.engine.store import batches_of
from beaver_ftc.studies.engine.study import Flying
from beaver_ftc.studies.engine.workers import LocalWorkers, Number, Work, Workers
from beaver_ftc.studies.sweep import one_flight
from beaver_ftc.studies.sweep.one_flight import Keep, counts_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan
from beaver_ftc.studies.sweep.search import found, generations, members
from beaver_ftc.studies.sweep.store import Store, identity_of

if TYPE_CHECKING:
    from beaver_ftc.studies.sweep.outcomes import Flights

There = Callable[[Number, Any], None]  # takes the number and the rows of each batch, once they are there
FRAMES_A_BATCH = 50_000  # a third of a second of work: little to lose, and a file costs no share worth saying
MOST_A_BATCH = 256
MOST_BATCHES = 4_000  # of a sweep of millions: so many files are read again in seconds


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
            (folder / "summary.json").unlink(missing_ok=True)  # let nobody take the sweep for finished

            def there(number: Number, rows: Any) -> None:
                so_far.update(counts_of(rows))
                progress(so_far)

            _fly_missing(sweep, options, store, there, stopped)
            if so_far["done"] < so_far["total"]:
                raise SweepStopped(
                    f"{sweep.name}: stopped, {so_far['done']} of {so_far['total']} flights are kept; "
                    "go on with the same command and --resume"
                )
            store.compact(store.landed(*batch) for batch in _batches(sweep, options))
        store.parts.remove()
        return conclude(sweep, options, store)


def _fly_missing(
    sweep: Sweep, options: Options, store: Store, there: There, stopped: Callable[[], bool]
) -> None:
    """Fly what is not there; of a search each generation once the one before has landed."""
    make = partial(_workers, sweep, options)
    lost = partial(one_flight.lost, sweep)
    with closing(Flying(store.landed, store.parts.land, make, lost)) as flying:
        if not options.search:
            flying.fly(_batches(sweep, options), Plan(sweep).assignments, there, stopped)
            return
        for number, runs, cases in generations(sweep, options.search, store):
            flying.fly([(number, runs)], {runs: cases}.__getitem__, there, stopped)


def _batches(sweep: Sweep, options: Options) -> Iterator[tuple[int, range]]:
    """(number, runs) of each batch, from the sweep alone, so that a resumed sweep has the same batches. Of a
    search each is a generation."""
    if options.search:
        return batches_of(sweep.flights, members(len(sweep.keys)))
    scenario = sweep.scenario({})
    frames = scenario.duration_s * scenario.rate_hz * scenario.substeps
    size = max(1, min(MOST_A_BATCH, round(FRAMES_A_BATCH / frames)))
    return batches_of(sweep.flights, max(size, math.ceil(sweep.flights / MOST_BATCHES)))


def _workers(sweep: Sweep, options: Options, flights: int) -> Workers:
    work = Work(partial(one_flight.fly_one, sweep, keep=options.keep), partial(one_flight.warm_up, sweep))
    if options.backend == "ray":
        from beaver_ftc.studies.engine.ray_workers import RayWorkers

        return RayWorkers(work, options.address, options.workers)
    return LocalWorkers(work, options.workers or cores())


def conclude(sweep: Sweep, options: Options, store: Store) -> Document:
    """Write what the flights of a complete `results.parquet` show; `summary.json`, last, says all is done."""
    from beaver_ftc.studies.sweep.outcomes import Flights
    from beaver_ftc.studies.sweep.summary import evaluate, summarise
    from beaver_ftc.studies.sweep.worst import replay_command, worst_flights

    flights = Flights(store.results, sweep)
    document = summarise(flights, sweep)
    if options.search:
        document["search"] = found(options.search, store.results, sweep)
    command = replay_command(options.source, options.out, options.search)
    document["worst"] = worst_flights(flights, sweep, command)
    # the rates of a search say nothing about the flights in general
    document["expectations"] = [] if options.search else evaluate(sweep.file.expect, flights)
    document["passed"] = all(expectation["passed"] for expectation in document["expectations"])
    document["versions"] = dict(versions())
    if options.keep.policy == "worst":
        for flight in document["worst"]:
            kept = assignment_of(sweep, options, flight["run"])
            one_flight.keep_flight(sweep, kept, options.keep, report=True)
    if options.report:
        _draw(sweep, flights, document, store)
    store.write("summary.json", as_json(document))
    if not flights.measured.any():
        raise SimulationFailed(f"{sweep.name}: no flight could be flown: {document['reasons'][0]['reason']}")
    return document


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
    for _, runs, cases in generations(sweep, options.search, Store(options.out / sweep.name, sweep)):
        if index in runs:
            return cases[index - runs[0]]
    raise BadInput(f"flight {index} of {sweep.name} is not known yet: the search has not come so far")


def replay(sweep: Sweep, options: Options, index: int) -> Document:
    """Fly one flight of a sweep again, as `run` would, into `out/<sweep>/flights/`; return its metrics."""
    from beaver_ftc.results.writer import run
    from beaver_ftc.studies.sweep.summary_page import render

    sweep = named_for(sweep, options.search)
    folder = options.out / sweep.name
    scenario = one_flight.scenario_of(sweep, assignment_of(sweep, options, index))
    document = run(scenario, folder / "flights", options.report, certified=options.keep.certified)
    if (folder / "report.html").exists():  # let it lead to the flight
        summary = read_json(folder / "summary.json")
        write_whole(folder / "report.html", render(summary, folder).encode("utf-8"))
    return document | {"folder": str(folder / "flights" / scenario.name)}
