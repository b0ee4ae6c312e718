"""Grades from results made by hand: who flies against what, the points, and every cell of both rankings."""

from dataclasses import replace
from math import inf

import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.studies.compare.trial import Entry, Result
from beaver_ftc_live.challenge import folders, grading
from beaver_ftc_live.challenge.line import Barred

SCHEME, LAW = "adaptive-estimators", "fault-tolerant"
SEEN = Result(Entry(SCHEME, "nominal"), False, 8.0, True, delay_s=1.0, correct=True, rms_deg_s=0.4)
HEALTHY = replace(SEEN, faulted=False, delay_s=inf, correct=False)


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
