"""Grades from results made by hand: who flies against what, the points, and every cell of both rankings."""

import hashlib
import json
import re
from dataclasses import replace
from math import inf
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.studies.compare.trial import Entry, Result
from beaver_ftc.studies.engine import Case
from beaver_ftc_live.challenge import folders, grading
from beaver_ftc_live.challenge.line import Barred

SCHEME, LAW = "adaptive-estimators", "fault-tolerant"
SEEN = Result(Entry(SCHEME, "nominal"), False, 8.0, True, delay_s=1.0, correct=True, rms_deg_s=0.4)
HEALTHY = replace(SEEN, faulted=False, delay_s=inf, correct=False)


def flown(*errors):
    return [None if error is None else replace(SEEN, rms_deg_s=error) for error in errors]


ROWS = [
    grading.Graded(
        "ada", "detector", "Ears", "limits files",
        results=[HEALTHY, SEEN, replace(SEEN, delay_s=2.5, correct=False)],
    ),
    grading.Graded("bob", "law", "Hands", "calls", "late, at 2 s", results=flown(0.4, None, 0.8)),
    grading.Graded("cid", "fault-tolerant law", "Both", "calls", results=flown(inf, 0.66, 0.6)),
    grading.Graded("eve", reason="ends", barred=True),
    grading.Graded(grading.DETECTOR, results=[
        replace(HEALTHY, false_alarm=True), replace(SEEN, delay_s=0.5),
        replace(SEEN, delay_s=inf, correct=False),
    ]),
    grading.Graded(grading.BUILT_IN_LAW, results=flown(0.25, 0.4, 0.75)),
    grading.Graded(grading.ORACLE, results=flown(0.2, 0.3, 0.6)),
]  # fmt: skip
# ada: 100, 40 + 50 and 25 points. bob: 50, 0 and 75. cid: 0, 45.45 and 100.
# The built-in scheme: 0, 45 + 50 and 0. The built-in law: 80, 75 and 80.
DETECTORS = [
    (1, "ada", "Ears", 71.7, 3, 0, 2, 2, 1.75, 1, None),
    (None, "built-in scheme", "", 31.7, 3, 1, 2, 1, 0.5, 1, None),
    (2, "eve", "", 0.0, 0, 0, 0, 0, None, 0, "ends"),
]
LAWS = [
    (None, "built-in law", "", 78.3, 3, 1.25, 0.4, 0, None),
    (1, "cid", "Both", 48.5, 3, 2.2, 0.66, 1, None),
    (2, "bob", "Hands", 41.7, 2, (2.0 + 4.0 / 3.0) / 2.0, 0.6, 0, "late, at 2 s"),
]
OF_DETECTORS = (
    "place", "student", "class", "score", "flights", "false_alarms", "faults", "detected", "delay_median_s",
    "named_rightly", "reason",
)  # fmt: skip
OF_LAWS = (
    "place", "student", "class", "score", "flights", "tracking_median", "error_median_deg_s", "lost",
    "reason",
)  # fmt: skip


def test_both_rankings_hold_every_number_of_every_row():
    document = grading.document_of(ROWS, 3)
    assert list(document) == ["flights", "walls", "detectors", "laws", "versions"]
    assert (document["flights"], document["walls"]) == (3, ["calls", "limits files"])
    for rows, keys, expected in (
        (document["detectors"], OF_DETECTORS, DETECTORS),
        (document["laws"], OF_LAWS, LAWS),
    ):
        assert [list(row) for row in rows] == [[*row] for row in rows]
        for row, values in zip(rows, expected, strict=True):
            assert row.keys() == set(keys)
            assert row == pytest.approx(dict(zip(keys, values, strict=True)))


def test_a_page_and_a_terminal_show_the_rankings_cell_by_cell():
    document = grading.document_of(ROWS, 3) | {"versions": {"beaver-ftc": "7.5", "numpy": "2.0"}}
    says, detectors, table, laws, other, versions = grading.parts_of(document)
    assert (says, versions) == ("3 hidden flights, the same for everybody.", "beaver-ftc 7.5, numpy 2.0")
    assert (detectors.text, laws.text) == ("Detectors", "Laws")
    assert table.head == [
        "", "student", "class", "score", "flights", "false alarms", "faults", "detected", "delay s, median",
        "named rightly", "reason",
    ]  # fmt: skip
    assert table.rows == [
        ["1", "ada", "Ears", "71.7", "3", "0", "2", "2", "1.75", "1", "-"],
        ["-", "built-in scheme", "-", "31.7", "3", "1", "2", "1", "0.5", "1", "-"],
        ["2", "eve", "-", "0.0", "0", "0", "0", "0", "-", "0", "ends"],
    ]
    assert other.head == [
        "", "student", "class", "score", "flights", "error/oracle's, median", "error deg/s, median",
        "aircraft lost", "reason",
    ]  # fmt: skip
    assert other.rows == [
        ["-", "built-in law", "-", "78.3", "3", "1.25", "0.4", "0", "-"],
        ["1", "cid", "Both", "48.5", "3", "2.2", "0.66", "1", "-"],
        ["2", "bob", "Hands", "41.7", "2", "1.67", "0.6", "0", "late, at 2 s"],
    ]
    said = [line.split() for line in grading.as_text(document).splitlines()]
    assert said == [
        ["3", "hidden", "flights;", "protections:", "calls,", "limits", "files"], [],
        ["detectors"], *(" ".join(row).split() for row in (table.head, *table.rows)), [],
        ["laws"], *(" ".join(row).split() for row in (other.head, *other.rows)),
    ]  # fmt: skip
    assert grading.as_text(document | {"walls": []}).startswith("3 hidden flights; protections: none\n")
    files = {name: make(document) for name, make in grading.FILES.items()}
    assert list(files) == ["grades.json", "grades.md", "grades.html"]
    assert json.loads(str(files["grades.json"])) == document
    assert "## Laws\n" in str(files["grades.md"])
    assert "<title>Grades</title>" in str(files["grades.html"])


class Started:
    """A submission that has been looked at, without a process; what it was started with and flown on."""

    def __init__(self, kind, fails=None):
        self.kind, self.class_name, self.walls = kind, "Mine", "limits files"
        self.fault_tolerant, self.fails, self.given, self.ended = kind == "fault-tolerant law", fails, [], 0

    def __call__(self, *given):
        self.given.append(given)
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ended += 1

    def look(self):
        if self.fails is not None:
            raise self.fails


@pytest.fixture
def stands(monkeypatch):
    """Let a class stand for the one of a submission; scenarios are words, a flight is what it was given."""

    def stand(first):
        for name in ("SubmittedCode", "SubmittedDetector", "SubmittedLaw"):
            monkeypatch.setattr(grading, name, first)
        monkeypatch.setattr(grading, "with_entry", lambda flight, entry: f"{flight} of {entry.law}")
        return first

    return stand


@pytest.mark.parametrize(
    ("kind", "law"),
    [("detector", "nominal"), ("law", LAW), ("fault-tolerant law", LAW)],
)
def test_a_detector_flies_with_the_nominal_law_and_a_law_with_the_diagnosis(stands, monkeypatch, kind, law):
    first = stands(Started(kind))
    plugged = Started("")
    monkeypatch.setattr(grading, "SubmittedDetector" if kind == "detector" else "SubmittedLaw", plugged)
    monkeypatch.setattr(grading, "_flown", lambda scenario, entry, **plugged: (scenario, entry, plugged))
    allowance = grading.Allowance()
    scenario, entry, given = grading.fly_submission(first, "text", "name.py", allowance, "autumn")
    assert (scenario, entry) == (f"autumn of {law}", Entry(SCHEME, law))
    assert given == {"detector" if kind == "detector" else "law": plugged}
    assert (plugged.given, plugged.ended) == ([("text", "name.py", allowance)], 1)
    assert plugged.fault_tolerant == (kind == "fault-tolerant law")


@pytest.mark.parametrize(
    ("student", "flies"),
    [
        ("built-in scheme", Entry(SCHEME, "nominal")),
        ("built-in law", Entry(SCHEME, LAW)),
        ("oracle", Entry(SCHEME, "oracle")),
    ],
)
def test_what_is_built_in_flies_every_flight_as_its_name_says(stands, monkeypatch, student, flies):
    stands(Started(""))
    monkeypatch.setattr(grading, "_flown", lambda *given: given)
    graded = grading.grade_case(student, ["autumn", "spring"])
    assert (graded.student, graded.kind, graded.reason, graded.barred) == (student, "", "", False)
    assert graded.results == [(f"{flight} of {flies.law}", flies) for flight in ("autumn", "spring")]


@pytest.mark.parametrize(
    ("ends", "results", "reason", "barred"),
    [
        ([SEEN, HEALTHY, SEEN], [SEEN, HEALTHY, SEEN], "", False),
        ([SEEN, SimulationFailed("<one>"), SimulationFailed("two")], [SEEN, None, None], "?one?", False),
        ([SimulationFailed("first"), SEEN, SEEN], [None, SEEN, SEEN], "first", False),
        ([SEEN, Barred("<ended>"), SEEN], [SEEN], "?ended?", True),
        ([SimulationFailed("first"), Barred("ended"), SEEN], [None], "ended", True),
    ],
)  # fmt: skip
def test_a_mistake_costs_its_flight_and_what_is_barred_flies_no_more(
    stands, monkeypatch, tmp_path, ends, results, reason, barred
):
    """The first mistake is told; one allowance holds for all flights."""
    first, left, allowances = stands(Started("detector")), list(ends), []

    def fly(of, source, name, allowance, flight):
        assert (of, source, name) == (first, "text", "ada-3.py")
        assert flight == ["winter", "autumn", "spring"][len(allowances)]
        allowances.append(allowance)
        end = left.pop(0)
        if isinstance(end, Exception):
            raise end
        return end

    monkeypatch.setattr(grading, "fly_submission", fly)
    (tmp_path / "ada-3.py").write_text("text")
    submission = folders.Submission("ada", tmp_path / "ada-3.py", "")
    graded = grading.grade_case(submission, ["winter", "autumn", "spring"])
    assert graded == grading.Graded("ada", "detector", "Mine", "limits files", reason, barred, results)
    assert {id(one) for one in allowances} == {id(first.given[0][2])}
    assert first.given[0][:2] == ("text", "ada-3.py")


def test_what_cannot_be_loaded_flies_nothing(stands, tmp_path):
    stands(Started("detector", fails=SimulationFailed("no class")))
    (tmp_path / "ada-3.py").write_text("text")
    graded = grading.grade_case(folders.Submission("ada", tmp_path / "ada-3.py", ""), ["autumn"])
    assert graded == grading.Graded("ada", reason="no class", barred=True)


@pytest.mark.parametrize(("kind", "points"), [("detector", 89.7), ("law", 75.5)])
def test_a_try_gives_the_points_of_the_practice_flight(stands, monkeypatch, kind, points):
    """1.03 s of 5 s late and named rightly; 0.4 / 0.53 of the oracle's error."""
    first = stands(Started(kind))
    result = replace(SEEN, delay_s=1.03, rms_deg_s=0.53)
    asked, oracle = [], []
    monkeypatch.setattr(folders, "practice", lambda: "practice")
    monkeypatch.setattr(grading, "fly_submission", lambda *given: asked.append(given) or result)
    monkeypatch.setattr(grading, "_flown", lambda *given: oracle.append(given) or SEEN)
    assert grading.tried("text", "name.py") == {
        "kind": kind, "class": "Mine", "walls": ["limits", "files"], "points": points,
    }  # fmt: skip
    allowance = first.given[0][2]
    assert asked == [(first, "text", "name.py", allowance, "practice")]
    assert oracle == ([] if kind == "detector" else [("practice of oracle", Entry(SCHEME, "oracle"))])
    first.fails = SimulationFailed("no class")
    with pytest.raises(BadInput) as refused:
        grading.tried("text", "name.py")
    assert str(refused.value) == "name.py: no class"


def test_a_course_flies_its_submissions_and_what_is_built_in(monkeypatch, tmp_path):
    handed_in = [folders.Submission(name, Path(f"{name}-1.py"), name) for name in ("ada", "bob")]
    given = []
    monkeypatch.setattr(folders, "hidden_flights", lambda challenge: ["winter", "autumn"])
    monkeypatch.setattr(folders, "submissions", lambda challenge: handed_in)
    monkeypatch.setattr(grading, "run_study", lambda *of: given.extend(of) or "document")
    assert grading.grade(tmp_path, 3, "progress") == "document"
    study, *rest = given
    assert (study.name, rest) == ("grades", [tmp_path, 3, "progress"])
    assert study.cases == [*handed_in, "built-in scheme", "built-in law", "oracle"]
    assert study.files is grading.FILES
    assert (study.fly.func, study.fly.keywords) == (grading.grade_case, {"flights": ["winter", "autumn"]})
    assert study.document(ROWS)["flights"] == 2
    assert study.row is grading.Graded
    assert study.lost(Case(4, handed_in[1]), "gone") == grading.Graded("bob", reason="gone", barred=True)
    assert study.follows_from == hashlib.sha256(b"['winter', 'autumn']").hexdigest()


def test_the_limits_that_students_are_told_are_all_there_are(monkeypatch):
    told = {"load_s": 10.0, "frame_s": 1.0, "all_s": 60.0, "kib": 64, "mib": 1024, "slow_s": 5.0}
    assert grading.rules() == told | {"quick": 50.0, "named": 50.0}
    monkeypatch.setattr(grading, "NAMED", 30.0)
    assert grading.rules() == told | {"quick": 70.0, "named": 30.0}
    assert grading.points_of_detector(SEEN) == pytest.approx(0.8 * 70.0 + 30.0)


def beaver(*asked):
    done = CliRunner().invoke(app, ["challenge", *map(str, asked)])
    assert done.exit_code == 0, done.exception
    return done.stdout


def test_what_the_commands_answer_is_said_in_full(monkeypatch, tmp_path):
    at = tmp_path / "autumn"
    assert beaver("new", at, "--flights", 5) == (
        f"{at}/public: for the students\n{at}/teacher: 5 hidden flights, for you alone\n"
        f"{at}/submissions: for `challenge submit FILE --student NAME --to {at}`\n"
    )
    asked = []
    found = {"kind": "law", "class": "Mine", "walls": ["limits"], "points": 66.7}
    monkeypatch.setattr(grading, "tried", lambda *given: asked.append(given) or found)
    (tmp_path / "mine.v2.py").write_text("text")
    (tmp_path / "mine.py").write_text("text")
    says = "law Mine: 66.7 points in one practice flight with a loss (a grade is the mean over all flights); "
    assert beaver("submit", tmp_path / "mine.py") == f"{says}not handed in: for that, add --to DIR\n"
    kept = at / "submissions" / "ada-1.py"
    assert beaver("submit", tmp_path / "mine.v2.py", "--student", "ada", "--to", at) == (
        f"{says}handed in as {kept}\n"
    )
    assert kept.read_text() == "text"
    assert json.loads(beaver("submit", tmp_path / "mine.py", "--to", at, "--format", "json")) == {
        "student": "mine", **found, "submitted": str(at / "submissions" / "mine-1.py"),
    }  # fmt: skip
    assert [name for _, name in asked] == ["mine.py", "mine.v2.py", "mine.py"]
    document = grading.document_of(ROWS, 3)
    graded = []
    monkeypatch.setattr(grading, "grade", lambda *given: graded.append(given) or document)
    said = beaver("grade", at, "--workers", 3)
    assert said == f"{grading.as_text(document)}\n\nresults: {at}/grades\n"
    assert json.loads(beaver("grade", at, "--format", "json")) == document | {"folder": f"{at}/grades"}
    assert graded[0][:2] == (at, 3)


@pytest.mark.parametrize(("flights", "healthy"), [(4, 1), (7, 1), (8, 2), (15, 3), (3, 1)])
def test_one_flight_in_four_has_no_fault(monkeypatch, tmp_path, flights, healthy):
    """The files of a challenge, and who may read them; each kind has a seed of its own."""
    seeds = iter([1111, 2222])
    monkeypatch.setattr(folders.secrets, "randbits", lambda bits: next(seeds) if bits == 63 else 0)
    at = tmp_path / "autumn"
    at.mkdir()  # empty
    folders.new(at, flights, grading.rules())
    files = {str(path.relative_to(at)): path.stat().st_mode & 0o777 for path in at.rglob("*")}
    assert [name for name, mode in files.items() if not mode & 0o077] == [
        "teacher", *(name for name in files if name.startswith("teacher/")),
    ]  # fmt: skip
    assert sorted(files) == [
        "public", "public/README.md", "public/detector.py", "public/law.py", "public/practice-healthy.yaml",
        "public/practice-loss.yaml", "public/practice.yaml", "submissions", "teacher", "teacher/healthy.yaml",
        "teacher/loss.yaml",
    ]  # fmt: skip
    found = re.compile(r"^name: (.*)\n(?:.*\n)*runs: (\d+)\nseed: (\d+)\n", re.M)
    said = {
        name: found.search((at / name).read_text()).groups() for name in files if "-" in name or "r/" in name
    }
    assert said == {
        "teacher/healthy.yaml": ("hidden-healthy", str(healthy), "1111"),
        "teacher/loss.yaml": ("hidden-loss", str(flights - healthy), "2222"),
        "public/practice-healthy.yaml": ("practice-healthy", "8", "1"),
        "public/practice-loss.yaml": ("practice-loss", "8", "1"),
    }


def test_the_practice_flight_is_the_one_handed_out_with_a_loss():
    flight = folders.practice()
    (fault,) = flight.faults
    assert (flight.name, flight.duration_s) == ("practice-loss", 20.0)
    assert (fault.actuator, fault.type, fault.magnitude, fault.at_s) == (
        "elevator", "loss_of_effectiveness", 0.4, 8.0,
    )  # fmt: skip
    handed_out = folders._public_files(grading.rules())["practice.yaml"]
    assert "fdi: {scheme: smoothed-surprise, bounds: {sensors: tactical-grade}}\n" in handed_out
    assert handed_out.replace("scheme: smoothed-surprise, ", "") == folders._base()


def test_a_number_that_is_taken_meanwhile_is_not_replaced(monkeypatch, tmp_path):
    """Two hand in at once: the second is kept under the next number, with its line ends."""
    folder = tmp_path / "submissions"
    folder.mkdir()
    (folder / "ada-1.py").write_text("first")
    monkeypatch.setattr(folders, "_numbered", lambda of: iter(()))
    assert folders.keep("a\r\nb\n", "ada", tmp_path) == folder / "ada-2.py"
    assert (folder / "ada-2.py").read_bytes() == b"a\r\nb\n"
    assert (folder / "ada-1.py").read_text() == "first"


def test_a_submission_is_told_by_its_text_and_a_name_by_its_letters(tmp_path):
    folder = tmp_path / "submissions"
    folder.mkdir()
    longest = "a" * 40
    for name, text in (("ada-1", "one"), ("bob-2", "one"), ("cid-1", "other"), (f"{longest}-999999", "x")):
        (folder / f"{name}.py").write_text(text)
    for none in ("ada-01", "bob-0", "cid-1000000", f"{longest}a-1", "é-1", "a b-1"):
        (folder / f"{none}.py").write_text("none")
    (folder / "dan-1.py").symlink_to(folder / "ada-1.py")
    found = folders.submissions(tmp_path)
    assert [one.student for one in found] == [longest, "ada", "bob", "cid", "dan"]
    assert [one.digest for one in found] == [
        hashlib.sha256(text).hexdigest() for text in (b"x", b"one", b"one", b"other", b"")
    ]
    assert folders.check_student(longest) == longest
    for name in (f"{longest}a", "", "é", "a.b"):
        with pytest.raises(BadInput) as refused:
            folders.check_student(name)
        assert str(refused.value) == (
            f"challenge submit: --student {name!r}, allowed: letters, digits, - and _, at most 40"
        )


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


def test_flights_of_every_hidden_file_are_flown_in_the_order_of_their_names(monkeypatch, tmp_path):
    from beaver_ftc.studies import compare

    (tmp_path / "teacher").mkdir(mode=0o700)
    for name in ("winter.yaml", "autumn.yaml", "notes.txt"):
        (tmp_path / "teacher" / name).touch(0o600)
    monkeypatch.setattr(
        compare, "of_sweep", lambda path: [SimpleNamespace(scenario=f"{path.stem} {n}") for n in (1, 2)]
    )
    assert folders.hidden_flights(tmp_path) == ["autumn 1", "autumn 2", "winter 1", "winter 2"]
    (tmp_path / "elsewhere").touch()
    with pytest.raises(BadInput, match="elsewhere exists, allowed: a new folder, or an empty one"):
        folders.new(tmp_path / "elsewhere", 4, grading.rules())
