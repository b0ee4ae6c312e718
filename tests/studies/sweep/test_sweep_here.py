"""Sweeps flown in this very process: what they leave; what is drawn, to the number; rows of made flights."""

import io
import json
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.sweeps import Variation
from beaver_ftc.studies.engine.workers import ThisProcess
from beaver_ftc.studies.sweep import campaign, one_flight, store
from beaver_ftc.studies.sweep.campaign import Options, SweepStopped, assignment_of, replay, run_sweep
from beaver_ftc.studies.sweep.one_flight import Keep, as_cell, kind_of, row_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan, value_at
from beaver_ftc.studies.sweep.search import Evolution, members, score

from .conftest import SHORT, sweep_of

BRIEF = SHORT.replace("duration_s: 1", "duration_s: 0.6").replace('at_s": 0.5', 'at_s": 0.3')


@pytest.fixture
def hired(monkeypatch, small_batches):
    """How many workers were asked for; all of them are this process."""
    asked = []
    monkeypatch.setattr(
        campaign, "LocalWorkers", lambda work, n: asked.append((work, n)) or ThisProcess(work)
    )
    monkeypatch.setattr(campaign, "cores", lambda: 7)
    return asked


def test_a_sweep_and_the_worst_of_it(hired, tmp_path, changed, monkeypatch):
    tallies, left = [], []
    monkeypatch.setattr(
        one_flight, "keep_flight", lambda sweep, *given, report: left.append((*given, report))
    )
    options = Options(out=tmp_path, keep=Keep("worst"), source="brief.yaml", report=False)
    sweep = sweep_of(BRIEF, **{"48": "10"})
    plan, summary = Plan(sweep), run_sweep(sweep, options, lambda counts: tallies.append(dict(counts)))
    folder = tmp_path / "short"
    assert not changed({key: value for key, value in summary.items() if key not in ("versions", "worst")})
    worst = [{k: v for k, v in flight.items() if k != "replay"} for flight in summary["worst"]]
    assert not changed(worst, "worst")
    assert summary["worst"][0]["replay"].endswith(f"--replay {worst[0]['run']}")
    assert [n for _, n in hired] == [7]
    assert tallies[0] == {
        "total": 10,
        "done": 7,
        "failed": 0,
        "faulted": 7,
        "detected": tallies[0]["detected"],
    }
    assert tallies[-1]["done"] == 10
    runs = [flight["run"] for flight in worst]
    assert left == [
        (flight, Keep("worst", folder=folder / "flights"), True)
        for run in runs
        for flight in plan.assignments([run])
    ]
    assert json.loads((folder / "summary.json").read_text())["versions"] == summary["versions"]
    assert not (folder / "parts").exists()
    assert not (folder / "report.html").exists()
    table = pq.read_table(folder / "results.parquet").to_pylist()
    assert not changed({key: value for key, value in table[3].items() if value is not None}, "row")


def test_a_search_goes_on_from_generation_to_generation(hired, tmp_path, changed):
    sweep, options = sweep_of(BRIEF, **{"48": "20"}), Options(out=tmp_path, search="tracking", report=False)
    named = campaign.named_for(sweep, "tracking")
    assert assignment_of(named, options, 15).run == 15
    with pytest.raises(BadInput, match="flight 16 of short-search-tracking is not known yet"):
        assignment_of(named, options, 16)
    stops = iter([False, False, True, True, True, True])
    with pytest.raises(SweepStopped, match="short-search-tracking: stopped, 16 of 20 flights are kept"):
        run_sweep(sweep, options, stopped=lambda: len(list(tmp_path.glob("*/parts/*"))) > 0 and next(stops))
    summary = run_sweep(sweep, Options(out=tmp_path, search="tracking", report=False, resume=True))
    assert not changed(summary["search"])
    assert (summary["expectations"], summary["passed"]) == ([], True)
    table = pq.read_table(tmp_path / "short-search-tracking" / "results.parquet").to_pylist()
    assert table[17]["faults[0].magnitude"] == assignment_of(named, options, 17).values["faults[0].magnitude"]
    document = replay(sweep, options, 17)
    assert document["tracking"]["post_fault_rms_deg_s"]["q"] == table[17]["tracking.post_fault_rms_deg_s.q"]
    assert document["folder"].endswith("short-search-tracking/flights/short-search-tracking-0017")


def test_as_many_workers_as_are_asked_for_fly_and_warm_up_the_sweep(hired, monkeypatch):
    """On this machine one a core unless it is said; of a cluster it is the cluster that says."""
    flown = []
    monkeypatch.setattr(one_flight, "fly_one", lambda *given, keep: flown.append((*given, keep)))
    monkeypatch.setattr(one_flight, "warm_up", flown.append)
    sweep, keep = sweep_of(), Keep("failed")
    campaign._workers(sweep, Options(workers=3, keep=keep))
    ((work, number),) = hired
    assert number == 3
    work.fly("flight")
    work.warm_up()
    assert flown == [(sweep, "flight", keep), sweep]
    asked = []
    monkeypatch.setattr(
        "beaver_ftc.studies.engine.ray_workers.RayWorkers", lambda *given: asked.append(given[1:]) or "ray"
    )
    there = Options(workers=5, backend="ray", address="there:1")
    assert campaign._workers(sweep, there) == "ray"
    assert campaign._workers(sweep, Options(backend="ray")) == "ray"
    assert asked == [("there:1", 5), (None, None)]


@pytest.mark.parametrize(
    ("duration_s", "rate_hz", "substeps", "flights", "size"),
    [
        (30.0, 100.0, 1, 100, 17),
        (30.0, 100.0, 2, 100, 8),
        (600.0, 100.0, 1, 100, 1),
        (3600.0, 50.0, 1, 9, 1),
        (1.0, 100.0, 1, 100, 256),
        (1.0, 195.0, 1, 9, 256),
        (1.0, 196.0, 1, 9, 255),
        (30.0, 100.0, 1, 68_000, 17),
        (30.0, 100.0, 1, 68_001, 18),
    ],
)
def test_flights_a_batch(duration_s, rate_hz, substeps, flights, size):
    flown = SimpleNamespace(duration_s=duration_s, rate_hz=rate_hz, substeps=substeps)
    assert store.batch_size(SimpleNamespace(scenario=lambda values: flown, flights=flights)) == size


def test_tables_are_joined_into_groups_worth_reading(monkeypatch):
    import pyarrow as pa

    monkeypatch.setattr(store, "ROWS_PER_GROUP", 5)
    for sizes, groups in (((2, 2, 2, 1), (6, 1)), ((5, 1), (5, 1)), ((3, 2), (5,)), ((1,), (1,)), ((), ())):
        file, rows = io.BytesIO(), iter(range(100))
        tables = [pa.table({"run": [next(rows) for _ in range(size)]}) for size in sizes]
        store.write_tables(file, tables, pa.schema([("run", pa.int64())]))
        with pq.ParquetFile(io.BytesIO(file.getvalue())) as found:
            assert tuple(found.metadata.row_group(i).num_rows for i in range(found.num_row_groups)) == groups
            assert found.read().column("run").to_pylist() == list(range(sum(sizes)))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([], None),
        (["sweep.json"], None),
        ([".lock"], None),
        (["lock"], None),
        (["flights"], None),
        ([".x.partial", "sweep.json"], None),
        (["parts", "figures", "sweep.json", "report.html"], None),
        (["figures"], r"no sweep\.json, but other files"),
        (["report.html", "parts"], r"no sweep\.json, but other files"),
        (["sweep.json", "my.txt"], r"my\.txt, which is no part of a sweep"),
    ],
)
def test_whose_folder_it_is(names, said, tmp_path):
    for name in names:
        (tmp_path / name).touch()
    if said is None:
        store._refuse_foreign(tmp_path)
        return
    with pytest.raises(SimulationFailed, match=f"it holds {said}; move it away"):
        store._refuse_foreign(tmp_path)


def test_a_file_in_the_folders_place_is_left(tmp_path):
    (tmp_path / "short").touch()
    with pytest.raises(SimulationFailed, match="it exists and is not a folder"):
        store._refuse_foreign(tmp_path / "short")


@pytest.mark.parametrize("sampling", ["random", "lhs", "sobol", "grid"])
def test_what_is_drawn_is_what_it_was(sampling, changed):
    """A sweep that is resumed goes on with the same flights."""
    vary = "  duration_s: {linspace: [1, 2, 3]}\n  faults[0].at_s: {loguniform: [0.1, 0.9]}\n"
    if sampling == "grid":
        text = SHORT[: SHORT.index("vary")].replace("runs: 48\n", "sampling: grid\n") + (
            "vary:\n  duration_s: {linspace: [1, 2, 3]}\n  faults[0].actuator: {choice: [aileron, rudder]}\n"
        )
    else:
        text = SHORT.replace("runs: 48", f"runs: 12\nsampling: {sampling}") + vary
    sweep = sweep_of(text)
    plan = Plan(sweep)
    indices = [0, 1, 2, 5]
    assert not changed([list(flight.values.values()) for flight in plan.assignments(indices)])
    assert plan.assignments([2, 5]) == plan.assignments(indices)[2:]
    assert plan.assignments([]) == []


@pytest.mark.parametrize(
    ("how", "u", "value"),
    [
        ({"uniform": [2, 6]}, 0.25, 3.0),
        ({"loguniform": [1, 100]}, 0.75, 10**1.5),
        ({"loguniform": [1, 100]}, 1.0, 100.0),
        ({"normal": [5, 2]}, 0.5, 5.0),
        ({"normal": [5, 2]}, 0.8413447460685429, 7.0),
        ({"normal": [5, 2], "within": [5, 99]}, 0.6826894921370859, 7.0),
        ({"normal": [5, 2], "within": [4, 5]}, 0.0, 4.0),
        ({"choice": ["a", "b", "c"]}, 0.3333, "a"),
        ({"choice": ["a", "b", "c"]}, 0.3334, "b"),
        ({"choice": ["a", "b", "c"]}, 1.0, "c"),
        ({"linspace": [1, 2, 3]}, 0.5, 1.5),
        ({"linspace": [1, 2, 1]}, 0.5, 2),
        ({"linspace": [1, 2, 3]}, 0.9, 2),
    ],
)
def test_the_inverse_of_each_distribution(how, u, value):
    assert value_at(Variation(**how), u) == (value if isinstance(value, str) else pytest.approx(value))


def test_generations_of_a_search_are_what_they_were(changed):
    evolution = Evolution(3, 2)
    found = []
    for _ in range(4):
        trials = evolution.trials()
        assert trials.min() >= 0.0
        assert trials.max() < 1.0
        found.append(trials[[0, 7, 15]])
        evolution.select(-np.abs(trials - 0.9).sum(axis=1)[: 16 if evolution.generation < 3 else 5])
    assert not changed([*found, evolution._scores[:6]])
    assert [members(keys) for keys in (1, 4, 5, 16, 17)] == [16, 16, 20, 64, 64]


def test_a_trial_as_good_as_its_parent_takes_its_place():
    evolution = Evolution(3, 2)
    evolution.select(np.zeros(16))
    first, second = evolution._points.copy(), evolution.trials()
    evolution.select(np.array([0.0, -1.0, 1.0]))
    np.testing.assert_array_equal(evolution._points[[0, 1, 2, 3]], [second[0], first[1], second[2], first[3]])
    assert evolution._scores[:4].tolist() == [0.0, 0.0, 1.0, 0.0]
    assert evolution.generation == 2


@pytest.mark.parametrize(
    ("objective", "row", "value"),
    [
        ("delay", {"detection.delay_s": 0.5}, 0.5),
        ("delay", {}, 18.0),
        ("delay", {"false_alarm": True}, -np.inf),
        ("delay", {"fault.at_s": None}, -np.inf),
        ("delay", {"frames": None}, -np.inf),
        ("false_alarm", {}, 0.75),
        ("tracking", {}, 3.0),
        ("tracking", {"status": "departed"}, 1e6 - 30.0),
        ("tracking", {"tracking.post_fault_rms_deg_s.q": None}, -np.inf),
    ],
)
def test_what_is_the_worst(objective, row, value):
    whole = {
        "frames": 3000, "fault.at_s": 12.0, "detection.delay_s": None, "false_alarm": False, "flown_s": 30.0,
        "worst_residual_ratio": 0.75, "status": "flown",
    }  # fmt: skip
    whole |= {
        f"tracking.post_fault_rms_deg_s.{axis}": rms for axis, rms in (("p", 1.0), ("q", 3.0), ("r", 2.0))
    }
    assert score(objective, whole | row) == value


def test_the_row_of_a_made_flight(changed):
    """Each column from its place in the metrics, numbered so that none is like another."""
    numbers = iter(range(1, 1000))
    document = {}
    for name in one_flight.columns_of(load().surfaces):
        here, (*path, last) = document, name.split(".")
        for part in path:
            here = here.setdefault(part, {}) if isinstance(here.get(part, {}), dict) else {}
        here.setdefault(last, next(numbers))
    document |= {"seed": 77, "departure": {"signal": "beta_rad", "time_s": 12.25}}
    document["isolation"] |= {
        "estimate_interval": [-0.5, -0.3], "probing_s": [13.0, 14.5], "candidates": ["bias", "float"],
        "faults": [{"fault": "flap", "type": "bias"}, {"fault": "rudder", "type": None}, {"fault": None}],
        "withdrawn": [{"fault": "elevator"}, {"fault": "aileron"}],
    }  # fmt: skip
    modes = [("nominal", 0.0), ("adaptive", 12.1), ("reallocated", 12.5), ("adaptive", 13.0)]
    document["supervisor"] = [{"mode": mode, "time_s": at_s} for mode, at_s in modes]
    document |= {"envelope": {"exits": 3, "outside_s": 1.5}, "envelope_exits": []}
    document["expectations"] = [{"name": n, "passed": n == "b"} for n in "abc"]
    document["windows"] = [{"detected": True, "correct": None}, {"detected": True, "correct": True}]
    flight = SimpleNamespace(
        frames=250, worst_residual_ratio=0.875,
        scenario=SimpleNamespace(rate_hz=50.0, airframe=SimpleNamespace(surfaces=load().surfaces)),
    )  # fmt: skip
    assert not changed(row_of(Assignment(5, {"a": 1.5}), Metrics.of(document), flight))
    document |= {"departure": None, "supervisor": modes and [{"mode": "nominal", "time_s": 0.0}]}
    document["isolation"] |= {"estimate_interval": None, "probing_s": None, "candidates": [], "faults": []}
    plain = row_of(Assignment(5, {}), Metrics.of(document), flight)
    assert (plain["status"], plain["reason"], plain["isolation.faults"]) == ("flown", None, "")
    assert plain["supervisor.adaptive_at_s"] is plain["isolation.probing_s.from"] is None


@pytest.mark.parametrize(
    ("choice", "kind", "cells"),
    [
        ([True, False], "flag", [True, False]),
        ([1, 2.5], "float", [1.0, 2.5]),
        ([True, 1], "text", ["true", "1"]),
        (["a", {"b": 1}], "text", ["a", '{"b": 1}']),
    ],
)
def test_how_a_choice_stands_in_its_column(choice, kind, cells):
    assert kind_of(Variation(choice=choice)) == kind
    assert [as_cell(value, kind) for value in choice] == cells
    assert kind_of(Variation(uniform=[0, 1])) == "float"


def test_two_frames_of_the_base_without_its_faults_warm_a_worker_up(short, monkeypatch):
    flown = []
    monkeypatch.setattr("beaver_ftc.loop.loop.fly", flown.append)
    one_flight.warm_up(short)
    assert (flown[0].duration_s, flown[0].faults) == (0.02, ())


def test_of_a_flight_that_fails_the_scenario_is_kept(short, tmp_path, monkeypatch):
    (flight,) = Plan(short).assignments([7])
    given = []

    def fail(scenario, folder, report, certified):
        given.append((scenario.name, report))
        raise RuntimeError

    monkeypatch.setattr("beaver_ftc.results.writer.run", fail)
    one_flight.keep_flight(short, flight, Keep(folder=tmp_path))
    assert [path.name for path in (tmp_path / "short-0007").iterdir()] == ["scenario.yaml"]
    assert given == [("short-0007", False)]
    one_flight.keep_flight(short, Assignment(3, {"faults[0].at_s": 2.0}), Keep(folder=tmp_path))
    assert len(given) == 1
    assert one_flight.flight_name(SimpleNamespace(name="x", flights=10_001), 3) == "x-00003"
    assert one_flight.flight_name(SimpleNamespace(name="x", flights=10_000), 3) == "x-0003"


@pytest.mark.parametrize(
    ("policy", "changes", "wanted"),
    [
        ("missed", {"fault.type": None, "detection.detected": False, "isolation.correct": None}, False),
        ("missed", {"status": "departed"}, True),
        ("failed", {"passed": None}, False),
        ("worst", {"passed": False}, False),
        ("none", {"run": 4}, True),
    ],
)
def test_which_flights_are_kept(policy, changes, wanted):
    row = {"run": 1, "status": "flown", "passed": True, "fault.type": "bias", "detection.detected": True,
           "isolation.correct": True}  # fmt: skip
    assert Keep(policy, frozenset({4})).wants(row | changes) is wanted
