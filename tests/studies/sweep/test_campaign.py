"""Sweeps that really fly, short ones: the same table whatever happens on the way."""

import json
import os
import random
import signal
import time

import pyarrow.parquet as pq
import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine import workers
from beaver_ftc.studies.sweep.campaign import Options, SweepStopped, replay, run_sweep
from beaver_ftc.studies.sweep.one_flight import Keep
from beaver_ftc.studies.sweep.pictures import FIGURES

from .conftest import SHORT, parts_in, sweep_of


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The uninterrupted sweep, one worker, everything drawn: its folder and its summary."""
    out = tmp_path_factory.mktemp("reference")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beaver_ftc.studies.sweep.campaign.FRAMES_A_BATCH", 400)
        summary = run_sweep(sweep_of(), Options(out=out, workers=1, source="short.yaml"))
    return out / "short", summary


def table_of(folder):
    return (folder / "results.parquet").read_bytes()


def test_the_folder_holds_what_it_should(reference):
    folder, summary = reference
    table = pq.read_table(folder / "results.parquet")
    assert table.column_names[:4] == ["run", *sweep_of().keys]
    assert table.column("run").to_pylist() == list(range(48))
    assert json.loads((folder / "summary.json").read_text()) == summary
    assert {path.name for path in folder.iterdir()} == {
        "sweep.json", "results.parquet", "summary.json", "report.html", "figures",
    }  # fmt: skip
    assert {path.stem for path in (folder / "figures").iterdir()} == {*FIGURES} - {"search"}


def test_the_worker_count_does_not_show(reference, tmp_path, small_batches):
    run_sweep(sweep_of(), Options(out=tmp_path, workers=3, report=False))
    assert table_of(tmp_path / "short") == table_of(reference[0])


def test_only_what_is_missing_is_flown(reference, tmp_path, small_batches):
    seen = []
    with pytest.raises(SweepStopped, match=r"of 48 flights are kept; .*--resume") as caught:
        run_sweep(
            sweep_of(), Options(out=tmp_path, workers=1), lambda t: seen.append(t["done"]), lambda: bool(seen)
        )
    assert caught.value.exit_code == 130
    kept = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "short" / "parts").iterdir()}
    assert 0 < len(kept) < 12
    tallies = []
    run_sweep(
        sweep_of(),
        Options(out=tmp_path, workers=2, resume=True, report=False),
        lambda t: tallies.append(t["done"]),
    )
    assert tallies[len(kept) - 1] == 4 * len(kept)  # counted without flying
    assert table_of(tmp_path / "short") == table_of(reference[0])


def test_killed_at_random_moments_it_ends_in_the_same_table(reference, tmp_path, start):
    (tmp_path / "short.yaml").write_text(SHORT)
    moments = random.Random(7)
    folder = tmp_path / "runs" / "short"
    for _ in range(4):
        process = start("short.yaml", "--workers", "2", "--resume", "--no-report")
        before, patience = parts_in(folder), time.monotonic() + 60
        while process.poll() is None and parts_in(folder) <= before and time.monotonic() < patience:
            time.sleep(0.005)
        time.sleep(0.1 * moments.random())
        process.kill()
        process.communicate()
    process = start("short.yaml", "--workers", "2", "--resume", "--format", "json", "--no-report")
    answer, complaints = process.communicate(timeout=120)
    assert process.returncode == 0, complaints
    assert json.loads(answer)["flights"] == 48
    assert table_of(folder) == table_of(reference[0])


def test_ctrl_c_ends_it_cleanly_and_says_how_to_go_on(reference, tmp_path, start):
    (tmp_path / "short.yaml").write_text(SHORT)
    folder = tmp_path / "runs" / "short"
    process = start("short.yaml", "--workers", "1")
    patience = time.monotonic() + 60
    while process.poll() is None and not parts_in(folder) and time.monotonic() < patience:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    answer, complaints = process.communicate(timeout=60)
    assert process.returncode == 130
    assert answer == ""
    assert "--resume" in complaints
    assert "Traceback" not in complaints
    process = start("short.yaml", "--resume", "--no-report")
    process.communicate(timeout=120)
    assert table_of(folder) == table_of(reference[0])


def test_a_worker_that_is_killed_is_replaced(reference, tmp_path, small_batches, monkeypatch):
    hired = []

    class Watched(workers._Worker):
        def __init__(self, work):
            super().__init__(work)
            hired.append(self)

    monkeypatch.setattr(workers, "_Worker", Watched)
    seen = []

    def kill_the_first(tally):
        if not seen:
            os.kill(hired[0].pid.result(), signal.SIGKILL)
        seen.append(tally["done"])

    run_sweep(sweep_of(), Options(out=tmp_path, workers=2, report=False), kill_the_first)
    assert len(hired) == 3
    assert table_of(tmp_path / "short") == table_of(reference[0])


def test_a_replayed_flight_is_the_flight_in_the_table(reference, tmp_path):
    document = replay(sweep_of(), Options(out=tmp_path, report=False), 11)
    row = pq.read_table(reference[0] / "results.parquet").to_pylist()[11]
    assert document["scenario"] == "short-0011"
    assert document["seed"] == row["seed"]
    assert document["detection"]["time_s"] == row["detection.time_s"]
    assert document["tracking"]["post_fault_rms_deg_s"]["r"] == row["tracking.post_fault_rms_deg_s.r"]
    folder = tmp_path / "short" / "flights" / "short-0011"
    assert {"scenario.yaml", "log.parquet", "metrics.json"} <= {path.name for path in folder.iterdir()}


def test_asked_for_flights_leave_their_logs(tmp_path, small_batches):
    options = Options(out=tmp_path, workers=2, report=False, keep=Keep("selected", frozenset({2, 40})))
    run_sweep(sweep_of(), options)
    kept = tmp_path / "short" / "flights"
    assert {path.name for path in kept.iterdir()} == {"short-0002", "short-0040"}
    assert pq.read_table(kept / "short-0040" / "log.parquet").num_rows == 100


UNFLYABLE = SHORT.replace("{normal: [45, 3], within: [36, 54]}", "{choice: [20, 45]}").replace(
    "runs: 48", "runs: 12"
)


def test_what_cannot_be_flown_does_not_stop_the_rest(tmp_path, small_batches):
    summary = run_sweep(sweep_of(UNFLYABLE), Options(out=tmp_path, workers=2, keep=Keep("failed")))
    assert summary["statuses"]["bad_input"] + summary["statuses"]["flown"] == 12
    assert summary["reasons"][0]["count"] == summary["statuses"]["bad_input"] > 0
    assert "20 m/s" in (tmp_path / "short" / "report.html").read_text()


def test_if_nothing_can_be_flown_that_is_a_failure(tmp_path, small_batches):
    nothing = sweep_of(UNFLYABLE.replace("[20, 45]", "[20]"))
    with pytest.raises(SimulationFailed, match=r"no flight could be flown: .*20 m/s"):
        run_sweep(nothing, Options(out=tmp_path, workers=2, report=False))
    assert (tmp_path / "short" / "summary.json").exists()
