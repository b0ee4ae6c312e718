"""One flight of a sweep: its scenario, its row of the table, and its result folder if it is kept.

A row has the columns `run`, the varied keys, the other columns of FIXED, and the results (columns.py).
Nothing in it depends on the clock, the worker or the order of the flights: the same sweep gives the same
bytes.
"""

import contextlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from beaver_ftc.documents import document as source
from beaver_ftc.documents.allowed import problems_of
from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.documents.files import Document
from beaver_ftc.documents.report import key_path
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import Sweep, Variation
from beaver_ftc.studies.sweep.columns import WORST_RATIO, columns_of, getter_of
from beaver_ftc.studies.sweep.sampling import Assignment, flight_seed

if TYPE_CHECKING:
    import pyarrow as pa

    from beaver_ftc.loop.outcome import Landing


Row = Document

FLOWN, DEPARTED, BAD_INPUT, FAILED, CRASHED = "flown", "departed", "bad_input", "failed", "crashed"
RESULTS = (FLOWN, DEPARTED)  # the statuses of a flight that has metrics
# Columns of every sweep, and their types. The varied keys stand behind the first.
FIXED = {"run": "int", "seed": "int", "status": "text", "reason": "text"}


def kind_of(variation: Variation) -> str:
    """The type of the column of a varied key: numbers and flags as they are; all else as text, sections as
    JSON."""
    types = {type(value) for value in variation.choice or (0.0,)}
    if types == {bool}:
        return "flag"
    return "float" if types <= {int, float} else "text"


def as_cell(value: Any, kind: str) -> Any:
    """A varied value as a cell of its column; in a column of text, JSON of a value that is no text."""
    if kind == "float":
        return float(value)
    return value if kind == "flag" or isinstance(value, str) else json.dumps(value)


def row_of(assignment: Assignment, flight_metrics: Metrics, flight: "Landing") -> Row:
    """The row of a flight that has metrics."""
    departure = flight_metrics.departure
    status = DEPARTED if departure else FLOWN
    reason = f"{departure.signal} at {departure.time_s:g} s" if departure else None
    columns = columns_of(flight.scenario.airframe.surfaces)
    metrics = {name: getter_of(name)(flight_metrics) for name in columns}
    metrics[WORST_RATIO] = flight.worst_residual_ratio
    return _row(assignment, flight_metrics.seed, status, reason, metrics)


def row_of_failure(sweep: Sweep, assignment: Assignment, status: str, reason: str) -> Row:
    """The row of a flight without metrics. status, reason: why it has none."""
    seed = flight_seed(sweep.file.seed, assignment.run)
    return _row(assignment, seed, status, reason, dict.fromkeys(columns_of(())))


def _row(assignment: Assignment, seed: int, status: str, reason: str | None, metrics: Row) -> Row:
    """A row; metrics: its columns with results."""
    run, values = assignment
    return {"run": run, **values, "seed": seed, "status": status, "reason": reason, **metrics}


def schema_of(sweep: "Sweep") -> "pa.Schema":
    """The columns of the table and their types."""
    import pyarrow as pa

    types = {"float": pa.float64(), "int": pa.int64(), "flag": pa.bool_(), "text": pa.string()}
    first, *others = [pa.field(name, types[kind], nullable=name == "reason") for name, kind in FIXED.items()]
    varied = [pa.field(key, types[kind_of(variation)]) for key, variation in sweep.file.vary.items()]
    metrics = [pa.field(name, types[kind]) for name, kind in columns_of(sweep.aircraft.surfaces).items()]
    return pa.schema([first, *varied, *others, *metrics])


def table_of(sweep: "Sweep", schema: "pa.Schema", rows: Sequence[Row]) -> "pa.Table":
    """Rows in order of `run` as a table."""
    import pyarrow as pa

    kinds = {key: kind_of(variation) for key, variation in sweep.file.vary.items()}
    ordered = sorted(rows, key=itemgetter("run"))
    cells = [row | {key: as_cell(row[key], kind) for key, kind in kinds.items()} for row in ordered]
    return pa.Table.from_pylist(cells, schema=schema)


def counts_of(rows: "Sequence[Row] | pa.Table") -> Counter[str]:
    """Numbers of flights: `done`, `failed` (without metrics), `faulted`, and `detected` of these: with an
    alarm, also a false one."""
    if not isinstance(rows, Sequence):
        rows = rows.select(["status", "fault.type", "detection.detected"]).to_pylist()
    faulted = [row for row in rows if row["fault.type"] is not None]
    return Counter(
        done=len(rows), failed=sum(row["status"] not in RESULTS for row in rows), faulted=len(faulted),
        detected=sum(bool(row["detection.detected"]) for row in faulted),
    )  # fmt: skip


KEEP_POLICIES = ("none", "failed", "missed", "worst", "all")  # campaign.py keeps the worst flights at the end


@dataclass(frozen=True)
class Keep:
    """Which flights get a result folder of their own.

    - policy: one of KEEP_POLICIES. `failed`: flights that are lost, failed or do not meet expectations.
      `missed`: also those with a missed fault or a wrong name. `worst`: none yet, see `campaign.conclude`.
    - runs: numbers of further flights.
    - folder: of the result folders. certified: whether certificates are written.
    """

    policy: str = "none"
    runs: frozenset[int] = field(default_factory=frozenset)
    folder: Path = Path()
    certified: bool = False

    def wants(self, row: Row) -> bool:
        """Whether the flight of this row is to be kept."""
        if self.policy == "all" or row["run"] in self.runs:
            return True
        if self.policy in ("failed", "missed") and (row["status"] != FLOWN or row["passed"] is False):
            return True
        undetected = row["fault.type"] is not None and not row["detection.detected"]
        return self.policy == "missed" and bool(undetected or row["isolation.correct"] is False)


def flight_name(sweep: Sweep, index: int) -> str:
    """The name of one flight, and of its result folder."""
    return f"{sweep.name}-{index:0{max(4, len(str(sweep.flights - 1)))}d}"


def scenario_of(sweep: Sweep, assignment: Assignment) -> Scenario:
    """The scenario of one flight. Raises BadInput if its values do not fit together."""
    seed = flight_seed(sweep.file.seed, assignment.run)
    try:
        return sweep.scenario(assignment.values, name=flight_name(sweep, assignment.run), seed=seed)
    except ValidationError as error:
        data = source.Document(sweep.data_with(assignment.values))
        problem = next(iter(problems_of(error, data, Scenario.model_json_schema())))
        raise BadInput(f"{key_path(problem.location)}: {problem.says}") from None


def fly_one(sweep: Sweep, assignment: Assignment, keep: Keep | None = None) -> Row:
    """Fly one flight and return its row, also if it fails."""
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.metrics import measure

    try:
        flight = fly(scenario_of(sweep, assignment))
        row = row_of(assignment, measure(flight), flight)
    except BadInput as error:
        row = row_of_failure(sweep, assignment, BAD_INPUT, str(error))
    except BeaverFtcError as error:
        row = row_of_failure(sweep, assignment, FAILED, str(error))
    except Exception as error:  # a plug-in may raise anything, and the sweep continues
        row = row_of_failure(sweep, assignment, FAILED, f"{type(error).__name__}: {error}")
    if keep and keep.wants(row):
        keep_flight(sweep, assignment, keep)
    return row


def lost(sweep: Sweep, assignment: Assignment, why: str) -> Row:
    """The row of a flight that ends its process."""
    return row_of_failure(sweep, assignment, CRASHED, why)


def warm_up(sweep: Sweep) -> None:
    """Fly two frames of the base scenario, so that all code is compiled and loaded."""
    from beaver_ftc.loop.loop import fly

    with contextlib.suppress(Exception):  # an error shows in the rows of the flights
        base = sweep.scenario({})
        fly(base.model_copy(update={"duration_s": 2.0 / base.rate_hz, "faults": ()}))


def keep_flight(sweep: Sweep, assignment: Assignment, keep: Keep, report: bool = False) -> None:
    """Fly one flight as `run` does, into a result folder of its own. If it fails, keep its scenario, if it
    has one."""
    from beaver_ftc.results.folder import result_folder
    from beaver_ftc.results.writer import NotAllWritten, run
    from beaver_ftc.scenario.dump import to_yaml

    try:
        scenario = scenario_of(sweep, assignment)
    except BadInput:
        return  # there is no scenario; the row has the reason
    try:
        run(scenario, keep.folder, report, certified=keep.certified and scenario.fdi.is_ours)
    except NotAllWritten:
        return  # log and scenario are kept
    except Exception:  # the row has the reason
        with result_folder(keep.folder, scenario.name) as partial:
            (partial / "scenario.yaml").write_text(to_yaml(scenario), encoding="utf-8")
