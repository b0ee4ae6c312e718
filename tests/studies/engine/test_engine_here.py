"""The engine without a second process: files, workers that end as they are told, a made Ray."""

import os
import sys
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from types import SimpleNamespace

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine import ray_workers, store, workers
from beaver_ftc.studies.engine.workers import Batch, Case, LocalWorkers, Outcome, Work


def test_a_file_is_whole_or_as_it_was(tmp_path):
    file = tmp_path / "file"
    store.write_whole(file, b"old")

    def half(stream):
        stream.write(b"ne")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.replace_whole(file, half)
    assert (file.read_bytes(), os.listdir(tmp_path)) == (b"old", ["file"])
    store.replace_whole(file, lambda stream: stream.write(b"new"))
    assert file.read_bytes() == b"new"
    (tmp_path / "deep").mkdir()
    for name in (".x.partial", "deep/.y.partial", "z.partial"):
        (tmp_path / name).touch()
    store.remove_leftovers(tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["deep", "file", "z.partial"]
    assert os.listdir(tmp_path / "deep") == []


def double(case):
    return {"run": case.run, "is": 2 * case.what}


CASES = tuple(Case(run, 10 + run) for run in range(3))


class Hired:
    """A worker whose flights end as it is told: with rows, or with an error."""

    all, errors, stillborn = (), (), 0
    has_begun = workers._Worker.has_begun

    def __init__(self, work):
        self.work, self.ended, self.pid = work, False, Future()
        self.pid.set_result(1)
        Hired.all.append(self)

    def fly(self, task):
        flying, error = Future(), self.errors.pop(0) if self.errors else None
        if isinstance(error, KeyError):
            raise BrokenProcessPool
        if error:
            flying.set_exception(error)
        else:
            flying.set_result(self.work.all(task.cases))
        return flying

    def end(self):
        self.ended = True


@pytest.fixture
def hired(monkeypatch):
    monkeypatch.setattr(Hired, "all", [])
    monkeypatch.setattr(Hired, "errors", [])
    monkeypatch.setattr(workers, "_Worker", Hired)
    return Hired


def test_a_failure_that_is_no_flights_ends_the_study(hired):
    local = LocalWorkers(Work(double), 1)
    hired.errors[:] = [ValueError("x")]
    local.submit(Batch(1, CASES))
    with pytest.raises(SimulationFailed, match="cannot go on: x"):
        local.outcomes(1.0)
    assert len(local._idle) == 1


def test_a_worker_killed_before_its_first_flight_is_replaced_but_not_for_ever(hired):
    """Eight in a row give up; one that had begun, and dies, begins the count anew. Only that one has lost its
    task: what a worker has never come to fly goes to the next."""
    local = LocalWorkers(Work(double), 1)

    def dies(has_begun):
        local._idle[0].pid = Future()
        if has_begun:
            local._idle[0].pid.set_result(1)
        hired.errors[:] = [BrokenProcessPool()]
        local.submit(Batch(1, CASES))
        return local.outcomes(1.0)

    for has_begun in (*[False] * 7, True, *[False] * 7):
        assert dies(has_begun) == ([Outcome(Batch(1, CASES), None)] if has_begun else [])
        if not has_begun:
            assert local.outcomes(1.0)[0].rows == [double(case) for case in CASES]
    says = "a worker process cannot start: 8 in a row ended before their first flight"
    with pytest.raises(SimulationFailed, match=says):
        dies(has_begun=False)
    assert len(local._idle) == 1


class RayError(Exception):
    pass


class RayTaskError(RayError):
    def __init__(self, cause):
        super().__init__("of ray")
        self.cause = cause


class MadeRay:
    """Ray as far as it is used: tasks are done when they are waited for."""

    exceptions = SimpleNamespace(RayError=RayError, RayTaskError=RayTaskError)

    def __init__(self, cpus=3, running=False, refuses=None):
        self.cpus, self.running, self.refuses = cpus, running, refuses
        self.calls, self.ends = [], []

    def is_initialized(self):
        return self.running

    def init(self, address, **options):
        self.calls.append(("init", address, options))
        if self.refuses:
            raise self.refuses

    def put(self, value):
        return value

    def remote(self, **options):
        self.calls.append(("remote", options))
        return lambda function: SimpleNamespace(remote=lambda *given: partial(function, *given))

    def cluster_resources(self):
        return {"CPU": self.cpus} if self.cpus else {}

    def wait(self, references, num_returns, timeout):
        self.calls.append(("wait", num_returns, timeout))
        return references[:num_returns], references[num_returns:]

    def get(self, reference):
        if self.ends:
            raise self.ends.pop(0)
        return reference()

    def cancel(self, reference, force):
        self.calls.append(("cancel", force))

    def shutdown(self):
        self.calls.append(("shutdown",))


@pytest.fixture
def ray(monkeypatch):
    made = MadeRay()
    monkeypatch.setitem(sys.modules, "ray", made)
    monkeypatch.setenv(ray_workers.VARIABLE, "somebody:Theirs")
    return made


def test_tasks_of_a_cluster(ray):
    there = ray_workers.RayWorkers(Work(double), None, None)
    (_, address, options), remote = ray.calls
    assert (address, options["log_to_driver"], options["include_dashboard"]) == (None, False, False)
    variables = options["runtime_env"]["env_vars"]
    assert variables == {**workers.ONE_THREAD_EACH, ray_workers.VARIABLE: "somebody:Theirs"}
    assert remote == ("remote", {"num_cpus": 1, "max_retries": 0})
    assert there.slots == 6
    tasks = [Batch(number, CASES[:number]) for number in (1, 2, 3)]
    for task in tasks:
        there.submit(task)
    assert there.outcomes(0.5) == [Outcome(tasks[0], [{"run": 0, "is": 20}])]
    assert ray.calls[-1] == ("wait", 1, 0.5)
    ray.ends[:] = [RayError()]
    assert there.outcomes(0.5) == [Outcome(tasks[1], None)]
    ray.ends[:] = [RayTaskError(ValueError("theirs"))]
    with pytest.raises(SimulationFailed, match="a worker cannot go on: theirs"):
        there.outcomes(0.5)
    there.submit(tasks[0])
    there.close()
    assert ray.calls[-2:] == [("cancel", True), ("shutdown",)]


def test_a_node_with_other_versions_does_not_fly():
    same = dict(ray_workers.versions())
    assert ray_workers.fly_task(Work(double), same, CASES[:1]) == [{"run": 0, "is": 20}]
    with pytest.raises(
        SimulationFailed, match=r"a node of the cluster has numpy .* instead of 0: the table would mix"
    ):
        ray_workers.fly_task(Work(double), same | {"numpy": "0"}, CASES[:1])
