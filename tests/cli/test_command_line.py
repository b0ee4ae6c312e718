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

from beaver_ftc.cli import status_of_stop
from commands import beaver

BEAVER = Path(sys.executable).with_name("beaver-ftc")
SHORT = """
name: short
duration_s: 6
reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.2}}]}
faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 3, profile: abrupt}]
expect: {detected_within_s: 1.0, no_departure: true}
"""


def _beaver(*arguments, cwd, **options):
    """In a process of its own."""
    return subprocess.run(
        [BEAVER, *arguments], cwd=cwd, capture_output=True, text=True, timeout=120, check=False, **options
    )


@pytest.fixture
def short(tmp_path):
    (tmp_path / "short.yaml").write_text(SHORT)
    return tmp_path


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.usefixtures("figures_in_short")
def test_run_writes_the_contract_says_the_verdict_and_stops_for_a_users_file_beside_the_figures(short):
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


def test_json_is_one_document_and_nothing_else(short):
    done = beaver("run", "short.yaml", "--format", "json", "--no-report", cwd=short)
    document = json.loads(done.stdout)
    (run,) = document.pop("runs")
    assert document == run
    assert run.pop("folder") == "runs/short"
    assert run == json.loads((short / "runs/short/metrics.json").read_text())
    assert run["passed"] is True
    assert _names(short / "runs/short") == ["log.parquet", "metrics.json", "scenario.yaml"]


def test_json_of_several_scenarios_is_a_list_with_one_verdict(short):
    (short / "strict.yaml").write_text(SHORT.replace("short", "strict").replace("1.0", "0.0"))
    done = beaver("run", "short.yaml", "strict.yaml", "--format", "json", "--no-report", cwd=short)
    document = json.loads(done.stdout)
    assert set(document) == {"passed", "runs"}
    assert document["passed"] is False
    assert [run["passed"] for run in document["runs"]] == [True, False]


def test_exports_lie_beside_the_log_when_asked_for(short):
    assert beaver("run", "short.yaml", "--no-report", "--csv", "--acmi", cwd=short).returncode == 0
    expected = ["flight.acmi", "log.csv", "log.parquet", "metrics.json", "scenario.yaml"]
    assert _names(short / "runs/short") == expected
    assert beaver("run", "short.yaml", "--no-report", cwd=short).returncode == 0
    assert "log.csv" not in _names(short / "runs/short")


def test_missed_expectation_is_status_1(short):
    (short / "strict.yaml").write_text(SHORT.replace("short", "strict").replace("1.0", "0.0"))
    done = beaver("run", "short.yaml", "strict.yaml", "--no-report", cwd=short)
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


def test_flight_that_cannot_be_trimmed_is_bad_input_with_its_place(short):
    (short / "slow.yaml").write_text("name: slow\ninitial: {airspeed_mps: 22, altitude_m: 6000}\n")
    for command in (["run", "short.yaml", "slow.yaml"], ["validate", "slow.yaml"]):
        done = beaver(*command, cwd=short)
        assert done.returncode == 2
        assert done.stderr.startswith("slow.yaml:2: initial")
        assert done.stderr.count("\n") == 1
        assert not (short / "runs").exists()


def test_two_scenarios_of_one_name_are_refused(short):
    done = beaver("run", "short.yaml", "short.yaml", cwd=short)
    assert done.returncode == 2
    assert "named short" in done.stderr
    assert not (short / "runs").exists()


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


def _limit_file_size():
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))


def test_disk_that_fills_up_is_status_3_and_leaves_nothing(short):
    done = _beaver("run", "short.yaml", "--no-report", cwd=short, preexec_fn=_limit_file_size)
    assert done.returncode == 3
    assert done.stderr.startswith("cannot write runs/short: ")
    assert done.stderr.count("\n") == 1
    assert _names(short) == ["short.yaml"]


def test_full_standard_output_is_status_3(short):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [BEAVER, "run", "short.yaml", "--no-report"],
            cwd=short,
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.returncode == 3
    assert b"Traceback" not in done.stderr


def test_reader_that_goes_away_is_no_error(short):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [BEAVER, "run", "short.yaml", "--no-report"],
        cwd=short,
        stdout=write,
        stderr=subprocess.PIPE,
        check=False,
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_hang_up_that_is_to_be_ignored_is_ignored(short):
    (short / "long.yaml").write_text(LONG.replace("20000", "200"))
    command = ["nohup", BEAVER, "run", "long.yaml", "--no-report"]
    with subprocess.Popen(command, cwd=short, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as running:
        while not list(short.glob("runs/.long*/log.parquet")):
            assert running.poll() is None
            time.sleep(0.02)
        running.send_signal(signal.SIGHUP)
        assert running.wait(timeout=120) in (0, 1)
    assert (short / "runs/long/metrics.json").exists()


def test_a_folder_whose_name_is_not_utf_8(short):
    folder = os.fsdecode(b"r\xe9sultats")
    done = beaver("run", "short.yaml", "--csv", "--acmi", "--no-report", "--out", folder, cwd=short)
    assert (done.returncode, done.stderr) == (0, "")
    assert (short / folder / "short" / "log.parquet").exists()
    done = beaver("compare", f"{folder}/short", "--out", folder, cwd=short)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("size", [0, 4000, -100])
def test_a_log_cut_short_is_bad_input_to_compare(short, size):
    assert beaver("run", "short.yaml", "--no-report", cwd=short).returncode == 0
    log = short / "runs/short/log.parquet"
    log.write_bytes(log.read_bytes()[:size])
    done = beaver("compare", "runs/short", cwd=short)
    assert done.returncode == 2
    says = "is damaged or cut short, allowed: a log that a run has written"
    assert done.stderr.splitlines() == [f"runs/short/log.parquet: {says}"]
    assert not (short / "comparisons").exists()


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


def test_validate_reports_every_file(short):
    (short / "bad.yaml").write_text("name: bad\nduration_s: -6\n")
    (short / "fast.yaml").write_text("name: fast\ninitial: {airspeed_mps: 57}\n")
    done = beaver("validate", "short.yaml", "bad.yaml", "fast.yaml", "nowhere.yaml", cwd=short)
    assert done.returncode == 2
    assert done.stdout.splitlines() == ["short.yaml: OK", "fast.yaml: OK"]
    assert [line.split(": ")[0] for line in done.stderr.splitlines()] == [
        "bad.yaml:2",
        "fast.yaml",
        "nowhere.yaml",
    ]
    document = json.loads(beaver("validate", "short.yaml", "bad.yaml", "--format", "json", cwd=short).stdout)
    assert document["valid"] is False
    assert [file["valid"] for file in document["files"]] == [True, False]


def test_schema_accepts_what_validate_accepts(short):
    schema = json.loads(beaver("schema", cwd=short).stdout)
    assert set(yaml.safe_load(SHORT)) <= set(schema["properties"])
    assert schema["required"] == ["name"]


def test_trim_prints_the_same_flight_as_text_and_json(tmp_path):
    options = ("--airspeed-mps", "40", "--altitude-m", "1000", "--flap-deg", "10")
    point = json.loads(beaver("trim", *options, "--format", "json", cwd=tmp_path).stdout)
    assert point["airspeed_mps"] == 40
    assert point["flap_rad"] == pytest.approx(0.17453293)
    assert max(map(abs, point["residual"].values())) < 1e-9
    text = beaver("trim", *options, cwd=tmp_path).stdout
    assert f"{point['alpha_rad'] * 57.29577951:.4f} deg" in text


def test_trim_takes_the_condition_of_a_scenario(short):
    (short / "fast.yaml").write_text("name: fast\ninitial: {airspeed_mps: 52, altitude_m: 500}\n")
    point = json.loads(
        beaver("trim", "fast.yaml", "--altitude-m", "600", "--format", "json", cwd=short).stdout
    )
    assert (point["airspeed_mps"], point["altitude_m"]) == (52, 600)


def test_what_cannot_be_trimmed_is_status_2(tmp_path):
    done = beaver("trim", "--airspeed-mps", "22", "--altitude-m", "6000", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1


def test_list_names_what_a_scenario_can_say(tmp_path):
    document = json.loads(beaver("list", "--format", "json", cwd=tmp_path).stdout)
    names = {kind: {entry["name"] for entry in entries} for kind, entries in document.items()}
    assert "elevator-partial-loss" in names["scenarios"]
    assert {"nominal", "adaptive", "fault-tolerant", "oracle"} <= names["laws"]
    assert "adaptive-estimators" in names["schemes"]
    assert {"stuck", "hardover", "float", "bias", "unanticipated"} <= names["faults"]
    assert {"sine", "doublet", "step", "square", "ramp", "chirp", "csv"} == names["signals"]
    text = beaver("list", cwd=tmp_path).stdout
    assert all(name in text for group in names.values() for name in group)


HEAVY = (
    "numpy",
    "numba",
    "jsbsim",
    "scipy",
    "matplotlib",
    "pyarrow",
    "pandas",
    "pydantic",
    "yaml",
    "rich",
    "jinja2",
)


def test_help_imports_nothing_heavy():
    script = f"import sys, beaver_ftc.cli.main; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_what_does_not_fly_loads_no_compiler():
    script = (
        "import sys, beaver_ftc.cli.main as cli\n"
        "for command in (['validate', 'elevator-partial-loss'], ['trim'], ['list']):\n"
        "    sys.argv = ['beaver-ftc', *command]\n"
        "    try:\n        cli.main()\n    except SystemExit as ended:\n        assert not ended.code\n"
        "print([name for name in ('numba', 'llvmlite', 'scipy') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_version_and_help(tmp_path):
    assert beaver("--version", cwd=tmp_path).stdout.startswith("beaver-ftc ")
    said = dict(re.findall(r"^  (\w+)  +(.+)$", beaver("--help", cwd=tmp_path).stdout, re.MULTILINE))
    assert {"run", "validate", "schema", "trim", "list"} <= set(said)
    assert said["run"] == "Simulate scenarios and report the results."


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


@pytest.mark.parametrize(
    ("stop", "status"), [(KeyboardInterrupt(), 130), (SystemExit(143), 143), (None, None)]
)
def test_a_signal_in_compiled_code_is_a_stop(stop, status):
    """Compiled code that a signal ends raises a SystemError whose cause is what the signal raised."""
    error = SystemError("returned a result with an exception set")
    error.__cause__ = stop
    assert status_of_stop(error) == status
    assert status_of_stop(ValueError()) is None
