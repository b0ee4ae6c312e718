"""The table of a sweep: one row a flight, `run` first, then what varied, then what came of it.

Nothing in it depends on the clock, the worker or the order of the flights: the same sweep gives the same
bytes.
"""

import contextlib
import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from beaver_ftc.documents import document as source
from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.documents.problems import key_path, problems_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import Sweep, Variation
from beaver_ftc.studies.sweep.sampling import Assignment, flight_seed

if TYPE_CHECKING:
    import pyarrow as pa

    from beaver_ftc.loop.outcome import Landing


Row = dict[str, Any]
Document = dict[str, Any]
Getter = Callable[[Document, "Landing"], Any]

FLOWN, DEPARTED, BAD_INPUT, FAILED, CRASHED = "flown", "departed", "bad_input", "failed", "crashed"
RESULTS = (FLOWN, DEPARTED)  # the statuses of a flight that has metrics

AXES = ("p", "q", "r")
MODES = ("adaptive", "reallocated", "unanticipated")


def _at(*path: str) -> Getter:
    """The value at a path of the metrics document; None where a section on the way is null."""

    def get(document: Document, flight: "Landing") -> Any:
        here: Any = document
        for part in path:
            here = None if here is None else here.get(part)
        return here

    return get


def _under(kind: str, section: str, *names: str) -> list[tuple[str, str, Getter]]:
    parts = section.split(".")
    return [(f"{section}.{name}", kind, _at(*parts, name)) for name in names]


def _first_entry(mode: str) -> Getter:
    def get(document: Document, flight: "Landing") -> Any:
        return next((change["time_s"] for change in document["supervisor"] if change["mode"] == mode), None)

    return get


def _of_pair(name: str, end: int) -> Getter:
    def get(document: Document, flight: "Landing") -> Any:
        pair = document["isolation"][name]
        return pair[end] if pair else None

    return get


def _flown_s(document: Document, flight: "Landing") -> float:
    return flight.frames / flight.scenario.rate_hz


def _missed_expectations(document: Document, flight: "Landing") -> str:
    return " ".join(found["name"] for found in document["expectations"] if not found["passed"])


def _faults(document: Document, flight: "Landing") -> str:
    """surface:type of each fault that was named, of several at once."""
    named = (found for found in document["isolation"]["faults"] if found["fault"])
    return " ".join(f"{found['fault']}:{found['type'] or 'open'}" for found in named)


Column = tuple[str, str, Getter]

_FLOWN: tuple[Column, ...] = (
    ("frames", "int", _at("frames")),
    ("flown_s", "float", _flown_s),
    ("fault_free_s", "float", _at("fault_free_s")),
    *_under("text", "fault", "actuator", "type"),
    *_under("float", "fault", "at_s"),
    *_under("flag", "detection", "detected"),
    *_under("float", "detection", "time_s", "delay_s", "guaranteed_delay_s"),
    *_under("text", "detection", "axis"),
    *_under("float", "detection.statistical", "time_s", "alarm_level", "closest_approach"),
    *_under("flag", "isolation", "isolated", "correct"),
    *_under("text", "isolation", "fault", "type"),
    *_under("float", "isolation", "time_s", "delay_s", "estimate"),
    *_under("flag", "isolation", "type_correct"),
    *_under("float", "isolation", "type_delay_s", "estimate_deg", "frequency_rad_s"),
    *(
        (f"isolation.{pair}.{end}", "float", _of_pair(pair, i))
        for pair, ends in (("estimate_interval", ("low", "high")), ("probing_s", ("from", "to")))
        for i, end in enumerate(ends)
    ),
    ("isolation.candidates", "text", lambda document, flight: " ".join(document["isolation"]["candidates"])),
    ("isolation.faults", "text", _faults),
    ("false_alarm", "flag", _at("false_alarm")),
    ("worst_residual_ratio", "float", lambda document, flight: flight.worst_residual_ratio),
    *_under("float", "tracking.pre_fault_rms_deg_s", *AXES),
    *_under("float", "tracking.post_fault_rms_deg_s", *AXES),
)
_PROFILE = ("altitude_m", "airspeed_mps", "airspeed_limited_mps", "heading_deg", "bank_deg")
_ENDED: tuple[Column, ...] = (
    ("supervisor.mode", "text", lambda document, flight: document["supervisor"][-1]["mode"]),
    *((f"supervisor.{mode}_at_s", "float", _first_entry(mode)) for mode in MODES),
    ("envelope_exits.count", "int", _at("envelope", "exits")),
    ("envelope_exits.total_s", "float", _at("envelope", "outside_s")),
    *_under("float", "departure", "time_s"),
    *_under("text", "departure", "signal"),
    *(column for a in AXES for column in _under("float", f"authority.{a}", "given_share", "beyond_s")),
    *_under("float", "profile", *_PROFILE),
    *_under("float", "arrival", "altitude_m", "airspeed_mps", "heading_deg", "bank_deg"),
    *_under("flag", "arrival", "in_envelope"),
    *_under("float", "engine_power", "from_s", "in_charge_s", "lowest_inhg", "highest_inhg"),
)
_JUDGED: tuple[Column, ...] = (
    ("expectations.missed", "text", _missed_expectations),
    ("passed", "flag", _at("passed")),
)


@cache
def columns_of(surfaces: tuple[str, ...]) -> tuple[Column, ...]:
    """(name, type, where from) of what came of each flight of an aircraft with these surfaces."""
    return (
        *_FLOWN,
        *_under("float", "tracking.surface_travel_deg", *surfaces),
        *_under("float", "tracking.surface_energy_deg2_s", *surfaces),
        *_ENDED,
        *_under("float", "saturation_s", *surfaces),
        *_JUDGED,
    )


def kind_of(how: Variation) -> str:
    """The type of a varied key's column: numbers and texts as they are, sections as JSON."""
    if how.choice is None:
        return "float"
    if all(isinstance(value, bool) for value in how.choice):
        return "flag"
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in how.choice)
    return "float" if numbers else "text"


def as_cell(value: Any, kind: str) -> Any:
    """A varied value as its column holds it."""
    if kind == "float":
        return float(value)
    return value if kind == "flag" or isinstance(value, str) else json.dumps(value)


def row_of(run: int, values: dict[str, Any], seed: int, document: Document, flight: "Landing") -> Row:
    """The row of a flight that has metrics."""
    departure = document["departure"]
    status = DEPARTED if departure else FLOWN
    reason = f"{departure['signal']} at {departure['time_s']:g} s" if departure else None
    columns = columns_of(flight.scenario.airframe.surfaces)
    metrics = {name: get(document, flight) for name, _, get in columns}
    return {"run": run, **values, "seed": seed, "status": status, "reason": reason, **metrics}


def row_of_failure(run: int, values: dict[str, Any], seed: int, status: str, reason: str) -> Row:
    """The row of a flight that has none, and why."""
    nothing = dict.fromkeys(name for name, _, _ in columns_of(()))
    return {"run": run, **values, "seed": seed, "status": status, "reason": reason, **nothing}


def schema_of(sweep: "Sweep") -> "pa.Schema":
    """The table's columns and their types."""
    import pyarrow as pa

    types = {"float": pa.float64(), "int": pa.int64(), "flag": pa.bool_(), "text": pa.string()}
    varied = [pa.field(key, types[kind_of(how)]) for key, how in sweep.file.vary.items()]
    columns = columns_of(sweep.aircraft.surfaces)
    metrics = [pa.field(name, types[kind]) for name, kind, _ in columns]
    return pa.schema([
        pa.field("run", pa.int64(), nullable=False), *varied, pa.field("seed", pa.int64(), nullable=False),
        pa.field("status", pa.string(), nullable=False), pa.field("reason", pa.string()), *metrics,
    ])  # fmt: skip


def table_of(sweep: "Sweep", schema: "pa.Schema", rows: Sequence[Row]) -> "pa.Table":
    """Rows in order of `run` as a table."""
    import pyarrow as pa

    kinds = {key: kind_of(how) for key, how in sweep.file.vary.items()}
    ordered = sorted(rows, key=lambda row: row["run"])
    columns = [
        [as_cell(row[name], kinds[name]) for row in ordered]
        if name in kinds
        else [row.get(name) for row in ordered]
        for name in schema.names
    ]
    return pa.Table.from_arrays(
        [pa.array(column, type=field.type) for column, field in zip(columns, schema, strict=True)],
        schema=schema,
    )


def counts_of_rows(rows: Sequence[Row]) -> Counter[str]:
    """How many flights: `done`, `failed` (no metrics), `faulted`, and `detected` of these."""
    counts: Counter[str] = Counter(done=len(rows))
    for row in rows:
        counts["failed"] += row["status"] not in RESULTS
        faulted = row["fault.type"] is not None
        counts["faulted"] += faulted
        counts["detected"] += faulted and bool(row["detection.detected"])
    return counts


def counts_of_table(table: "pa.Table") -> Counter[str]:
    """The same of a table."""
    return counts_of_rows(table.select(["status", "fault.type", "detection.detected"]).to_pylist())


KEEP_POLICIES = ("none", "failed", "missed", "worst", "all")


@dataclass(frozen=True)
class Keep:
    """Which flights leave a result folder of their own, and where."""

    policy: str = "none"
    runs: frozenset[int] = field(default_factory=frozenset)
    folder: Path = Path()

    def wants(self, row: Row) -> bool:
        """Whether the flight of this row is to be kept."""
        if self.policy == "all" or row["run"] in self.runs:
            return True
        if self.policy in ("failed", "missed") and (row["status"] != "flown" or row["passed"] is False):
            return True
        undetected = row["fault.type"] is not None and not row["detection.detected"]
        return self.policy == "missed" and bool(undetected or row["isolation.correct"] is False)


@dataclass(frozen=True)
class Job:
    """What a worker must know: the sweep, and which flights to keep."""

    sweep: Sweep
    keep: Keep = Keep()


def flight_name(sweep: Sweep, index: int) -> str:
    """The name of one flight, and of its result folder."""
    return f"{sweep.name}-{index:0{max(4, len(str(sweep.flights - 1)))}d}"


def scenario_of(sweep: Sweep, assignment: Assignment) -> Scenario:
    """The scenario of one flight. Raises BadInput if its values contradict each other."""
    seed = flight_seed(sweep.file.seed, assignment.run)
    try:
        return sweep.scenario(assignment.values, name=flight_name(sweep, assignment.run), seed=seed)
    except ValidationError as error:
        problem = next(iter(problems_of(error, source.Document(sweep.base), Scenario.model_json_schema())))
        raise BadInput(f"{key_path(problem.location)}: {problem.says}") from None


def fly_one(job: Job, assignment: Assignment) -> Row:
    """Fly one flight; whatever goes wrong with it is in its row."""
    row = _row(job.sweep, assignment)
    if job.keep.wants(row):
        keep_flight(job.sweep, assignment, job.keep.folder)
    return row


def lost(sweep: Sweep, assignment: Assignment, why: str) -> Row:
    """The row of a flight that ends its process."""
    return row_of_failure(*assignment, flight_seed(sweep.file.seed, assignment.run), CRASHED, why)


def warm_up(job: Job) -> None:
    """Fly two frames of the base, so that whatever is compiled or loaded once has been."""
    from beaver_ftc.loop.loop import fly

    with contextlib.suppress(Exception):  # whatever is wrong shows in the flights' rows
        base = job.sweep.scenario({})
        fly(base.model_copy(update={"duration_s": 2.0 / base.rate_hz, "faults": ()}))


def _row(sweep: Sweep, assignment: Assignment) -> Row:
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.metrics import metrics

    index, values = assignment
    seed = flight_seed(sweep.file.seed, index)
    try:
        flight: Landing = fly(scenario_of(sweep, assignment))
        return row_of(index, values, seed, metrics(flight), flight)
    except BadInput as error:
        return row_of_failure(index, values, seed, BAD_INPUT, str(error))
    except BeaverFtcError as error:
        return row_of_failure(index, values, seed, FAILED, str(error))
    except Exception as error:  # a plug-in may raise anything: one flight's end, not the sweep's
        return row_of_failure(index, values, seed, FAILED, f"{type(error).__name__}: {error}")


def keep_flight(
    sweep: Sweep, assignment: Assignment, folder: Path, report: bool = False
) -> dict[str, Any] | None:
    """Fly one flight as `run` would, into a result folder of its own; of a failure, keep the scenario."""
    from beaver_ftc.results.writer import result_folder, run
    from beaver_ftc.scenario.dump import to_yaml

    try:
        scenario = scenario_of(sweep, assignment)
    except BadInput:
        return None  # there is no such scenario: the row says why
    try:
        return run(scenario, folder, report)
    except Exception:  # as in its row, which says why
        with result_folder(folder, scenario.name) as partial:
            (partial / "scenario.yaml").write_text(to_yaml(scenario), encoding="utf-8")
        return None
