"""A challenge from beginning to end: what is handed out, what comes in, points, and the same grades again."""

import json
import os
import stat
from dataclasses import replace
from math import inf

import pytest
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare.trial import Entry, Result, with_entry
from beaver_ftc_live.challenge import folders, grading
from beaver_ftc_live.challenge.line import Allowance, SubmittedCode

ENTRY = Entry("adaptive-estimators", "nominal")
SEEN = Result(ENTRY, False, 8.0, True, delay_s=1.0, correct=True, rms_deg_s=0.4)


def beaver(*asked):
    return CliRunner().invoke(app, ["challenge", *map(str, asked)])


def handed_out(challenge, name):
    return (challenge / "public" / name).read_text()


def test_what_is_hidden_is_for_its_owner_and_new_each_time(tmp_path):
    seeds = set()
    for name in ("one", "other"):
        folders.new(tmp_path / name, 8, grading.rules())
        teacher = tmp_path / name / "teacher"
        assert stat.S_IMODE(teacher.stat().st_mode) == 0o700
        for path in teacher.iterdir():
            assert stat.S_IMODE(path.stat().st_mode) == 0o600
            seeds.add(path.read_text().partition("seed: ")[2].split()[0])
        public = "".join(path.read_text() for path in (tmp_path / name / "public").iterdir())
        assert not [seed for seed in seeds if seed in public]
        flown = folders.hidden_flights(tmp_path / name)
        assert [bool(flight.faults) for flight in flown] == [False] * 2 + [True] * 6
    assert len(seeds) == 4


def test_the_order_of_the_flights_tells_nothing(tmp_path, monkeypatch):
    folders.new(tmp_path / "one", 60, grading.rules())
    monkeypatch.setattr(folders, "submissions", lambda _: [])
    monkeypatch.setattr(grading, "run_study", lambda study, *_: study.fly.keywords["flights"])
    broken = [bool(flight.faults) for flight in grading.grade(tmp_path / "one", 1, None)]
    assert broken != sorted(broken)


def test_a_seed_that_a_submission_could_find_is_refused(challenge):
    path = challenge / "teacher" / "loss.yaml"
    path.write_text(path.read_text().replace("seed: ", "seed: 1 # "))
    with pytest.raises(BadInput, match=f"{path}: seed: "):
        folders.hidden_flights(challenge)


def test_hidden_flights_among_what_students_may_read_are_refused(challenge, monkeypatch):
    monkeypatch.setattr(folders, "readable", lambda: [str(challenge)])
    with pytest.raises(BadInput, match="lies among Python's packages"):
        folders.hidden_flights(challenge)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda at: at.mkdir(), "0 Python files, allowed: one"),
        (
            lambda at: (at.mkdir(), [(at / f"{i}.py").touch() for i in range(2)]),
            "2 Python files, allowed: one",
        ),
        (lambda at: at.with_suffix(".txt").write_text(""), "is no Python file"),
        (lambda at: at.write_bytes(b"#" * 65_537), "larger than allowed: 64 KiB"),
        (lambda at: at.write_bytes(b"\xff\xfe"), "is not UTF-8 text"),
        (lambda at: at.symlink_to("/etc/hostname"), "is no Python file"),
        (os.mkfifo, "is no Python file"),
    ],
)
def test_what_is_no_submission(tmp_path, make, says):
    path = tmp_path / "mine.py"
    make(path)
    done = beaver("submit", path)
    assert done.exit_code != 0
    assert says in str(done.exception)


@pytest.mark.parametrize(
    ("result", "points"),
    [
        (None, 0.0),
        (SEEN, 40.0 + 50.0),  # 1 s of 5 s late
        (replace(SEEN, correct=False), 40.0),
        (replace(SEEN, delay_s=0.0), 100.0),
        (replace(SEEN, delay_s=7.0), 50.0),
        (replace(SEEN, delay_s=inf, correct=False), 0.0),
        (replace(SEEN, false_alarm=True), 0.0),
        (replace(SEEN, faulted=False, delay_s=inf), 100.0),
        (replace(SEEN, faulted=False, delay_s=inf, false_alarm=True), 0.0),
    ],
)
def test_points_of_a_detector(result, points):
    assert grading.points_of_detector(result) == pytest.approx(points)


@pytest.mark.parametrize(("error", "points"), [(0.4, 50.0), (0.2, 100.0), (0.1, 100.0), (inf, 0.0)])
def test_points_of_a_law(error, points):
    oracle = replace(SEEN, rms_deg_s=0.2)
    assert grading.points_of_law(replace(SEEN, rms_deg_s=error), oracle) == pytest.approx(points)
    assert grading.points_of_law(None, oracle) == 0.0


def test_a_lost_flight_counts_and_a_barred_submission_has_nothing():
    row = grading.detectors_row(grading.Graded("ada", results=[SEEN, None]))
    assert (row["score"], row["flights"]) == (45.0, 1)
    barred = grading.Graded("bob", reason="no", barred=True, results=[SEEN])
    assert grading.detectors_row(barred)["score"] == 0.0


@pytest.mark.parametrize("name", ["detector.py", "law.py"])
def test_it_flies_behind_the_walls_as_it_flies_here(name, challenge):
    """To the bit: what is measured arrives whole, and so does what is answered."""
    source, flight = handed_out(challenge, name), folders.hidden_flights(challenge)[-1]
    with SubmittedCode(source, name, Allowance()) as first:
        first.look()
    found = grading.fly_submission(first, source, name, Allowance(), flight)
    here = {"bf": bf}
    exec(source, here)
    plug_in = here[first.class_name]()
    given = {"detector": plug_in} if name == "detector.py" else {"law": plug_in}
    assert grading._flown(with_entry(flight, found.entry), found.entry, **given) == found
    assert found.rms_deg_s > 0


def test_from_beginning_to_end(challenge, monkeypatch):
    monkeypatch.chdir(challenge / "public")
    for file, student in (("detector.py", "ada"), ("law.py", "bob")):
        done = beaver("submit", file, "--student", student, "--to", "..", "--format", "json")
        assert json.loads(done.stdout)["submitted"] == f"../submissions/{student}-1.py"
    (challenge / "submissions" / "eve-1.py").write_text("1/0")
    (challenge / "submissions" / "notes.py").write_text("no submission's name")
    (challenge / "teacher" / "healthy.yaml").unlink()
    grades = json.loads(beaver("grade", "..", "--workers", "1", "--format", "json").stdout)
    first = (challenge / "grades" / "grades.json").read_bytes()
    assert "eve" in beaver("grade", "..", "--workers", "1").stdout
    assert (challenge / "grades" / "grades.json").read_bytes() == first
    places = {row["student"]: row["place"] for kind in ("detectors", "laws") for row in grades[kind]}
    assert places == {"ada": 1, "eve": 2, "bob": 1, grading.DETECTOR: None, grading.BUILT_IN_LAW: None}
    (lost,) = (row for row in grades["detectors"] if row["student"] == "eve")
    assert (lost["score"], lost["reason"]) == (0.0, "ZeroDivisionError: division by zero")
    for page in ("grades.json", "grades.md", "grades.html"):
        assert "ZeroDivisionError" in (challenge / "grades" / page).read_text()


def test_a_challenge_that_is_none(tmp_path):
    assert "no such folder" in str(beaver("grade", tmp_path / "no").exception)
    assert "no hidden flights" in str(beaver("grade", tmp_path).exception)
    (tmp_path / "mine.py").write_text("")
    with pytest.raises(BadInput, match="is no challenge"):
        folders.keep("", "ada", tmp_path)
    (tmp_path / "submissions").mkdir()
    with pytest.raises(BadInput, match="submissions: no submissions, allowed: files NAME-1"):
        folders.submissions(tmp_path)


def test_nobody_else_may_read_where_hidden_flights_lie(tmp_path):
    at = tmp_path / "autumn"
    folders.new(at, 4, grading.rules())
    for place, others in (
        ("teacher", 0o040), ("teacher", 0o001), ("teacher/healthy.yaml", 0o004), ("teacher/loss.yaml", 0o020),
    ):  # fmt: skip
        path, own = at / place, 0o700 if place == "teacher" else 0o600
        path.chmod(own | others)
        with pytest.raises(BadInput) as refused:
            folders.hidden_flights(at)
        assert str(refused.value) == (
            f"challenge grade: {path}: others may read it, allowed: its owner alone (chmod go= {path})"
        )
        path.chmod(own)
