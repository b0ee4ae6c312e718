"""A sweep from begin to end: fly the missing flights, then write the summary of all."""

import math
from collections import Counter
from collections.abc import Callable, Iterable
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
from beaver_ftc.scenario.sweeps import Sweep, SweepExpect
from beaver_ftc.studies.engine.flying import Flying
from beaver_ftc.studies.engine.processes import cores
from beaver_ftc.studies.engine.store import batches_of
from beaver_ftc.studies.engine.workers import LocalWorkers, Number, Work, Workers
from beaver_ftc.studies.present.tables import values_of
from beaver_ftc.studies.sweep import one_flight
from beaver_ftc.studies.sweep.one_flight import Keep, counts_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan, Round
from beaver_ftc.studies.sweep.search import generations, search_result
from beaver_ftc.studies.sweep.store import Store, identity_of

if TYPE_CHECKING:
    from beaver_ftc.studies.sweep.outcomes import Flights

OnLanded = Callable[[Number, Any], None]  # takes the number and the rows of each batch, once it has landed
FRAMES_A_BATCH = 50_000  # a lost batch is little work, and writing a file costs little of it
MOST_A_BATCH = 256  # flights in a batch, unless there would be more than MOST_BATCHES
MOST_BATCHES = 4_000  # so many files are read again in seconds


class SweepStopped(BeaverFtcError):
    """The user stopped the sweep; what has been flown is kept."""

    exit_code = 130


@dataclass(frozen=True)
class Options:
    """How to fly a sweep. Only `search` changes the flights.

    - out: folder of the result folder. workers: number of local processes, one for each core by default; for
      Ray, number of tasks, two for each CPU by default. backend: `local` or `ray`. address: of the Ray
      cluster.
    - resume: whether to continue an earlier sweep. keep: which flights leave a folder of their own. report:
      whether figures and report are written; a worst flight that is kept has a report of its own in any case.
    - search: the objective of a worst-case search, or None. source: the sweep file, as the command line names
      it.
    """

    out: Path = Path("runs")
    workers: int | None = None
    backend: str = "local"
    address: str | None = None
    resume: bool = False
    keep: Keep = field(default_factory=Keep)
    report: bool = True
    search: str | None = None
    source: str = "FILE"


def named_for(sweep: Sweep, search: str | None) -> Sweep:
    """The sweep with the name of its result folder. A search has another name, and no expectations, because
    its rates say nothing about flights in general."""
    if search is None:
        return sweep
    changed = {"name": f"{sweep.name}-search-{search}", "expect": SweepExpect()}
    return replace(sweep, file=sweep.file.model_copy(update=changed))


def run_sweep(
    sweep: Sweep,
    options: Options,
    progress: Callable[[Counter[str]], None] = lambda counts: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Document:
    """Fly a sweep into `out/<name>/` and return its summary.

    progress: called with the numbers of flights: `total` of the sweep, and so far `done`, `failed` (without
    metrics), `faulted`, and `detected` of these (`counts_of`). stopped: whether the user has stopped the
    sweep.

    Raises BadInput for a folder from which this sweep may not begin or go on (`Store.begin`),
    SimulationFailed where the folder cannot be written or no flight could be flown, SweepStopped if `stopped`
    is true before all flights are flown.
    """
    sweep = named_for(sweep, options.search)
    so_far = Counter(total=sweep.flights)
    folder = options.out / sweep.name
    options = replace(options, keep=replace(options.keep, folder=(folder / "flights").resolve()))
    with Store(folder, sweep) as store:
        store.begin(identity_of(sweep, options.search), options.resume)
        if not store.is_compacted(sweep.flights):
            (folder / "summary.json").unlink(missing_ok=True)  # summary.json marks a finished sweep

            def on_landed(number: Number, rows: Any) -> None:
                so_far.update(counts_of(rows))
                progress(so_far)

            batches = _fly_missing(sweep, options, store, on_landed, stopped)
            if so_far["done"] < so_far["total"]:
                raise SweepStopped(
                    f"{sweep.name}: stopped, {so_far['done']} of {so_far['total']} flights are kept; "
                    "go on with the same command and --resume"
                )
            store.compact(store.landed(*batch) for batch in batches)
        store.parts.remove()
        return conclude(sweep, options, store)


def _fly_missing(
    sweep: Sweep, options: Options, store: Store, on_landed: OnLanded, stopped: Callable[[], bool]
) -> list[tuple[int, range]]:
    """Fly the missing batches, each round after the one before has landed. Returns the batches of all
    rounds."""
    batches_flown: list[tuple[int, range]] = []
    make = partial(_workers, sweep, options)
    lost = partial(one_flight.lost, sweep)
    with closing(Flying(store.landed, store.parts.land, make, lost)) as flying:
        for batches, cases_of in _rounds(sweep, options, store):
            flying.fly(batches, cases_of, on_landed, stopped)
            batches_flown += batches
    return batches_flown


def _rounds(sweep: Sweep, options: Options, store: Store) -> Iterable[Round]:
    """One round with all flights; for a search, a round for each generation, once those before have landed.

    The batches depend on the sweep alone, so that a resumed sweep has the same batches.
    """
    if options.search:
        return generations(sweep, options.search, store)
    scenario = sweep.scenario({})
    frames = scenario.duration_s * scenario.rate_hz * scenario.substeps
    size = max(1, min(MOST_A_BATCH, round(FRAMES_A_BATCH / frames)))
    size = max(size, math.ceil(sweep.flights / MOST_BATCHES))
    return [Round(list(batches_of(sweep.flights, size)), Plan(sweep).assignments)]


def _workers(sweep: Sweep, options: Options, flights: int) -> Workers:
    """The workers of the backend. flights: number of missing flights; the number of workers does not depend
    on it."""
    work = Work(partial(one_flight.fly_one, sweep, keep=options.keep), partial(one_flight.warm_up, sweep))
    if options.backend == "ray":
        from beaver_ftc.studies.engine.ray_workers import RayWorkers

        return RayWorkers(work, options.address, options.workers)
    return LocalWorkers(work, options.workers or cores())


def conclude(sweep: Sweep, options: Options, store: Store) -> Document:
    """Write the results of a complete `results.parquet`: the worst flights if they are to be kept, figures
    and report; `summary.json` last, since it marks a finished sweep. Raises SimulationFailed if no flight
    could be flown.

    sweep, options: as `run_sweep` has changed them, with the name and the folder of the kept flights.
    """
    from beaver_ftc.studies.sweep.outcomes import Flights

    flights = Flights(store.results, sweep)
    document = _summary(sweep, options, flights, store.results)
    if options.keep.policy == "worst":
        for flight in document["worst"]:
            assignment = assignment_of(sweep, options, flight["run"])
            one_flight.keep_flight(sweep, assignment, options.keep, report=True)
    if options.report:
        _draw(flights, document, store)
    store.write("summary.json", as_json(document))
    if not flights.measured.any():
        raise SimulationFailed(f"{sweep.name}: no flight could be flown: {document['reasons'][0]['reason']}")
    return document


def _summary(sweep: Sweep, options: Options, flights: "Flights", results: Path) -> Document:
    """The content of `summary.json`."""
    from beaver_ftc.studies.sweep.expectations import evaluate
    from beaver_ftc.studies.sweep.summary import summarise
    from beaver_ftc.studies.sweep.worst import replay_command, worst_flights

    command = replay_command(options.source, options.out, options.search)
    expectations = evaluate(sweep.file.expect, flights)
    return {
        **summarise(flights, sweep),
        **({"search": search_result(options.search, results, sweep)} if options.search else {}),
        "worst": worst_flights(flights, sweep, command),
        "expectations": expectations,
        "passed": all(values_of(expectations, "passed")),
        "versions": dict(versions()),
    }


def _draw(flights: "Flights", document: Document, store: Store) -> None:
    """Write the figures and the report, which contains them."""
    from beaver_ftc.studies.sweep.pictures import write_figures
    from beaver_ftc.studies.sweep.summary_page import render

    with clear_disk_errors(store.folder):
        write_figures(flights, document, store.folder / "figures")
    store.write("report.html", render(document, store.folder))


def assignment_of(sweep: Sweep, options: Options, index: int) -> Assignment:
    """The values of one flight of a sweep, or of a generation of a search that has begun. sweep: with the
    name of `named_for`. Raises BadInput for any other flight."""
    if not 0 <= index < sweep.flights:
        raise BadInput(f"{sweep.name}: there is no flight {index}, allowed: 0 to {sweep.flights - 1}")
    for batches, cases_of in _rounds(sweep, options, Store(options.out / sweep.name, sweep)):
        if any(index in runs for _, runs in batches):
            return cases_of([index])[0]
    raise BadInput(f"flight {index} of {sweep.name} is not known yet: the search has not come so far")


def replay(sweep: Sweep, options: Options, index: int) -> Document:
    """Fly one flight of a sweep again, as `run` does, into `out/<sweep>/flights/`; return its metrics
    with the path of its folder. A report of the sweep is written again, with a link to it."""
    from beaver_ftc.results.writer import run
    from beaver_ftc.studies.sweep.summary_page import render

    sweep = named_for(sweep, options.search)
    folder = options.out / sweep.name
    scenario = one_flight.scenario_of(sweep, assignment_of(sweep, options, index))
    document = run(scenario, folder / "flights", options.report, certified=options.keep.certified)
    if (folder / "report.html").exists():
        summary = read_json(folder / "summary.json")
        Store(folder, sweep).write("report.html", render(summary, folder))
    return document | {"folder": str(folder / "flights" / scenario.name)}
