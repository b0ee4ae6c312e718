"""The engine without a second process: files, workers that end as they are told, a made Ray."""

import os
import sys
from functools import partial
from types import SimpleNamespace

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine import files, processes, ray_workers
from beaver_ftc.studies.engine.workers import Batch, Outcome, Work


def test_a_file_is_whole_or_as_it_was(tmp_path):
    file = tmp_path / "file"
    files.write_whole(file, b"old")

    def half(stream):
        stream.write(b"ne")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        files.replace_whole(file, half)
    assert (file.read_bytes(), os.listdir(tmp_path)) == (b"old", ["file"])
    files.replace_whole(file, lambda stream: stream.write(b"new"))
    assert file.read_bytes() == b"new"
    (tmp_path / "deep").mkdir()
    for name in (".x.partial", "deep/.y.partial", "z.partial"):
        (tmp_path / name).touch()
    files.remove_leftovers(tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["deep", "file", "z.partial"]
    assert os.listdir(tmp_path / "deep") == []


def double(case):
    return {"is": 2 * case}


CASES = (10, 11, 12)


class RayError(Exception):
    pass


class RayTaskError(RayError):
    def __init__(self, cause):
        super().__init__("of ray")
        self.cause = cause


class MadeRay:
    """Ray as far as it is used: tasks are done when they are waited for."""

    exceptions = SimpleNamespace(RayError=RayError, RayTaskError=RayTaskError)

    def __init__(self):
        self.calls, self.ends = [], []

    def is_initialized(self):
        return False

    def init(self, address, **options):
        self.calls.append(("init", address, options))

    def put(self, value):
        return value

    def remote(self, **options):
        return lambda function: SimpleNamespace(remote=lambda *given: partial(function, *given))

    def cluster_resources(self):
        return {"CPU": 3}

    def wait(self, references, num_returns, timeout):
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
    variables = ray.calls[0][2]["runtime_env"]["env_vars"]
    assert variables == {**processes.ONE_THREAD_EACH, ray_workers.VARIABLE: "somebody:Theirs"}
    tasks = [Batch(number, range(number), CASES[:number]) for number in (1, 2, 3)]
    for task in tasks:
        there.submit(task)
    assert there.outcomes(0.5) == [Outcome(tasks[0], [{"is": 20}])]
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
    assert ray_workers.fly_task(Work(double), same, CASES[:1]) == [{"is": 20}]
    with pytest.raises(
        SimulationFailed, match=r"a node of the cluster has numpy .* instead of 0: the table would mix"
    ):
        ray_workers.fly_task(Work(double), same | {"numpy": "0"}, CASES[:1])
