"""What goes wrong is said in a line each, with its documented status, and leaves nothing half written."""

import json
import re

import pytest

FINE = "name: fine\nduration_s: 2\n"
# What a file says, and the start of each line that must be said about it: place, then key.
MISTAKES = {
    "unknown key": ("name: bad\nrate_hzz: 50\n", ["bad.yaml:2: rate_hzz: "]),
    "unknown fault type": (
        "name: bad\nfaults:\n  - {type: stuk, actuator: elevator, at_s: 1}\n",
        ["bad.yaml:3: faults[0].type: "],
    ),
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
    "a key twice": ("name: bad\nseed: 1\nseed: 2\n", ["bad.yaml:3: seed: "]),
}
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


@pytest.mark.parametrize("given", [b"\xff\xfe\x00name", b"name: bad\ndescription: \xe9\n", b"\x00\x01\x02"])
def test_a_file_that_is_no_text_is_bad_input(given, beaver, tmp_path):
    (tmp_path / "bad.yaml").write_bytes(given)
    (line,) = _lines(beaver("run", "bad.yaml"), 2)
    assert line.startswith("bad.yaml:")


def test_a_folder_for_a_file_is_bad_input(beaver, tmp_path):
    (tmp_path / "folder.yaml").mkdir()
    (line,) = _lines(beaver("run", "folder.yaml"), 2)
    assert line.startswith("folder.yaml: ")


def test_two_scenarios_of_one_name_are_bad_input(beaver, tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text(FINE)
    (line,) = _lines(beaver("run", "a.yaml", "b.yaml"), 2)
    assert "fine" in line
    assert _left_behind(tmp_path) == ["a.yaml", "b.yaml"]
