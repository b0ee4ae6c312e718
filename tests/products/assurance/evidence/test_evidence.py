"""A plan flown: what is violated is found, in the flight it is in; and the document is the same twice."""

import json
import re
from math import inf, nan
from types import SimpleNamespace

import pytest
import yaml
from reportlab.pdfbase.pdfmetrics import getAscentDescent
from reportlab.pdfgen.canvas import Canvas

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Metrics
from beaver_ftc.studies.margins import Margin
from beaver_ftc.studies.present.page import Heading, contents
from beaver_ftc.studies.sweep import one_flight
from beaver_ftc_assurance.evidence import flown, paper, shown
from beaver_ftc_assurance.evidence import judged as judged_module
from beaver_ftc_assurance.evidence.flown import MET, NOT_MET, NOT_SHOWN, fly_flight
from beaver_ftc_assurance.evidence.judged import document_of
from beaver_ftc_assurance.evidence.paper import as_pdf
from beaver_ftc_assurance.evidence.plan import OfMargins, load_plan
from beaver_ftc_assurance.evidence.shown import FILES, as_text, of_flight, page, run_plan
from samples import AT_NIGHT
from telling import apart

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
    assert not changed(as_text(document, "FOLDER").splitlines(), "text")
    document["sources"][0]["given"] = "beside/healthy.yaml"
    assert not changed(list(page(document)), "page")


def test_every_sheet_of_the_paper_has_its_foot_and_its_number(monkeypatch):
    drawn = []
    for where in ("drawString", "drawRightString"):
        monkeypatch.setattr(Canvas, where, lambda self, x, y, text: drawn.append(text))
    as_pdf("Title", ["Summary.", Heading("One"), *(f"Line {n}." for n in range(90))], "the foot")
    sheets = len(drawn) // 2
    assert sheets > 2
    assert drawn == [text for n in range(1, sheets + 1) for text in ("the foot", str(n))]


def test_lines_of_the_paper_neither_overlap_nor_stand_half_a_line_apart():
    paper._register()
    paragraph = paper._text("word " * 200, 10.0)
    _, height = paragraph.wrap(300.0, 1e4)
    ascent, descent = getAscentDescent("Body", 10.0)
    assert 1.0 < height / len(paragraph.blPara.lines) / (ascent - descent) < 1.5


@pytest.mark.parametrize(
    ("robustness", "lost_at_s", "verdict"),
    [
        (0.0, None, MET),
        (-1e-9, None, NOT_MET),
        (0.0, 3.0, MET),
        (0.0, 2.9, NOT_SHOWN),
        (-1e-9, 2.9, NOT_MET),
        (inf, None, NOT_SHOWN),
        (nan, None, NOT_SHOWN),
    ],
)
def test_a_formula_is_met_from_zero_on_where_the_flight_lasted_as_far_as_it_looks(
    robustness, lost_at_s, verdict
):
    formula = SimpleNamespace(robustness=lambda columns, rate_hz: robustness, looks_ahead_s=3.0)
    amounts = Metrics.of({"departure": lost_at_s and {"time_s": lost_at_s}})
    found = flown._of_formula("text", formula, 100.0, amounts, SimpleNamespace(columns={}))
    assert found["verdict"] == verdict


class Clock:
    """Says what time it is told."""

    now_is = ""

    @classmethod
    def now(cls, zone):
        return cls()

    def strftime(self, _):
        return self.now_is


def test_what_has_been_flown_is_kept_of_this_plan_and_these_files(tmp_path, monkeypatch):
    asked, mine = [], tmp_path / "mine.yaml"
    monkeypatch.setattr(shown, "run_study", lambda study, *_: asked.append(study.follows_from))
    for duration_s, text in ((2, "Ours."), (2, "Ours."), (3, "Ours."), (2, "Theirs.")):
        mine.write_text(f"name: mine\nduration_s: {duration_s}\n")
        content = {"id": "A", "text": text, "over": ["mine.yaml"], "expect": {"no_departure": True}}
        run_plan(plan_of(tmp_path, requirements=[content]), tmp_path / "out")
    assert asked[0] == asked[1]
    assert asked[2] != asked[0] != asked[3]


def test_the_table_of_what_was_flown_has_a_dot_for_no_flight():
    cells = [
        {"airspeed_mps": [30, 40.4], "altitude_m": ends}
        for ends in ([None, 1000], [1000, 2500], [2500, None])
    ]
    flown = [{"surface": "rudder", "type": "rate_limit", "flights": [0, 12, 0]}]
    never = [["aileron", "stuck"], ["aileron", "float"], ["flap", "loss_of_effectiveness"]]
    each = {"aircraft": "beaver", "combinations": 1, "of": 9, "cells": cells, "flown": flown, "never": never}
    said, table, missing = shown._coverage(each)
    assert said.startswith("beaver: 1 of 9 combinations of surface, fault type and cell of the envelope")
    ends = ("below 1 km", "1 to 2.5 km", "above 2.5 km")
    assert list(table.head) == ["surface", "fault", *(f"30 to 40 m/s, {end}" for end in ends)]
    assert [list(row) for row in table.rows] == [["rudder", "rate limit", "·", "12", "·"]]
    assert missing == "Never flown: aileron: stuck, float; flap: loss of effectiveness."
    assert len([*shown._coverage(each | {"never": []})]) == 2


def test_the_worker_count_changes_nothing(tmp_path):
    plan = plan_of(tmp_path, **SMALL)
    one, two = (run_plan(plan, tmp_path / f"{n}", n) for n in (1, 2))
    assert {**one, "date": 0} == {**two, "date": 0}


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


@pytest.mark.parametrize(("changes", "words"), [
    ({}, "detection rate: 0.25, asked 0 (in 3 of 12)"),
    ({"expected": None, "says": ""}, "detection rate: 0.25"),
    ({"name": "robustness"}, "robustness 0.25 in 3 of 12"),
    ({"name": "robustness", "says": ""}, "robustness 0.25"),
])  # fmt: skip
def test_the_worst_of_a_requirement_in_words(changes, words):
    """A bound of 0 is a bound."""
    worst = {"name": "detection_rate", "actual": 0.25, "expected": 0.0, "says": "in 3 of 12"} | changes
    assert shown._found(worst) == words


def test_a_study_that_has_nothing_to_say_shows_nothing_and_the_flight_the_rest(tmp_path):
    asked = [
        {"id": "A", "over": ["other"], "bar": {"type": "margins"}},
        {"id": "B", "over": ["other"], "expect": {"no_departure": True}},
    ]
    plan = plan_of(
        tmp_path, flights={"other": {**HEALTHY, "control": {"law": "nominal"}}}, requirements=asked
    )
    margins, kept = judged(plan)["requirements"]
    assert (margins["verdict"], kept["verdict"]) == (NOT_SHOWN, MET)
    assert "margins are known of the default law's loop" in margins["worst"]["says"]


def test_what_is_covered(tmp_path):
    flights = {
        "low": {**FAULTY, "initial": {"airspeed_mps": 33, "altitude_m": 500}},
        "fast": {**FAULTY, "initial": {"airspeed_mps": 52, "altitude_m": 2500}},
        "healthy": HEALTHY,
    }
    asked = [{"id": "A", "over": list(flights), "expect": {"no_departure": True}}]
    (coverage,) = judged(plan_of(tmp_path, flights=flights, requirements=asked))["coverage"]
    by = {(one["surface"], one["type"]): one["flights"] for one in coverage["flown"]}
    assert by == {
        ("elevator", "loss_of_effectiveness"): [1, 0, 0, 0, 0, 0, 0, 0, 1],
        ("none", "none"): [0, 0, 0, 0, 1, 0, 0, 0, 0],
    }
    assert (coverage["combinations"], coverage["of"]) == (2, 4 * 7 * 9)
    assert ["rudder", "stuck"] in coverage["never"]
    assert ["elevator", "loss_of_effectiveness"] not in coverage["never"]
    assert coverage["cells"][8]["airspeed_mps"] == pytest.approx([55 - 25 / 3, 55])


def test_of_many_requirements_the_summary_has_those_that_are_not_met_first(tmp_path):
    content, _ = seeded(3, 1)
    document = judged(plan_of(tmp_path, **content))
    met = {**document["requirements"][0], "verdict": MET}
    document["requirements"] = [met] * 30 + [{**met, "id": "LAST", "verdict": NOT_MET}]
    table = next(part for part in page(document) if isinstance(part, shown.Table))
    assert table.rows[0][0] == "LAST"
    assert (len(table.rows), table.rows[-1][1]) == (shown.ON_THE_SUMMARY + 1, "7 more")
    for more, last in ((0, met["text"]), (1, "1 more")):
        document["requirements"] = [met] * (shown.ON_THE_SUMMARY + more)
        table = next(part for part in page(document) if isinstance(part, shown.Table))
        assert (len(table.rows), table.rows[-1][1]) == (shown.ON_THE_SUMMARY + more, last)


@pytest.mark.parametrize(
    ("failing", "more"), [(1, None), (2, ""), (shown.MOST_SHOWN, ""), (shown.MOST_SHOWN + 1, " and 1 more")]
)
@pytest.mark.parametrize(("letters", "left"), [(shown.MOST_LETTERS, 90), (shown.MOST_LETTERS + 1, 87)])
def test_long_texts_and_many_flights_are_cut_and_counted(tmp_path, failing, more, letters, left):
    content, _ = seeded(1, 1)
    document = judged(plan_of(tmp_path, **content))
    flights = [f"flight {n}" for n in range(failing)]
    each = document["requirements"][0]
    each |= {"text": "x" * letters, "failing": [{"flight": name} for name in flights]}
    summary, requirement = [part for part in page(document) if isinstance(part, shown.Table)][:2]
    assert summary.rows[0][1] == "x" * left + "..." * (letters > left)
    assert requirement.head[1] == "x" * letters
    said = dict(requirement.rows).get("do not meet it")
    assert said == (None if more is None else ", ".join(flights[: shown.MOST_SHOWN]) + more)


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


def test_without_what_writes_pdf_nothing_flies(tmp_path, monkeypatch):
    plan = plan_of(tmp_path, **SMALL)
    monkeypatch.setattr(shown, "find_spec", lambda name: None)
    with pytest.raises(BadInput, match=r"allowed: pip install 'beaver-ftc\[evidence\]'"):
        run_plan(plan, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("gain_db", "phase_deg", "verdicts", "least"),
    [(4.0, 41.0, [MET, NOT_MET], (4.5, 40.0)), (5.0, 39.0, [NOT_MET, MET], (4.5, 40.0))],
)
def test_of_a_loops_margins_the_smaller_counts_upwards_and_downwards(
    monkeypatch, gain_db, phase_deg, verdicts, least
):
    loops = [
        Margin(45.0, "none", "aileron", up_db=7.0, down_db=9.0, phase_deg=62.0),
        Margin(45.0, "40 % loss", "elevator", up_db=8.0, down_db=4.5, phase_deg=51.0),
        Margin(45.0, "total loss", "rudder", up_db=5.5, down_db=6.0, phase_deg=40.0),
    ]
    apart(margins=[[each.up_db, each.down_db, each.phase_deg] for each in loops])
    monkeypatch.setattr("beaver_ftc.studies.margins.at", lambda scenario: iter(loops))
    asked = OfMargins(type="margins", gain_db=gain_db, phase_deg=phase_deg)
    gain, phase = flown._of_margins(asked, bf.load({"name": "any"}))
    assert [gain["verdict"], phase["verdict"]] == verdicts
    assert (gain["actual"], phase["actual"]) == least
    assert (gain["margin"], phase["margin"]) == pytest.approx((least[0] - gain_db, least[1] - phase_deg))
    assert (gain["says"], phase["says"]) == ("fault: 40 % loss", "fault: total loss")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([], "none"), (["a", 1.5], "a, 1.5"), ({"at_least": 2.5, "by_day": True}, "at least 2.5, by day yes"),
        ([True, None, {"at": 2}], "yes, none, at 2"), (False, "no"), (None, "none"), ("text", "text"),
    ],
)  # fmt: skip
def test_what_was_asked_and_found_in_words(value, words):
    assert shown.said(value) == words


@pytest.mark.parametrize(
    ("value", "words"),
    [(999.4, "+999"), (1000.0, "+1000"), (-12345.6, "-12346"), (0.0, "+0"), (-0.25, "-0.25")],
)
def test_a_margin_has_its_sign(value, words):
    assert shown.signed(value) == words


@pytest.mark.parametrize(
    ("passed", "of", "plain", "verdict"),
    [
        (True, 9, True, MET),
        (False, 9, True, NOT_SHOWN),
        (False, 0, False, NOT_SHOWN),
        (False, 9, False, NOT_MET),
    ],
)
@pytest.mark.parametrize(
    ("asked", "actual", "inside"),
    [({"at_least": 0.75}, 0.5, -0.25), ({"at_most": 0.75}, 0.5, 0.25), ({"at_most": 0.75}, None, None)],
)
def test_a_statistic_beside_its_bar(passed, of, plain, verdict, asked, actual, inside):
    found = {"name": "rate", "passed": passed, "of": of, "expected": asked, "actual": actual}
    assert judged_module._of_bound(found, {"passed": plain}) == {
        "name": "rate", "expected": asked, "actual": actual, "verdict": verdict, "margin": inside,
        "says": f"{of} flights tell",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("verdict", "margin", "expected", "rank"),
    [
        (NOT_MET, None, 5.0, (0, -inf)), (NOT_SHOWN, None, 5.0, (1, inf)), (MET, None, 5.0, (2, inf)),
        (MET, 2.0, -4, (2, 0.5)), (MET, 2.0, 0, (2, 2.0)), (MET, 2.0, True, (2, 2.0)),
        (MET, 2.0, "x", (2, 2.0)),
        (NOT_MET, -3.0, {"at_least": -6.0, "at_most": 12.0}, (0, -0.5)),
        (MET, 3.0, {"at_least": 0.0, "at_most": 12.0}, (2, 0.25)), (MET, 3.0, {"level": 2}, (2, 3.0)),
    ],
)  # fmt: skip
def test_the_worst_is_by_verdict_then_by_margin_over_the_limit(verdict, margin, expected, rank):
    assert judged_module._rank({"verdict": verdict, "margin": margin, "expected": expected}) == rank


@pytest.mark.parametrize(("error", "status", "why"), [
    (bf.BadInput("no trim"), "bad_input", "no trim"),
    (bf.SimulationFailed("not finite"), "failed", "not finite"),
    (ZeroDivisionError("by a plug-in"), "failed", "ZeroDivisionError: by a plug-in"),
])  # fmt: skip
def test_a_flight_that_fails_says_how(tmp_path, monkeypatch, error, status, why):
    plan = plan_of(
        tmp_path,
        flights={"one": HEALTHY, "other": FAULTY},
        requirements=[{"id": "A", "over": ["one", "other"], "formula": "always(altitude_m >= 0)"}],
    )

    def fails(*of):
        raise error

    monkeypatch.setattr(flown, "_flown", fails)
    row = fly_flight(plan, plan.cases[1])
    assert (row["flight"], row["status"], row["why"]) == ("other", status, why)
    assert [each["verdict"] for each in row["found"]["A"]] == [NOT_SHOWN]


@pytest.mark.parametrize("faults", [(), ("a fault",)])
def test_handling_is_held_against_each_limit_of_its_level(monkeypatch, faults):
    """Where a flight with a fault ended, or where one without is trimmed; ends that are none are left out."""
    limits = [
        SimpleNamespace(
            mode=mode,
            quantity="damping",
            levels=((9.0, 9.5), levels),
            margin=lambda value, level: value - level,
        )
        for mode, levels in (("roll", (0.2, inf)), ("spiral", (-inf, 0.7)))
    ]
    qualities = [SimpleNamespace(value=2.5, level=2), SimpleNamespace(value=inf, level=4)]
    monkeypatch.setattr(bf.studies, "HANDLING_LIMITS", limits, raising=False)
    monkeypatch.setattr(
        bf.studies, "where_ended", lambda scenario, end: faults and end == "end" and qualities
    )
    monkeypatch.setattr(bf.studies, "where_trimmed", lambda scenario: None if faults else qualities)
    asked = SimpleNamespace(bar=SimpleNamespace(level=2), scenario=SimpleNamespace(faults=faults))
    found = flown._of_handling(
        asked.bar, asked.scenario, SimpleNamespace(departure=None), SimpleNamespace(end="end")
    )
    assert [tuple(row.values()) for row in found] == [
        ("roll damping", {"at_least": 0.2, "level": 2}, 2.5, MET, 0.5, "level 2"),
        ("spiral damping", {"at_most": 0.7, "level": 2}, None, NOT_MET, None, "no level"),
    ]
    (lost,) = flown._of_handling(asked.bar, asked.scenario, SimpleNamespace(departure="x"), None)
    assert (lost["verdict"], lost["says"]) == (NOT_SHOWN, "the aircraft was lost")
