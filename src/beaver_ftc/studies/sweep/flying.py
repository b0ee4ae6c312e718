"""One flight of a sweep: its scenario, its row, and on request its log. What runs in the workers."""

import contextlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from beaver_ftc.documents.document import Document
from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.documents.problems import key_path, problems_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweep_loader import Sweep
from beaver_ftc.studies.sweep.sampling import Assignment, flight_seed
from beaver_ftc.studies.sweep.table import BAD_INPUT, CRASHED, FAILED, Row, row_of, row_of_failure

if TYPE_CHECKING:
    from beaver_ftc.loop.flight import Flight

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
        problem = next(iter(problems_of(error, Document(sweep.base), Scenario.model_json_schema())))
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
        flight: Flight = fly(scenario_of(sweep, assignment))
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
    from beaver_ftc.results.run import run
    from beaver_ftc.results.writer import result_folder
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
