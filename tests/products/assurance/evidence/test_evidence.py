"""A plan flown: what is violated is found, in the flight it is in; and the document is the same twice."""

import json
import re

import pytest
import yaml

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.present.page import contents
from beaver_ftc.studies.sweep import one_flight
from beaver_ftc_assurance.evidence import shown
from beaver_ftc_assurance.evidence.flown import MET, NOT_MET, NOT_SHOWN, fly_flight
from beaver_ftc_assurance.evidence.judged import document_of
from beaver_ftc_assurance.evidence.plan import load_plan
from beaver_ftc_assurance.evidence.shown import FILES, of_flight, run_plan
from samples import AT_NIGHT

from .plans import FAULTY, HEALTHY, seeded


def plan_of(tmp_path, **content):
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump({"name": "small", **content}, sort_keys=False))
    return load_plan(str(path))


def judged(plan, date="today"):
    return document_of(plan, [fly_flight(plan, case) for case in plan.cases], date)


def test_every_seeded_violation_is_traced_to_requirement_and_flight(tmp_path):
    count = 60 if AT_NIGHT else 24
    content, violated = seeded(count, 37)
    document = judged(plan_of(tmp_path, **content))
    assert sum(flight is not None for flight in violated.values()) >= 0.75 * count
    for each in document["requirements"]:
        flight = violated[each["id"]]
        assert each["verdict"] == (NOT_MET if flight else MET), each
        if flight:
            assert each["worst"]["flight"] == flight
            assert [one["flight"] for one in each["failing"]] == [flight]
            assert each["worst"]["command"].endswith(f"plan.yaml --replay {flight}")
            assert each["margin"] is None or each["margin"] < 0
    assert document["passed"] is False


def test_a_replayed_flight_says_what_it_violates(tmp_path):
    content, violated = seeded(8, 3)
    plan = plan_of(tmp_path, **content)
    for flight in filter(None, violated.values()):
        if flight.startswith("f"):
            scenario, judged = of_flight(plan, flight)
            assert scenario.name == flight
            assert any(not each.passed and each.actual.startswith("not met: ") for each in judged)
    with pytest.raises(BadInput, match=r"--replay: .*plan.yaml has no flight 'f0-9', did you mean f0-"):
        of_flight(plan, "f0-9")


HARD = {"actuator": "rudder", "type": "hardover", "at_s": 0.5}
SMALL = {
    "flights": {
        "healthy": {**HEALTHY, "duration_s": 0.5},
        "lost": {"base": FAULTY, "vary": {"faults[0].magnitude": {"choice": [0.5, 0.9]}}, "sampling": "grid"},
    },
    "requirements": [
        {"id": "A", "text": "Alarms.", "clause": "Ours.", "over": ["lost"],
         "expect": {"detected_within_s": 0.5, "no_departure": True}},
        {"id": "B", "over": ["healthy", "lost"], "formula": "always[0:0.4](abs(q_rad_s) <= 0.001)"},
        {"id": "C", "over": ["lost"],
         "bar": {"type": "sweep", "detection_rate": {"at_least": 0.9, "confidence": 0.95}}},
    ],
}  # fmt: skip


def test_two_runs_of_a_plan_differ_in_nothing_but_the_date(tmp_path, monkeypatch, changed):
    monkeypatch.setattr(shown, "datetime", Clock)
    monkeypatch.chdir(tmp_path)
    plan_of(tmp_path, **SMALL)
    plan = load_plan("plan.yaml")
    texts = []
    for folder, Clock.now_is in ("one", "2026-01-02 03:04 UTC"), ("two", "2030-12-31 23:59 UTC"):
        document = run_plan(plan, tmp_path / folder)
        made = {path.name: path.read_bytes() for path in (tmp_path / folder).iterdir()}
        assert sorted(made) == ["evidence.html", "evidence.json", "evidence.pdf"]
        assert json.loads(made["evidence.json"]) == document
        assert made["evidence.pdf"] == FILES["evidence.pdf"](document)
        texts.append([made[name].decode().replace(Clock.now_is, "WHEN") for name in sorted(made)[:2]])
        assert all(Clock.now_is not in text and "WHEN" in text for text in texts[-1])
    assert texts[0] == texts[1]
    for machine in (document["hashes"], document["versions"]):
        machine.update(dict.fromkeys(machine, "theirs"))
    assert [each["verdict"] for each in document["requirements"]] == [MET, NOT_MET, NOT_SHOWN]
    for each in document["flights"]:
        assert len(each.pop("log")) == len(each.pop("scenario")) == 64
    assert not changed(document)


class Clock:
    """Says what time it is told."""

    now_is = ""

    @classmethod
    def now(cls, zone):
        return cls()

    def strftime(self, _):
        return self.now_is


def test_a_flight_that_cannot_be_flown_shows_nothing(tmp_path, monkeypatch):
    def broken(*_):
        raise RuntimeError("out of order")

    plan = plan_of(tmp_path, **SMALL)
    monkeypatch.setattr("beaver_ftc.loop.loop.fly", broken)
    document = judged(plan)
    assert document["counts"] == {MET: 0, NOT_MET: 0, NOT_SHOWN: 3}
    assert {each["status"] for each in document["flights"]} == {one_flight.FAILED}
    assert document["requirements"][0]["worst"]["says"] == "RuntimeError: out of order"
    assert document["coverage"][0]["combinations"] == 0


def test_a_lost_aircraft_shows_nothing_beyond_its_loss(tmp_path):
    hard = {**HEALTHY, "duration_s": 6, "faults": [{**HARD, "direction": 1}]}
    plan = plan_of(
        tmp_path,
        flights={"hard": hard},
        requirements=[
            {"id": "A", "over": ["hard"], "formula": "always(altitude_m >= 0)"},
            {"id": "B", "over": ["hard"], "formula": "always[0:1](altitude_m >= 0)"},
            {"id": "C", "over": ["hard"], "bar": {"type": "handling_qualities", "level": 3}},
            {"id": "D", "over": ["hard"], "formula": "always[0:1](0 / (q_rad_s - q_rad_s) >= 0)"},
        ],
    )
    row = fly_flight(plan, plan.cases[0])
    found = {each["id"]: each for each in document_of(plan, [row], "today")["requirements"]}
    assert re.fullmatch(r"lost: \w+ at \d\.\d+ s", row["why"])
    assert 0.5 < float(row["why"].split()[-2]) < 6.0
    assert {id: each["verdict"] for id, each in found.items()} == {
        "A": NOT_SHOWN,
        "B": MET,
        "C": NOT_SHOWN,
        "D": NOT_SHOWN,
    }
    assert found["A"]["worst"]["says"].startswith("the aircraft was lost at ")
    assert found["C"]["worst"]["says"] == "the aircraft was lost"
    assert found["D"]["worst"]["says"] == "a column is not a number where it asks"


def test_the_plan_of_a_stranger_is_text_in_page_and_paper(tmp_path):
    text = '<script>alert(1)</script> <font color="[[[getattr(pow,1)]]]">x</font> <para>&amp;'
    plan = plan_of(
        tmp_path,
        description=text,
        flights={"healthy": {**HEALTHY, "duration_s": 0.1}},
        requirements=[
            {"id": "A", "text": text, "clause": text, "over": ["healthy"], "expect": {"no_departure": True}}
        ],
    )
    made = contents(FILES, judged(plan))
    assert "<script>" not in made["evidence.html"]
    assert "&lt;script&gt;" in made["evidence.html"]
    assert made["evidence.pdf"].startswith(b"%PDF")
