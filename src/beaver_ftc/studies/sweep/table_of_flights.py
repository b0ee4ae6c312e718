"""A sweep from Python: a scenario, what varies, and the table of its flights."""

import contextlib
import re
import sys
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from beaver_ftc.documents.document import Document, plain
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.units import units
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.schema import ScenarioLike, load
from beaver_ftc.scenario.sweeps import Sweep, validate_sweep

if TYPE_CHECKING:
    import pyarrow as pa
    from pandas import DataFrame


def sweep(
    scenario: ScenarioLike,
    vary: Mapping[str, Mapping[str, Any]],
    runs: int | None = None,
    *,
    workers: int = 1,
    seed: int = 1,
    sampling: str = "random",
    expect: Mapping[str, Any] | None = None,
    out: str | PathLike[str] | None = None,
) -> "DataFrame":
    """Fly a scenario many times, and return a DataFrame with one row for each flight.

    - `scenario`: a built-in name, the path of a file, a mapping or a `Scenario`.
    - `vary`: a mapping from dotted key to its variation, e.g.
      `{"faults[0].magnitude": {"uniform": [0.2, 1.0]}}`.
    - `runs`: number of flights. By default, each point of the grid of varied values is flown once.
    - `workers`: number of processes. The results are the same for any number of processes.
    - `seed`, `sampling`, `expect`: the keys with these names in a sweep file.
    - `out`: folder for the results. The sweep makes a new folder in it, and writes results.parquet,
      summary.json and report.html there.

    The DataFrame has the columns of results.parquet. Its `attrs` contain scenario, seed, varied keys and
    units. If a flight fails, its row contains the reason. Raises BadInput if a key or value is wrong. The
    message names the key.
    """
    requested = {"vary": vary, "runs": runs, "seed": seed, "sampling": sampling, "expect": expect or {}}
    plan = _made(scenario, {key: value for key, value in requested.items() if value is not None})
    if not isinstance(workers, int) or workers < 1:
        raise BadInput(f"workers: {workers!r:.60} is not usable, allowed: a whole number of at least 1")
    table = _here(plan) if workers == 1 and out is None else _kept(plan, workers, out)
    frame = table.to_pandas()
    varied = plain(vary)
    frame.attrs = {"scenario": plan.name, "seed": seed, "vary": varied, "units": units(frame.columns)}
    return frame


def _made(scenario: ScenarioLike, requested: dict[str, Any]) -> Sweep:
    """The sweep of a scenario with the requested keys, checked as a sweep file is."""
    base = load(scenario)
    name = re.sub(r"[^A-Za-z0-9_-]", "-", base.name)[:64]
    data = {"name": f"{name}-sweep", "base": plain(base), **plain(requested)}
    with checked_against(base.airframe, base.aircraft):
        return validate_sweep(Document(data), folder=Path())


def _here(plan: Sweep) -> "pa.Table":
    """The table of a sweep that is flown in this process, without files."""
    from beaver_ftc.studies.sweep.one_flight import fly_one, schema_of, table_of
    from beaver_ftc.studies.sweep.sampling import Plan

    rows = [fly_one(plan, flight) for flight in Plan(plan).assignments(range(plan.flights))]
    return table_of(plan, schema_of(plan), rows)


def _kept(plan: Sweep, workers: int, out: str | PathLike[str] | None) -> "pa.Table":
    """The table of a sweep that worker processes fly into a result folder. out: its parent; None is a
    temporary folder."""
    import pyarrow.parquet as pq

    from beaver_ftc.studies.sweep.campaign import Options, run_sweep

    with TemporaryDirectory(prefix="beaver-ftc-") as scratch, _main_hidden():
        folder = Path(scratch if out is None else out)
        run_sweep(plan, Options(out=folder, workers=workers, report=out is not None))
        return pq.read_table(folder / plan.name / "results.parquet")


@contextlib.contextmanager
def _main_hidden() -> Iterator[None]:
    """Hide the main module from workers that start during the block. They would import the script of the
    caller, which would start the sweep again."""
    main = vars(sys.modules["__main__"])
    hidden = {name: value for name, value in main.items() if name in ("__file__", "__spec__")}
    main.pop("__file__", None)
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(hidden)
