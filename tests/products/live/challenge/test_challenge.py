"""A challenge from beginning to end: what is handed out, what comes in, points, and the same grades again."""

import json
import os
import stat
import sys
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.studies.compare.trial import Entry, Result, with_entry
from beaver_ftc_live.challenge import folders, grading, line, pilot
from beaver_ftc_live.challenge.line import Allowance, Barred, SubmittedCode

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
    assert min(len(seed) for seed in seeds) > 12


def test_as_many_flights_are_hidden_as_are_asked_for(tmp_path):
    done = beaver("new", tmp_path / "autumn", "--flights", "8", "--format", "json")
    said = json.loads(done.stdout)
    assert (said["flights"], said["teacher"]) == (8, str(tmp_path / "autumn" / "teacher"))
    assert len(folders.hidden_flights(tmp_path / "autumn")) == 8
    done = beaver("new", tmp_path / "spring", "--flights", "12")
    assert f"{tmp_path / 'spring' / 'teacher'}: 12 hidden flights, for you alone" in done.stdout
    assert len(folders.hidden_flights(tmp_path / "spring")) == 12


def test_students_are_told_the_limits_that_hold(challenge):
    told = handed_out(challenge, "README.md")
    for limit in (f"{line.ALL_S:g} s for all", "64 KiB", "1024 MiB", "nothing from 5 s on"):
        assert limit in told
    assert "{" not in told


def test_nothing_is_replaced(tmp_path, challenge):
    with pytest.raises(BadInput, match="exists, allowed: a new folder"):
        folders.new(challenge, 4, grading.rules())
    texts = ["first", "second", "third"]
    kept = [folders.keep(text, "ada", challenge) for text in texts]
    assert [path.name for path in kept] == ["ada-1.py", "ada-2.py", "ada-3.py"]
    assert [path.read_text() for path in kept] == texts
    folders.keep("other", "ada-1", challenge)
    assert [(each.student, each.file.name) for each in folders.submissions(challenge)] == [
        ("ada", "ada-3.py"),
        ("ada-1", "ada-1-1.py"),
    ]


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


def test_a_name_that_is_no_file_s(tmp_path):
    done = beaver("submit", tmp_path / "mine.py", "--student", "../ada")
    assert "--student '../ada', allowed: letters, digits" in str(done.exception)


def test_a_folder_with_one_file_is_a_submission(tmp_path):
    (tmp_path / "mine.py").write_text("#" * 65_536)
    assert folders.source_of(tmp_path) == "#" * 65_536


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


def test_a_row_counts_what_is_its_own():
    """Delays of faults found, neither after a false alarm nor where there is none; six flights, unlike."""
    seen = [
        replace(SEEN, delay_s=0.5), replace(SEEN, delay_s=1.75, correct=False), replace(SEEN, delay_s=4.0),
        replace(SEEN, delay_s=0.125, false_alarm=True, correct=False),
        replace(SEEN, delay_s=inf, correct=False), replace(SEEN, delay_s=0.25, faulted=False, correct=False),
        None,
    ]  # fmt: skip
    row = grading.detectors_row(grading.Graded("ada", "detector", results=seen))
    counted = ("flights", "false_alarms", "faults", "detected", "delay_median_s", "named_rightly", "reason")
    assert {name: row[name] for name in counted} == dict(
        zip(counted, (6, 1, 5, 3, 1.75, 2, None), strict=True)
    )
    assert row["score"] == pytest.approx((95.0 + 32.5 + 60.0 + 100.0) / 7.0, abs=0.05)
    oracle = [replace(SEEN, rms_deg_s=size) for size in (0.2, 0.3, 0.5)]
    flown = [replace(SEEN, rms_deg_s=0.3), None, replace(SEEN, rms_deg_s=inf)]
    laws = grading.laws_row(grading.Graded("bob", "law", results=flown), oracle)
    assert (laws["flights"], laws["lost"], laws["tracking_median"]) == (2, 1, None)
    assert laws["score"] == pytest.approx(100.0 * 2.0 / 3.0 / 3.0, abs=0.05)
    flown = [replace(SEEN, rms_deg_s=size) for size in (0.3, 0.9, 0.6)]
    laws = grading.laws_row(grading.Graded("bob", "law", results=flown), oracle)
    assert (laws["tracking_median"], laws["error_median_deg_s"]) == pytest.approx((1.5, 0.6))


def test_what_is_built_in_takes_no_place():
    names = ["ada", grading.DETECTOR, "bob", "eve"]
    results = [[SEEN], [replace(SEEN, delay_s=0.0)], [SEEN], [None]]
    rows = [grading.Graded(name, "detector", results=of) for name, of in zip(names, results, strict=True)]
    rows += [grading.Graded(name, results=[SEEN]) for name in (grading.BUILT_IN_LAW, grading.ORACLE)]
    document = grading.document_of(rows, 1)
    assert [(row["place"], row["student"]) for row in document["detectors"]] == [
        (None, grading.DETECTOR),
        (1, "ada"),
        (2, "bob"),
        (3, "eve"),
    ]
    assert [row["student"] for row in document["laws"]] == [grading.BUILT_IN_LAW]


def test_a_stranger_s_text_cannot_colour_a_page():
    assert line.plain("a\x1b[31m<b>\n|`é") == "a??31m?b??????"[:13]
    assert len(line.plain("x" * 999)) == line.MOST_TEXT


def test_nor_can_what_is_said_of_a_file_that_is_refused(monkeypatch):
    def refuses(path):
        raise BadInput("a<b>\x1b[31m|c")

    monkeypatch.setattr(folders, "source_of", refuses)
    found = grading.grade_case(folders.Submission("ada", Path("ada-1.py"), ""), [])
    assert (found.student, found.barred, found.reason) == ("ada", True, "a?b???31m?c")


@pytest.mark.parametrize(
    ("said", "verdict"),
    [
        ((1.0, 3.0, 5.0, 0.0, nan, 2.5, 0.0), ("r", "unanticipated", None)),
        ((1.0, 2.0, 4.0, 1.0, -0.3, 2.5, 0.0), ("q", "flap", -0.3)), ((0.0,) * 7, (None, None, None)),
        ((1.0, 4.0, 1.0, 0.0, 0.0, 0.0, 0.0), Barred), ((1.0, 1.0, 6.0, 0.0, 0.0, 0.0, 0.0), Barred),
        ((1.0, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0), Barred), ((1.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0), Barred),
        ((1.0, 1.0, 1.0, 1.0, nan, 0.0, 0.0), BeaverFtcError),
        ((1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0), BeaverFtcError),
    ],
)  # fmt: skip
def test_what_a_stranger_says_is_one_of_the_verdicts_there_are(monkeypatch, said, verdict):
    """Axis and name by their places, none at 0; past the last of them it has written on the line itself."""
    monkeypatch.setattr(line, "_shown", lambda measured: [])
    stranger = object.__new__(line.SubmittedDetector)
    stranger.surfaces = ("aileron", "elevator", "rudder", "flap")
    stranger.asked = lambda *_: np.array([*said, 1.0, nan, 0.5, 0.2])
    if isinstance(verdict, tuple):
        found = stranger.step(SimpleNamespace(t_s=1.0), np.zeros(4))
        assert (found.axis, found.isolated, found.estimate) == verdict
        assert (found.detected, found.statistic, found.effectiveness) == (bool(said[0]), said[5], None)
    else:
        with pytest.raises(verdict):
            stranger.step(SimpleNamespace(t_s=1.0), np.zeros(4))


@pytest.mark.parametrize("place", [4, 7, 8, 9, 10])
def test_every_number_of_an_answer_must_be_finite(monkeypatch, place):
    monkeypatch.setattr(line, "_shown", lambda measured: [])
    stranger, said = object.__new__(line.SubmittedDetector), np.array([1.0] * 7 + [0.9, 0.8, 0.7, 0.6])
    stranger.surfaces, stranger.asked = ("aileron", "elevator", "rudder", "flap"), lambda *_: said
    found = stranger.step(SimpleNamespace(t_s=1.0), np.zeros(4))
    assert found.effectiveness.tolist() == [0.9, 0.8, 0.7, 0.6]
    said[place] = nan
    with pytest.raises(BeaverFtcError, match=r"is not finite: .*nan"):
        stranger.step(SimpleNamespace(t_s=1.0), np.zeros(4))


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


def test_grades_of_other_hidden_flights_are_others(challenge, monkeypatch):
    """What has been graded is kept under a number that follows from the flights, and tells nobody of them."""
    asked = []
    monkeypatch.setattr(grading, "run_study", lambda study, *_: asked.append(study.follows_from))
    folders.keep("text", "ada", challenge)
    hidden = challenge / "teacher" / "loss.yaml"
    text = hidden.read_text()
    for edited in (text, text, text + "# a word\n", reseeded(text)):
        hidden.write_text(edited)
        grading.grade(challenge, 1, None)
    assert asked[0] == asked[1] == asked[2] != asked[3]
    assert not any(word in asked[0] for word in ("seed", "loss", "Scenario"))


def reseeded(text):
    seed = text.partition("seed: ")[2].split()[0]
    return text.replace(seed, str(int(seed) + 1))


def test_a_challenge_that_is_none(tmp_path):
    assert "no such folder" in str(beaver("grade", tmp_path / "no").exception)
    assert "no hidden flights" in str(beaver("grade", tmp_path).exception)
    (tmp_path / "mine.py").write_text("")
    with pytest.raises(BadInput, match="is no challenge"):
        folders.keep("", "ada", tmp_path)
    (tmp_path / "submissions").mkdir()
    with pytest.raises(BadInput, match="submissions: no submissions, allowed: files NAME-1"):
        folders.submissions(tmp_path)


def test_the_last_submission_counts_and_a_file_as_large_as_allowed_is_one(tmp_path):
    """By its number, which is no word: 10 comes after 9."""
    (tmp_path / "submissions").mkdir()
    for name in ("ada-9", "ada-10", "ada-2", "bob-1", "bob", "bob-x"):
        (tmp_path / "submissions" / f"{name}.py").write_bytes(b"#" * 65_536)
    found = folders.submissions(tmp_path)
    assert [(one.student, one.file.name) for one in found] == [("ada", "ada-10.py"), ("bob", "bob-1.py")]
    assert len(folders.source_of(found[0].file)) == 65_536
    assert folders.keep("text", "ada", tmp_path).name == "ada-11.py"


@pytest.mark.parametrize(("student", "kind", "places"), [
    ("ada", "detector", "detectors"), ("ada", "", "detectors"), ("ada", "law", "laws"),
    ("ada", "fault-tolerant law", "laws"), ("built-in scheme", "", "detectors"), ("built-in law", "", "laws"),
    ("built-in law", "detector", "laws"), (grading.ORACLE, "law", ""),
])  # fmt: skip
def test_each_row_is_of_one_ranking(student, kind, places):
    row = grading.Graded(student, kind)
    of = {"detectors": ("detector", "built-in scheme"), "laws": ("law", "built-in law")}
    assert [name for name, place in of.items() if grading._belongs(row, *place)] == places.split()


def test_the_built_in_ones_take_no_place():
    scores = {"cid": 70.0, "built-in scheme": 80.0, "bea": 70.0, "ada": 90.5, "dan": 12.25}
    rows = grading._ranked([{"student": name, "score": score} for name, score in scores.items()])
    assert [(row["student"], row["place"]) for row in rows] == [
        ("ada", 1), ("built-in scheme", None), ("bea", 2), ("cid", 3), ("dan", 4),
    ]  # fmt: skip
    cells = [
        ("score", 70.0),
        ("flights", 3),
        ("place", None),
        ("reason", "late"),
        ("tracking_median", 1.23456),
    ]
    assert [grading._cell(*one) for one in cells[:2]] == ["70.0", "3"]
    assert grading._table([rows[0] | {"flights": 3, "unknown": 1}]).head == [
        "",
        "student",
        "score",
        "flights",
    ]


def test_a_false_alarm_in_every_flight_is_a_reason_of_a_detector():
    false, says = replace(SEEN, false_alarm=True), "a false alarm in every flight"
    for row, flown, reason in (
        (grading.Graded("ada", "detector"), [false, false], says),
        (grading.Graded("ada", "detector"), [false, SEEN], None),
        (grading.Graded("ada", "detector"), [], None),
        (grading.Graded("ada", "law"), [false], None),
        (grading.Graded("ada", "detector", reason="late"), [false], "late"),
    ):
        assert grading._reason(row, flown) == reason


@pytest.mark.parametrize(("source", "found"), [
    ("class A:\n def reset(self, c): ...\n def step(self, a, b): ...", "detector"),
    ("class A:\n def reset(self, c): ...\n def step(self, a, b, c): ...", "law"),
    ("class A:\n fault_tolerant = True\n def reset(self, c): ...\n def step(self, a, b, c): ...",
     "fault-tolerant law"),
    ("class A:\n fault_tolerant = True\n def reset(self, c): ...\n def step(self, a, b): ...", "detector"),
    ("class B:\n def step(self, a, b): ...", "classes with reset and step: none; allowed: one"),
    ("class A:\n def reset(self, c): ...\n def step(self, a, b): ...\nclass B(A): ...",
     "classes with reset and step: A, B; allowed: one"),
    ("class A:\n def reset(self, c): ...\n def step(self, a): ...",
     r"step\(self, a\), allowed: step\(measured, command\)"),
    ("from beaver_ftc.control.rivals.indi import IncrementalInversion", "step: none; allowed: one"),
])  # fmt: skip
def test_the_one_class_of_a_submission(monkeypatch, source, found):
    monkeypatch.setitem(sys.modules, pilot.MODULE, None)
    if "law" in found or found == "detector":
        plug_in, kind = pilot.class_of(source, "ada.py")
        assert (plug_in.__name__, kind) == ("A", found)
        return
    with pytest.raises(TypeError, match=found):
        pilot.class_of(source, "ada.py")


def test_a_verdict_goes_over_the_line_as_numbers_and_comes_back():
    surfaces = ("aileron", "elevator")
    said = [
        Verdict(True, "q", "elevator", None, -0.25, np.array([0.5, 0.75]), 1.5),
        Verdict(False, None, "unanticipated", None, None, None, 0.5), Verdict(True, "r", statistic=2.5),
    ]  # fmt: skip
    numbers = [pilot.verdict_numbers(one, surfaces) for one in said]
    np.testing.assert_array_equal(numbers, [
        [1, 2, 2, 1, -0.25, 1.5, 1, 0.5, 0.75], [0, 0, 3, 0, 0, 0.5, 0, nan, nan],
        [1, 3, 0, 0, 0, 2.5, 0, nan, nan],
    ])  # fmt: skip
    for one, given in zip(said, numbers, strict=True):
        back = pilot.verdict_of(given, surfaces)
        assert back._replace(effectiveness=None) == one._replace(effectiveness=None)
        np.testing.assert_array_equal(back.effectiveness, one.effectiveness)


@pytest.mark.parametrize(("said", "error", "says"), [
    (None, TypeError, "step returned NoneType, allowed: a Verdict"),
    (Verdict(axis="x"), ValueError, "axis 'x', isolated None, allowed"),
    (Verdict(isolated="nose"), ValueError, "axis None, isolated 'nose', allowed"),
    (Verdict(effectiveness=np.ones(3)), ValueError, r"effectiveness has shape \(3,\), allowed: \(2,\)"),
])  # fmt: skip
def test_what_is_no_verdict_is_told(said, error, says):
    with pytest.raises(error, match=says):
        pilot.verdict_numbers(said, ("aileron", "elevator"))


def test_a_link_to_itself_is_no_file_to_hand_in(tmp_path):
    (tmp_path / "mine").symlink_to("mine")
    done = beaver("submit", tmp_path / "mine")
    assert (
        str(done.exception)
        == f"{tmp_path / 'mine'}: is no Python file, allowed: one .py file, or a folder with one"
    )
