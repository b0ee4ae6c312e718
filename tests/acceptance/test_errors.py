"""What goes wrong is said in a line each, with its documented status, and leaves nothing half written."""

import json
import re

import pytest

FINE = "name: fine\nduration_s: 2\n"
# What a file says, and the start of each line that must be said about it: place, then key.
MISTAKES = {
    "unknown key": ("name: bad\nrate_hzz: 50\n", ["bad.yaml:2: rate_hzz: "]),
    "unknown key below": (
        "name: bad\ninitial:\n  airspeed_kts: 90\n",
        ["bad.yaml:3: initial.airspeed_kts: "],
    ),
    "wrong type": ("name: bad\nduration_s: long\n", ["bad.yaml:2: duration_s: "]),
    "out of range": ("name: bad\nrate_hz: 5\n", ["bad.yaml:2: rate_hz: "]),
    "not finite": ("name: bad\nduration_s: .nan\n", ["bad.yaml:2: duration_s: "]),
    "a list for a mapping": ("name: bad\nfdi: [1, 2]\n", ["bad.yaml:2: fdi: "]),
    "no name": ("duration_s: 2\n", ["bad.yaml:1: name: "]),
    "unlawful name": ("name: ../up\n", ["bad.yaml:1: name: "]),
    "unknown fault type": (
        "name: bad\nfaults:\n  - {type: stuk, actuator: elevator, at_s: 1}\n",
        ["bad.yaml:3: faults[0].type: "],
    ),
    "fault after the end": (
        "name: bad\nduration_s: 2\nfaults: [{type: stuck, actuator: elevator, at_s: 9}]\n",
        ["bad.yaml:3: faults[0].at_s: "],
    ),
    "unregistered law": ("name: bad\ncontrol: {law: hope}\n", ["bad.yaml:2: control.law: "]),
    "unregistered scheme": ("name: bad\nfdi: {scheme: hope}\n", ["bad.yaml:2: fdi.scheme: "]),
    "two mistakes": (
        "name: bad\nrate_hzz: 50\nduration_s: -1\n",
        ["bad.yaml:2: rate_hzz: ", "bad.yaml:3: duration_s: "],
    ),
    "no such table": (
        "name: bad\nreference: {p: [{csv: {file: no.csv, column: p_rad_s}}]}\n",
        ["bad.yaml:2: reference.p[0]."],
    ),
    "no YAML": ("name: [bad\n", ["bad.yaml:"]),
    "a sentence": ("hello\n", ["bad.yaml:1: "]),
    "empty": ("", ["bad.yaml:1: "]),
    "a key twice": ("name: bad\nseed: 1\nseed: 2\n", ["bad.yaml:3: seed: "]),
}
USAGE = [
    ("fly",),
    ("run",),
    ("run", "fault-free", "--fast"),
    ("run", "fault-free", "--format", "xml"),
    ("trim", "--airspeed-mps", "fast"),
    ("trim", "--airspeed-mps", "0"),
    ("sweep", "surfaces-grid", "--workers", "0"),
    ("matrix", "--airspeed", "0"),
    ("verify", "--hours", "-1"),
    ("bench", "--rounds", "1"),
]
# Commands that take a scenario or a sweep, as they are given one that is not there.
ABSENT = [
    ("run", "absent.yaml"),
    ("run", "no-such-scenario"),
    ("validate", "absent.yaml"),
    ("validate", "no-such-scenario"),
    ("mismatch", "absent.yaml"),
    ("trim", "no-such-scenario"),
    ("detectability", "absent.yaml"),
    ("sweep", "absent.yaml"),
    ("sweep", "no-such-sweep"),
    ("compare", "--sweep", "absent.yaml"),
    ("compare", "absent/run"),
]


def _lines(done, status):
    """The lines on standard error of a command that has ended with this status, and not by a crash."""
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    assert "unexpected" not in done.stderr, done.stderr
    assert done.returncode == status, f"{done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stderr.splitlines()


def _matches(lines, starts):
    return len(lines) == len(starts) and all(map(str.startswith, lines, starts))


def _left_behind(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(("text", "starts"), MISTAKES.values(), ids=MISTAKES)
def test_each_mistake_in_a_file_is_a_line(text, starts, beaver, tmp_path):
    (tmp_path / "bad.yaml").write_text(text)
    (tmp_path / "fine.yaml").write_text(FINE)
    lines = _lines(beaver("run", "fine.yaml", "bad.yaml"), 2)
    assert _matches(lines, starts), lines
    answer = beaver("validate", "fine.yaml", "bad.yaml", "--format", "json")
    files = {file["file"]: file for file in json.loads(answer.stdout)["files"]}
    assert (answer.returncode, files["fine.yaml"]["valid"], files["bad.yaml"]["valid"]) == (2, True, False)
    assert files["bad.yaml"]["errors"] == lines
    assert _left_behind(tmp_path) == ["bad.yaml", "fine.yaml"]


def test_mistakes_of_several_files_are_all_said_and_nothing_flies(beaver, tmp_path):
    for name in ("one", "two"):
        (tmp_path / f"{name}.yaml").write_text(f"name: {name}\nrate_hzz: 50\n")
    done = beaver("run", "one.yaml", "two.yaml", "absent.yaml", "--format", "json")
    lines = _lines(done, 2)
    assert _matches(lines, ["one.yaml:2: rate_hzz: ", "two.yaml:2: rate_hzz: ", "absent.yaml: "])
    assert json.loads(done.stdout) == {"passed": False, "runs": [], "errors": lines}
    assert _left_behind(tmp_path) == ["one.yaml", "two.yaml"]


@pytest.mark.parametrize("arguments", ABSENT, ids=" ".join)
def test_what_is_not_there_is_bad_input(arguments, beaver, tmp_path):
    done = beaver(*arguments)
    (line,) = _lines(done, 2)
    assert re.search(r"absent|no-such", line)
    assert done.stdout == ""
    assert _left_behind(tmp_path) == []


@pytest.mark.parametrize("arguments", USAGE, ids=" ".join)
def test_wrong_usage_is_status_2_and_names_what_is_wrong(arguments, beaver, tmp_path):
    done = beaver(*arguments)
    lines = _lines(done, 2)
    assert lines[0].startswith("Usage: beaver-ftc")
    assert lines[-1].startswith("Error: ")
    assert done.stdout == ""
    assert _left_behind(tmp_path) == []


@pytest.mark.parametrize("given", [b"\xff\xfe\x00name", b"name: bad\ndescription: \xe9\n", b"\x00\x01\x02"])
def test_a_file_that_is_no_text_is_bad_input(given, beaver, tmp_path):
    (tmp_path / "bad.yaml").write_bytes(given)
    (line,) = _lines(beaver("run", "bad.yaml"), 2)
    assert line.startswith("bad.yaml:")


def test_a_folder_for_a_file_is_bad_input(beaver, tmp_path):
    (tmp_path / "folder.yaml").mkdir()
    (line,) = _lines(beaver("run", "folder.yaml"), 2)
    assert line.startswith("folder.yaml: ")


def test_a_missed_expectation_is_status_1_and_is_named(beaver, tmp_path):
    (tmp_path / "strict.yaml").write_text(
        FINE.replace("fine", "strict") + "expect: {no_false_alarm: false}\n"
    )
    done = beaver("run", "strict.yaml", "--no-report")
    assert _lines(done, 1) == []
    assert re.search(r"^ expected +MISSED a false alarm, got no false alarm$", done.stdout, re.MULTILINE)
    answer = beaver("run", "strict.yaml", "--no-report", "--format", "json", "--junit", "verdict.xml")
    assert (answer.returncode, json.loads(answer.stdout)["passed"]) == (1, False)
    assert 'failures="1"' in (tmp_path / "verdict.xml").read_text()


@pytest.mark.parametrize("command", [("run", "fine.yaml"), ("mismatch", "fine.yaml"), ("sweep", "few.yaml")])
@pytest.mark.parametrize("out", ["file/below", "/proc/nowhere"])
def test_a_folder_that_cannot_be_written_is_status_3(command, out, beaver, tmp_path):
    (tmp_path / "fine.yaml").write_text(FINE)
    (tmp_path / "few.yaml").write_text(
        "base: fine.yaml\nruns: 2\nvary: {initial.airspeed_mps: {uniform: [44, 46]}}\n"
    )
    (tmp_path / "file").write_text("of the user")
    (line,) = _lines(beaver(*command, "--out", out, "--no-report"), 3)
    assert out in line
    assert (tmp_path / "file").read_text() == "of the user"
    assert _left_behind(tmp_path) == ["few.yaml", "file", "fine.yaml"]


def test_an_output_that_cannot_be_written_is_status_3(started, tmp_path):
    done = started.run("bash", "-c", "beaver-ftc list > /dev/full", cwd=tmp_path)
    (line,) = _lines(done, 3)
    assert "standard output" in line


def test_a_reader_that_goes_away_is_no_error(started, tmp_path):
    done = started.run("bash", "-o", "pipefail", "-c", "beaver-ftc schema | head -n 1", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "{\n", "")


def test_two_scenarios_of_one_name_are_bad_input(beaver, tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text(FINE)
    (line,) = _lines(beaver("run", "a.yaml", "b.yaml"), 2)
    assert "fine" in line
    assert _left_behind(tmp_path) == ["a.yaml", "b.yaml"]
