"""A study's cases kept as they land: whatever is killed, the rows are those of an undisturbed study."""

import os
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path

import pytest

from beaver_ftc.documents.errors import SimulationFailed, say_once
from beaver_ftc.studies.engine.files import locked
from beaver_ftc.studies.engine.identity import PACKAGE, hashed_files
from beaver_ftc.studies.engine.study import Study, flown, fly_all, run_study


@dataclass
class Row:
    case: int
    delay_s: float
    pairs: tuple[tuple[float, str], ...] = ()


def square(case: int, log: Path | None = None) -> Row:
    """A flight of which the log remembers that it was flown."""
    if log:
        with log.open("a") as file:
            file.write(f"{case}\n")
    return Row(case, inf if case == 3 else case**2 / 7, ((case / 3, "p"),))


def kills_itself(case: int, marks: Path, always: int = -1) -> Row:
    """Case 2 kills its process the first time, `always` each time."""
    mark = marks / str(case)
    if case == always or (case == 2 and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(case)


def rows_of(folder, cases, fly, workers=1, progress=None, **options):
    with flown(study_of(folder, cases, fly, **options), folder.parent, workers, progress) as rows:
        return list(rows)


def study_of(folder, cases, fly, **options):
    return Study(folder.name, cases, fly, list, {}, Row, **options)


def hidden(folder):
    return [path.name for path in folder.iterdir()] if folder.exists() else []


def test_rows_come_in_order_and_nothing_is_left(tmp_path):
    seen = []
    assert rows_of(tmp_path / "study", range(6), square, progress=seen.append) == list(map(square, range(6)))
    assert seen == [pytest.approx((i + 1) / 6) for i in range(6)]
    assert hidden(tmp_path) == []


def test_a_study_leaves_its_files_and_gives_its_document(tmp_path):
    study = Study(
        "squares", range(3), square, lambda rows: {"sum": sum(row.delay_s for row in rows)},
        {"sum.txt": lambda document: f"{document['sum']:.4f}"}, Row,
    )  # fmt: skip
    assert run_study(study, tmp_path) == {"sum": pytest.approx(5 / 7)}
    assert hidden(tmp_path) == ["squares"]
    assert (tmp_path / "squares" / "sum.txt").read_text() == "0.7143"


def test_several_workers_give_the_same(tmp_path):
    assert rows_of(tmp_path / "study", range(6), square, workers=2) == list(map(square, range(6)))
    assert fly_all(abs, [-3, 2, -1], 2) == [3, 2, 1]


def test_a_worker_that_dies_costs_nothing(tmp_path):
    fly = partial(kills_itself, marks=tmp_path)
    assert rows_of(tmp_path / "study", range(6), fly, workers=2) == list(map(square, range(6)))
    assert (tmp_path / "2").exists()


def test_a_case_that_kills_every_process_is_said_and_the_rest_is_kept(tmp_path):
    fly = partial(kills_itself, marks=tmp_path, always=5)
    with pytest.raises(SimulationFailed, match=r"5: the process that flies it ends.*goes on"):
        rows_of(tmp_path / "study", range(6), fly, workers=2)
    assert len(list((tmp_path / ".study.flown" / "parts").iterdir())) == 5
    lost = rows_of(tmp_path / "study", range(6), fly, workers=2, lost=lambda case, why: Row(case, -1.0))
    assert [row.delay_s for row in lost] == [*(square(i).delay_s for i in range(5)), -1.0]


def stopped_after(count):
    def progress(share):
        if share * 6 > count - 0.5:
            raise KeyboardInterrupt

    return progress


def test_what_was_stopped_goes_on_and_only_what_is_missing_is_flown(tmp_path, capsys):
    log = tmp_path / "log"
    fly = partial(square, log=log)
    say_once.cache_clear()
    with pytest.raises(KeyboardInterrupt):
        rows_of(tmp_path / "study", range(6), fly, progress=stopped_after(4))
    assert capsys.readouterr().err == (
        "beaver-ftc: study: stopped; what has been flown is kept, the same command goes on with it\n"
    )
    log.unlink()
    assert rows_of(tmp_path / "study", range(6), fly) == list(map(square, range(6)))
    assert log.read_text().split() == ["4", "5"]


@pytest.mark.parametrize("change", ["cases", "asked", "code"])
def test_rows_of_another_question_or_other_code_are_not_used(tmp_path, monkeypatch, change):
    log = tmp_path / "log"
    fly = partial(square, log=log)
    with pytest.raises(KeyboardInterrupt):
        rows_of(tmp_path / "study", range(6), fly, follows_from=1, progress=stopped_after(4))
    log.unlink()
    if change == "code":
        monkeypatch.setattr("beaver_ftc.studies.engine.identity.fingerprint", lambda: "edited")
    cases = range(1, 7) if change == "cases" else range(6)
    rows_of(tmp_path / "study", cases, fly, follows_from=2 if change == "asked" else 1)
    assert log.read_text().split() == [str(case) for case in cases]


@pytest.mark.parametrize("content", ['[{"case"', "[]", '[{"case": 2, "delay_s": "soon"}]', "null"])
def test_a_part_that_is_damaged_is_flown_again(tmp_path, content):
    with pytest.raises(KeyboardInterrupt):
        rows_of(tmp_path / "study", range(6), square, progress=stopped_after(4))
    (tmp_path / ".study.flown" / "parts" / "000000-000002.json").write_text(content)
    assert rows_of(tmp_path / "study", range(6), square) == list(map(square, range(6)))


def test_a_failure_before_the_first_row_leaves_nothing(tmp_path):
    def fail(case):
        raise SimulationFailed("at once")

    for out in (tmp_path / "out", tmp_path / "there"):  # which was there before, and empty, stays
        (tmp_path / "there").mkdir(exist_ok=True)
        with pytest.raises(SimulationFailed, match="at once"):
            rows_of(out / "study", range(3), fail)
        assert hidden(tmp_path) == ["there"]
    assert hidden(tmp_path / "there") == []


def test_the_lock_holds_until_the_rows_are_removed(tmp_path, monkeypatch):
    remove = shutil.rmtree

    def removed(folder, **options):
        remove(folder, **options)
        (tmp_path / ".study.flown").mkdir(exist_ok=True)
        with pytest.raises(SimulationFailed, match="another beaver-ftc"), locked(tmp_path / ".study.flown"):
            pass

    monkeypatch.setattr(shutil, "rmtree", removed)
    rows_of(tmp_path / "study", range(2), square)
    assert hidden(tmp_path) == []


ALL_IMPORTED = """
import sys
from pathlib import Path
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.sweep.one_flight import fly_one, scenario_of
from beaver_ftc.studies.sweep.sampling import Plan
from beaver_ftc.studies.sweep.one_flight import schema_of, table_of
sweep = load_sweep("{sweep}")
plan = Plan(sweep).assignments([0])
rows = [fly_one(sweep, plan[0])]
table_of(sweep, schema_of(sweep), rows)
for name, module in list(sys.modules.items()):
    if name.startswith("beaver_ftc") and getattr(module, "__file__", None):
        print(module.__file__)
"""


def test_every_module_that_makes_rows_is_in_the_fingerprint(tmp_path):
    """What a fresh process imports to fly and tabulate a flight, a rival's included, is hashed."""
    sweep = tmp_path / "one.yaml"
    sweep.write_text(
        "base: {name: one, duration_s: 1, fdi: {scheme: augmented-ekf}, control: {law: lqr}}\n"
        "runs: 2\nsampling: sobol\nvary: {initial.airspeed_mps: {uniform: [44, 46]}}\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", ALL_IMPORTED.format(sweep=sweep)], capture_output=True, text=True, check=True
    )
    imported = {Path(line).resolve() for line in done.stdout.splitlines()}
    assert {"sampling.py", "metrics.py", "kalman.py", "one_flight.py"} <= {path.name for path in imported}
    hashed = set(hashed_files())
    assert imported <= hashed
    assert {path.name for path in hashed} >= {"beaver.xml", "tuned.json"}
    assert not [path for path in hashed if path.is_relative_to(PACKAGE / "cli")]
