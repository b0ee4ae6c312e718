import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import yaml

from commands import beaver

BEAVER = Path(sys.executable).with_name("beaver-ftc")
SHORT = """
name: short
duration_s: 6
reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.2}}]}
faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 3, profile: abrupt}]
expect: {detected_within_s: 1.0, no_departure: true}
"""


@pytest.fixture
def short(tmp_path):
    (tmp_path / "short.yaml").write_text(SHORT)
    return tmp_path


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.usefixtures("figures_in_short")
def test_run_writes_the_contract_says_the_verdict_and_stops_for_a_users_file_beside_the_figures(short):
    beaver("run", "short.yaml", cwd=short)  # what this machine has not compiled yet is said once
    done = beaver("run", "short.yaml", cwd=short)
    assert (done.returncode, done.stderr) == (0, "")
    assert "short: PASSED" in done.stdout
    folder = short / "runs" / "short"
    assert _names(folder) == ["figures", "log.parquet", "metrics.json", "report.html", "scenario.yaml"]
    log = pd.read_parquet(folder / "log.parquet")
    assert log.columns[0] == "t_s"
    assert len(log) == json.loads((folder / "metrics.json").read_text())["frames"] == 600
    assert yaml.safe_load((folder / "scenario.yaml").read_text())["rate_hz"] == 100
    note = folder / "figures/note.txt"
    note.write_text("mine")
    done = beaver("run", "short.yaml", "--no-report", cwd=short)
    assert done.returncode == 3
    assert "it holds figures/note.txt, which is no result of beaver-ftc" in done.stderr
    assert note.read_text() == "mine"
    note.unlink()
    assert beaver("run", "short.yaml", "--no-report", cwd=short).returncode == 0


def test_resolved_scenario_flies_again_to_the_same_numbers(short):
    assert beaver("run", "short.yaml", "--no-report", cwd=short).returncode == 0
    again = beaver("run", "runs/short/scenario.yaml", "--no-report", "--out", "again", cwd=short)
    assert again.returncode == 0
    for name in ("log.parquet", "metrics.json", "scenario.yaml"):
        assert (short / "runs/short" / name).read_bytes() == (short / "again/short" / name).read_bytes()


def test_json_of_several_scenarios_is_a_list_with_one_verdict(short):
    (short / "strict.yaml").write_text(SHORT.replace("short", "strict").replace("1.0", "0.0"))
    done = beaver("run", "short.yaml", "strict.yaml", "--format", "json", "--no-report", cwd=short)
    document = json.loads(done.stdout)
    assert set(document) == {"passed", "runs"}
    assert document["passed"] is False
    assert [run["passed"] for run in document["runs"]] == [True, False]


@pytest.mark.parametrize("order", [("short", "strict"), ("strict", "short")])
def test_missed_expectation_is_status_1(short, order):
    (short / "strict.yaml").write_text(SHORT.replace("short", "strict").replace("1.0", "0.0"))
    done = beaver("run", *(f"{name}.yaml" for name in order), "--no-report", cwd=short)
    assert done.returncode == 1
    assert "short: PASSED" in done.stdout
    assert "strict: FAILED" in done.stdout
    assert _names(short / "runs") == ["short", "strict"]


@pytest.mark.parametrize("format", ["text", "json"])
def test_bad_input_in_one_scenario_flies_none(short, format):
    (short / "bad.yaml").write_text(SHORT.replace("duration_s: 6", "duration_s: -6\nrate_hzz: 50"))
    done = beaver("run", "short.yaml", "bad.yaml", "--format", format, cwd=short)
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert [line.split(": ")[:2] for line in lines] == [
        ["bad.yaml:3", "duration_s"],
        ["bad.yaml:4", "rate_hzz"],
    ]
    assert not (short / "runs").exists()
    if format == "json":
        assert json.loads(done.stdout) == {"passed": False, "runs": [], "errors": lines}
    else:
        assert done.stdout == ""


@pytest.mark.parametrize(
    "arguments", [["fly"], ["run"], ["run", "x", "--format", "xml"], ["trim", "--flap-deg", "x"]]
)
def test_wrong_usage_is_status_2_on_standard_error(tmp_path, arguments):
    done = beaver(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr


def test_folder_that_cannot_be_written_is_status_3(short):
    (short / "file").write_text("")
    done = beaver("run", "short.yaml", "--out", "file/runs", cwd=short)
    assert done.returncode == 3
    assert done.stderr.startswith("cannot write file/runs/short: ")
    assert done.stderr.count("\n") == 1


@pytest.fixture
def small_files():
    """As on a disk that fills up."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_disk_that_fills_up_is_status_3_and_leaves_nothing(short, small_files):
    done = beaver("run", "short.yaml", "--no-report", cwd=short)
    assert done.returncode == 3
    assert done.stderr.startswith("cannot write runs/short: ")
    assert done.stderr.count("\n") == 1
    assert _names(short) == ["short.yaml"]


def printed_into(stdout):
    """(status, what it says) of a command whose output goes there."""
    done = subprocess.run([BEAVER, "list"], stdout=stdout, stderr=subprocess.PIPE, check=False)
    return done.returncode, done.stderr


def test_full_standard_output_is_status_3():
    with open("/dev/full", "w") as full:
        status, says = printed_into(full)
    assert status == 3
    assert b"Traceback" not in says


def test_reader_that_goes_away_is_no_error():
    read, write = os.pipe()
    os.close(read)
    assert printed_into(write) == (0, b"")
    os.close(write)


LONG = SHORT.replace("short", "long").replace("duration_s: 6", "duration_s: 20000")


# Undoes what nohup, or a shell that starts jobs in the background, has the tests' process ignore.
HEARD_AGAIN = """
import os, signal, sys
for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""


@pytest.mark.parametrize(
    ("number", "status", "left"),
    [
        (signal.SIGKILL, -9, True),
        (signal.SIGTERM, 143, False),  # the others' statuses: test_main.py
    ],
)
def test_run_that_is_ended_leaves_no_half_result(short, number, status, left):
    (short / "long.yaml").write_text(LONG)
    command = [sys.executable, "-c", HEARD_AGAIN, BEAVER, "run", "long.yaml"]
    with subprocess.Popen(command, cwd=short, stderr=subprocess.PIPE) as running:
        while not list(short.glob("runs/.long*/log.parquet")):
            assert running.poll() is None
            time.sleep(0.02)
        time.sleep(0.3)
        running.send_signal(number)
        said = running.communicate(timeout=60)[1]
    assert running.returncode == status
    assert b"Traceback" not in said
    assert not (short / "runs/long").exists()
    assert (short / "runs").exists() is left


def test_version_and_help(tmp_path):
    assert beaver("--version", cwd=tmp_path).stdout.startswith("beaver-ftc ")
    said = dict(re.findall(r"^  (\w+)  +(.+)$", beaver("--help", cwd=tmp_path).stdout, re.MULTILINE))
    assert {"fly", "look", "ask", "compare", "aircraft", "logs", "links", "evidence"} >= set(said) > {"fly"}
    assert said["fly"].startswith("run: scenarios; sweep: ")


@pytest.mark.parametrize("format", ["text", "json"])
def test_what_nobody_foresaw_is_one_line_and_status_3(short, format, monkeypatch):
    def fly(*_, **__):
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr("beaver_ftc.loop.loop.fly", fly)
    done = beaver("run", "short.yaml", "--no-report", "--format", format, cwd=short)
    assert done.returncode == 3
    assert done.stderr.startswith("unexpected ZeroDivisionError: two lines")
    assert done.stderr.count("\n") == 1
    assert _names(short) == ["short.yaml"]
    if format == "json":
        assert json.loads(done.stdout)["runs"][0]["error"] == done.stderr.strip()
