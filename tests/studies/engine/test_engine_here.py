"""The engine without a second process: files, identities, workers that end as they are told, a made Ray."""

import io
import json
import os
import sys
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.studies.engine import ray_workers, store, study, workers
from beaver_ftc.studies.engine.statistics import (
    poisson,
    poisson_bound,
    quantile,
    quantile_bound,
    wilson_bound,
)
from beaver_ftc.studies.engine.store import Parts, RowsAsJson, batches_of, digest, refuse_other
from beaver_ftc.studies.engine.study import Batches, Campaign
from beaver_ftc.studies.engine.workers import Batch, Case, LocalWorkers, Outcome, ThisProcess, Work


@pytest.mark.parametrize(
    ("count", "size", "expected"), [(0, 3, []), (3, 3, [(0, 3)]), (4, 3, [(0, 3), (3, 4)]), (2, 5, [(0, 2)])]
)
def test_batches_of_so_many(count, size, expected):
    assert list(batches_of(count, size)) == [(n, range(*ends)) for n, ends in enumerate(expected)]


def test_parts_are_files_of_their_batch(tmp_path):
    parts = Parts(tmp_path / "parts", RowsAsJson(dict))
    assert not parts
    parts.folder.mkdir()
    assert not parts
    parts.land(7, [{"a": np.float64(1.5), "b": np.int64(2)}])
    parts.land("healthy-3", [{"a": 1}, {"a": float("inf")}])
    assert bool(parts)
    assert sorted(path.name for path in parts.folder.iterdir()) == ["000007.json", "healthy-3.json"]
    assert parts.landed(7, [0]) == [{"a": 1.5, "b": 2}]
    assert parts.landed("healthy-3", [0, 1])[1] == {"a": float("inf")}
    assert parts.landed(7, [0, 1]) is None  # not so many: set aside
    assert parts.landed(7, [0]) is None
    (parts.folder / "mine.txt").touch()
    parts.remove()
    assert {path.name for path in parts.folder.iterdir()} == {"mine.txt", "000007.json.damaged"}


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


def test_a_digest_is_of_names_and_contents(tmp_path):
    for name, content in (("a", "x"), ("b", "x"), ("c", "y")):
        (tmp_path / name).write_text(content)
    one, two, three = (digest([tmp_path / name]) for name in "abc")
    assert len({one, two, three, digest([tmp_path / "a", tmp_path / "b"])}) == 4
    assert digest([tmp_path / "a"]) == one
    assert (len(one), len(store.fingerprint())) == (64, 16)


def test_what_flights_follow_from(monkeypatch, tmp_path):
    packages = ("numpy", "no-such-package", "beaver-ftc", "")
    entries = {f"of {package}": SimpleNamespace(package=package) for package in packages}
    monkeypatch.setattr("beaver_ftc.plugins.registered", lambda group: entries)
    assert store.plug_ins() == {"no-such-package": "unknown", "numpy": np.__version__}
    mine = store.identity("sweep", {"runs": (1, 2), "seed": 3})
    assert mine["sweep"] == {"runs": [1, 2], "seed": 3}
    assert {"jsbsim", "numpy", "no-such-package", "flight code"} <= set(mine["versions"])
    refuse_other(mine, json.loads(json.dumps(mine)), tmp_path)
    with pytest.raises(
        BadInput,
        match=r"the sweep file has changed since these flights \(seed\): resuming would mix two sweeps",
    ):
        refuse_other(mine, mine | {"sweep": {"runs": [1, 2]}}, tmp_path)
    with pytest.raises(BadInput, match=r"flown by other versions \(numpy 1 then, .* now\)"):
        refuse_other(mine, mine | {"versions": mine["versions"] | {"numpy": "1"}}, tmp_path)


def test_only_what_makes_rows_is_hashed():
    rooms = {
        path.relative_to(store.PACKAGE).parts[0]
        for path in store.hashed_files()
        if path.is_relative_to(store.PACKAGE)
    }
    assert {"diagnosis", "studies", "loop"} <= rooms
    assert not rooms & {"cli", "live"}
    assert {path.suffix for path in store.hashed_files()} >= {".py", ".json", ".yaml", ".xml"}


def double(case):
    return {"run": case.run, "is": 2 * case.what}


CASES = tuple(Case(run, 10 + run) for run in range(3))


def test_this_process_is_one_worker():
    here = ThisProcess(Work(double))
    for number in (1, 2):
        here.submit(Batch(number, CASES[:number]))
    assert here.slots == 1
    assert here.outcomes(0.0) == [Outcome(Batch(1, CASES[:1]), [{"run": 0, "is": 20}])]
    here.close()
    with pytest.raises(IndexError):
        here.outcomes(0.0)


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


def test_local_workers_hand_back_rows_and_what_was_lost(hired):
    local = LocalWorkers(Work(double), 2)
    assert (local.slots, len(hired.all)) == (2, 2)
    hired.errors[:] = [None, BrokenProcessPool()]
    for number in (1, 2):
        local.submit(Batch(number, CASES[:number]))
    found = {outcome.task.number: outcome.rows for outcome in local.outcomes(1.0)}
    assert found == {1: [{"run": 0, "is": 20}], 2: None}
    assert len(hired.all) == 3  # the one that died is replaced
    hired.errors[:] = [KeyError()]  # it had died while idle
    local.submit(Batch(3, CASES))
    assert local.outcomes(1.0) == [Outcome(Batch(3, CASES), None)]
    local.submit(Batch(4, CASES))
    local.close()
    assert sum(worker.ended for worker in hired.all) == 2
    assert local.outcomes(0.0)[0].rows == [double(case) for case in CASES]


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


@pytest.mark.parametrize(("asked", "cases", "given"), [(1, 5, None), (2, 5, 2), (8, 3, 3), (8, 0, None)])
def test_no_more_workers_than_cases(hired, monkeypatch, asked, cases, given):
    landed, seen = [], []
    monkeypatch.setattr(study, "LocalWorkers", lambda work, n: seen.append(n) or ThisProcess(work))
    batches = [Batch(run, (Case(run, run),)) for run in range(cases)]
    study.conduct(
        Batches(iter(batches), cases, lambda batch, rows: landed.append(rows)), Work(double), asked, None
    )
    assert seen == ([] if given is None else [given])
    assert landed == [[{"run": run, "is": 2 * run}] for run in range(cases)]


def test_tasks_get_smaller_towards_the_end():
    """64 cases of two workers, four tasks each: eights of the first batch, fours of the second."""
    sizes = []

    class Two(ThisProcess):
        slots = 2

        def submit(self, task):
            sizes.append(len(task.cases))
            super().submit(task)

    two = [Batch(n, tuple(Case(run, run) for run in range(32 * n, 32 * n + 32))) for n in (0, 1)]
    Campaign(Batches(iter(two), 64, lambda batch, rows: None), Two(Work(double)), None).fly()
    assert sizes == [8] * 4 + [4] * 8


def test_the_environment_is_as_it_was_afterwards(monkeypatch):
    monkeypatch.setenv("K_THERE", "before")
    monkeypatch.delenv("K_NEW", raising=False)
    with workers.environment({"K_THERE": "meanwhile", "K_NEW": "1"}):
        assert (os.environ["K_THERE"], os.environ["K_NEW"]) == ("meanwhile", "1")
    assert os.environ["K_THERE"] == "before"
    assert "K_NEW" not in os.environ
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    with workers.single_threaded():
        assert {os.environ[name] for name in workers.ONE_THREAD_EACH} == {"1"}
    assert os.environ["OMP_NUM_THREADS"] == "3"
    assert workers.cores() == len(os.sched_getaffinity(0))


def test_silence_is_on_both_streams_and_ends(capfd):
    for stream in (1, 2):
        os.write(stream, b"before ")
    with workers.silence():
        for stream in (1, 2):
            os.write(stream, b"lost ")
    for stream in (1, 2):
        os.write(stream, b"after")
    assert tuple(capfd.readouterr()) == ("before after", "before after")


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


@pytest.mark.parametrize(
    ("cpus", "asked", "slots"), [(0, None, 2), (0.5, None, 2), (8.0, None, 16), (8, 5, 5)]
)
def test_how_many_tasks_a_cluster_holds(ray, cpus, asked, slots):
    ray.cpus = cpus
    assert ray_workers.RayWorkers(Work(double), None, asked).slots == slots


def test_what_ray_prints_of_workers_that_die_is_no_part_of_the_output(ray, capsys):
    there = ray_workers.RayWorkers(Work(double), None, None)
    there.submit(Batch(1, CASES[:1]))
    print("(raylet) a worker died")
    there.submit(Batch(2, CASES[:1]))
    there.close()
    print("results")
    assert capsys.readouterr() == ("results\n", "(raylet) a worker died\n")


def test_a_cluster_that_was_there_goes_on(ray):
    ray.running = True
    ray_workers.RayWorkers(Work(double), None, 2).close()
    assert [call[0] for call in ray.calls] == ["remote"]


def test_a_cluster_at_an_address_and_one_that_refuses(ray, monkeypatch):
    ray_workers.RayWorkers(Work(double), "there:1", 2)
    assert ray.calls[0][1] == "there:1"
    assert "include_dashboard" not in ray.calls[0][2]
    ray.refuses = ConnectionError("nobody\nthere")
    with pytest.raises(BadInput, match=r"--ray-address: cannot join a Ray cluster \(nobody\)"):
        ray_workers.RayWorkers(Work(double), "there:1", 2)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(BadInput, match=r"Ray is not installed, allowed: pip install 'beaver-ftc\[ray\]'"):
        ray_workers.RayWorkers(Work(double), None, 2)


def test_a_node_with_other_versions_does_not_fly():
    same = dict(ray_workers.versions())
    assert ray_workers.fly_task(Work(double), same, CASES[:1]) == [{"run": 0, "is": 20}]
    with pytest.raises(
        SimulationFailed, match=r"a node of the cluster has numpy .* instead of 0: the table would mix"
    ):
        ray_workers.fly_task(Work(double), same | {"numpy": "0"}, CASES[:1])


def test_bounds_at_their_ends():
    assert (poisson(3, 0.0).low, poisson(3, 0.0).high) == (0.0, np.inf)
    assert np.isnan(poisson(3, 0.0).value)
    assert [poisson_bound(1, 0.0, 0.9, upper) for upper in (False, True)] == [0.0, np.inf]
    assert poisson_bound(0, 2.0, 0.9, upper=False) == 0.0
    assert poisson_bound(1, 2.0, 0.9, upper=False) == pytest.approx(-np.log(0.9) / 2.0)
    assert wilson_bound(0, 10, 0.9, upper=False) == 0.0
    assert wilson_bound(3, 10, 0.9, upper=False) < 0.3 < wilson_bound(3, 10, 0.9, upper=True)
    values = np.arange(1.0, 11.0)
    assert [quantile(values, q) for q in (0.0, 0.1, 0.11, 0.3, 0.5, 0.95, 1.0)] == [1, 1, 2, 3, 5, 10, 10]
    assert np.isnan(quantile(np.empty(0), 0.5))
    # P(Binomial(10, 0.5) <= 2) = 56 / 1024, <= 1: 11 / 1024; <= 7: 968 / 1024
    assert quantile_bound(values, 0.5, 968 / 1024 - 1e-9, upper=True) == 8.0
    assert quantile_bound(values, 0.5, 968 / 1024 + 1e-9, upper=True) == 9.0
    assert quantile_bound(values, 0.5, 1 - 56 / 1024 - 1e-9, upper=False) == 3.0
    assert quantile_bound(values, 0.5, 1 - 56 / 1024 + 1e-9, upper=False) == 2.0
    assert [quantile_bound(np.empty(0), 0.5, 0.9, upper) for upper in (False, True)] == [-np.inf, np.inf]


def test_rows_are_read_as_they_were_written():
    codec, file = RowsAsJson(dict), io.BytesIO()
    codec.write([{"a": np.bool_(True), "b": None}], file)
    assert json.loads(file.getvalue()) == [{"a": True, "b": None}]
