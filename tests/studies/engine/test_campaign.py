"""The engine with workers that are lost, shuffle their outcomes, or die over one flight."""

import random

import pytest

from beaver_ftc.studies.engine.study import Batches, Campaign
from beaver_ftc.studies.engine.workers import Batch, Case, Outcome


class Numbers:
    """Batches of flights, remembering what lands."""

    def __init__(self, flights: int, size: int) -> None:
        runs = [range(first, min(first + size, flights)) for first in range(0, flights, size)]
        coming = [Batch(n, tuple(Case(run, None) for run in batch)) for n, batch in enumerate(runs)]
        self.batches = Batches(iter(coming), flights, self.landed)
        self.landings: list[tuple[int, list[int]]] = []
        self.rows: list[dict] = []

    def landed(self, batch, rows):
        self.landings.append((batch.number, [row["run"] for row in rows]))
        self.rows += rows


class Unreliable:
    """Workers who lose a share of its tasks, and every one with a deadly flight in it."""

    def __init__(self, slots: int, loses: float = 0.0, deadly: frozenset[int] = frozenset()) -> None:
        self.slots, self._loses, self._deadly = slots, loses, deadly
        self._random = random.Random(4)
        self._tasks: list[Batch] = []
        self.submitted: list[Batch] = []

    def submit(self, task):
        assert len(self._tasks) < self.slots, "more tasks than it has hands"
        self._tasks.append(task)
        self.submitted.append(task)

    def outcomes(self, timeout_s):
        task = self._tasks.pop(self._random.randrange(len(self._tasks)))
        runs = [flight.run for flight in task.cases]
        if self._deadly.intersection(runs) or self._random.random() < self._loses:
            return [Outcome(task, None)]
        return [Outcome(task, [{"run": run, "status": "flown"} for run in runs])]

    def close(self):
        pass


def lost(case, why):
    return {"run": case.run, "status": "crashed", "reason": why}


def fly(source, workers):
    Campaign(source.batches, workers, lost).fly()
    return source


@pytest.mark.parametrize("slots", [1, 3, 40])
@pytest.mark.parametrize("size", [1, 7, 100])
def test_every_flight_lands_once_in_its_batch(slots, size):
    source = fly(Numbers(50, size), Unreliable(slots))
    assert sorted(source.landings) == [
        (n, list(range(first, min(first + size, 50)))) for n, first in enumerate(range(0, 50, size))
    ]


def test_lost_tasks_are_flown_again():
    source = fly(Numbers(200, 10), Unreliable(4, loses=0.2))
    assert sorted(row["run"] for row in source.rows) == list(range(200))
    assert sum(row["status"] == "crashed" for row in source.rows) <= 4  # 0.2^3 each, by chance


def test_the_flight_that_kills_its_process_is_found_and_only_it():
    workers = Unreliable(4, deadly=frozenset({13, 77}))
    source = fly(Numbers(100, 20), workers)
    crashed = [row for row in source.rows if row["status"] == "crashed"]
    assert sorted(row["run"] for row in crashed) == [13, 77]
    assert all("each time it is tried" in row["reason"] for row in crashed)
    assert sorted(row["run"] for row in source.rows) == list(range(100))


def test_stopping_lands_what_is_in_the_air_and_hands_out_no_more():
    source, workers = Numbers(100, 5), Unreliable(2)
    Campaign(source.batches, workers, lost).fly(stopped=lambda: len(workers.submitted) >= 4)
    assert len(workers.submitted) == 4
    assert not workers._tasks
    assert all(len(runs) == 5 for _, runs in source.landings)
