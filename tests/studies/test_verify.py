"""Verification campaigns: what is drawn, that it does not depend on who flies it, and how it is counted."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.commands import Reporter
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies import verify
from beaver_ftc.studies.random_flights import Draw
from beaver_ftc.studies.verify import PROMISES, Verify, summarise, summary_text
from samples import samples


def conduct(folder, workers=1, **asked):
    asked = {"hours": 0.1, "faults": 6, "seed": 4, **asked}
    return Verify(**asked, workers=workers, out=folder).run(Reporter())


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    return conduct(tmp_path_factory.mktemp("campaign"))


@settings(max_examples=samples(60), deadline=None)
@given(st.integers(0, 2**40), st.integers(0, 10**7), st.sampled_from(["healthy", "faulty"]))
def test_every_draw_is_admissible(seed, index, kind):
    scenario = Draw(seed, kind, index).scenario()
    bounds = scenario.fdi.bounds
    for axis in "pqr":
        declared = getattr(bounds.inertia_coupling, axis), getattr(bounds.constant_rad_s2, axis)
        assert abs(getattr(scenario.uncertainty.inertia_coupling, axis)) <= declared[0]
        assert getattr(scenario.uncertainty.sinusoid, axis).amplitude_rad_s2 <= declared[1]
    assert 35 <= scenario.initial.airspeed_mps <= 52
    assert 0 <= scenario.initial.altitude_m <= 3000
    assert [0.05 <= fault.magnitude <= 1 for fault in scenario.faults] == [True] * (kind == "faulty")


def test_a_draw_depends_on_seed_kind_and_index_alone():
    assert Draw(1, "faulty", 5).scenario() == Draw(1, "faulty", 5).scenario()
    others = [Draw(2, "faulty", 5), Draw(1, "healthy", 5), Draw(1, "faulty", 6)]
    assert all(other.scenario().initial != Draw(1, "faulty", 5).scenario().initial for other in others)


def test_rows_do_not_depend_on_the_workers(flown, tmp_path, monkeypatch):
    monkeypatch.setattr(verify, "TOGETHER", 2)
    assert conduct(tmp_path, workers=2) == flown
    assert json.loads((tmp_path / "verification" / "verify.json").read_text()) == flown


def test_a_campaign_without_flights_is_refused(tmp_path):
    with pytest.raises(BadInput, match="nothing to fly"):
        conduct(tmp_path, hours=0, faults=0)


def test_each_step_flies_the_same_faults(tmp_path):
    steps = conduct(tmp_path, hours=0, faults=4, steps=True)["schemes"]
    delays = [
        steps[step]["delay_s"] for step in ("published", "interval", "pole bank", "memory", "sharpened")
    ]
    assert delays[0] == delays[1]
    assert delays[2] == delays[3] == delays[4]
    assert all(delays[1][which] >= delays[2][which] for which in ("median", "p90"))


def test_the_promises_hold_in_the_small(flown):
    document = flown
    assert document["kept"]
    assert document["healthy"]["hours"] == pytest.approx(4 * 100 / 3600)
    assert document["schemes"]["sharpened"]["detected"] == 6
    closest = document["healthy"]["closest_approach"]
    assert closest["published"] <= closest["sharpened"] < 1
    assert "G1 to G3 hold" in summary_text(document)


def test_only_what_is_flown_is_said_to_hold():
    assert "G1 to G3 hold" in summary_text(
        summarise({"healthy": [], "faulty": [_faulty_row(delay_s=0.0, guaranteed_s=0.0)]})
    )
    assert "Nothing is tested" in summary_text(summarise({"healthy": [], "faulty": []}))


def _faulty_row(**sharpened):
    well = {
        "delay_s": 0.1, "false_alarm": False, "guaranteed_s": 0.2, "late": False, "isolation_delay_s": 0.2,
        "excluded": False, "wrong": False, "estimate_error": 0.01,
    }  # fmt: skip
    return {"index": 0, "published": well, "sharpened": {**well, **sharpened}}


@pytest.mark.parametrize("broken", ["false_alarm", "late", "excluded", "wrong"])
def test_any_broken_promise_is_counted_and_said(broken):
    document = summarise({"healthy": [], "faulty": [_faulty_row(**{broken: True})]})
    assert not document["kept"]
    assert sum(document["schemes"]["sharpened"][promise] for promise in PROMISES) == 1
    assert "A GUARANTEE IS VIOLATED" in summary_text(document)


def test_a_false_alarm_in_healthy_flight_is_counted_per_hour():
    row = {
        "index": 0,
        "watched_s": 1800.0,
        "alarm": True,
        "departed": False,
        "outside_s": 0.0,
        "closest": {"published": 1.2, "sharpened": 1.3},
    }
    healthy = summarise({"healthy": [row] * 2, "faulty": []})["healthy"]
    assert healthy["false_alarms_per_hour"] == 2.0
    assert not summarise({"healthy": [row], "faulty": []})["kept"]
