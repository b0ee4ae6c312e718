"""Verification campaigns: what is drawn, that it does not depend on who flies it, and how it is counted."""

from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, poisson

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies import verify
from beaver_ftc.studies.engine.statistics import binomial_upper, poisson_bound
from beaver_ftc.studies.verify import PROMISES, Campaign, Draw, conduct, summarise, summary_text
from samples import samples

SMALL = Campaign(hours=0.1, faults=6, seed=4)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    return conduct(SMALL, folder, workers=1), folder


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
    monkeypatch.setattr(verify, "CHUNK", 2)
    assert conduct(SMALL, tmp_path, workers=2) == flown[0]


def test_a_stopped_campaign_goes_on_and_a_longer_one_builds_on_it(flown, tmp_path, monkeypatch):
    monkeypatch.setattr(verify, "CHUNK", 2)
    conduct(Campaign(hours=0.0, faults=3, seed=4), tmp_path, workers=1)
    kept = {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("faulty-*.json")}
    progress = []
    assert conduct(SMALL, tmp_path, 1, progress.append) == flown[0]
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in kept} == kept
    assert progress == sorted(progress)
    assert progress[-1] == 1.0


def test_a_chunk_half_written_is_flown_again(flown, tmp_path):
    (tmp_path / ".faulty-0000000-0000001.json.7").write_text('[{"index": 0, "del')
    (tmp_path / "faulty-0000000-0000001.json").write_text('[{"index": 0, "del')
    assert conduct(SMALL, tmp_path, workers=1) == flown[0]


def test_another_seeds_folder_is_refused(flown):
    with pytest.raises(BadInput, match="another seed"):
        conduct(Campaign(hours=0, faults=1, seed=5), flown[1], workers=1)


def test_each_step_flies_the_same_faults(tmp_path):
    rows = conduct(Campaign(hours=0, faults=4, seed=4, steps=True), tmp_path, workers=1)["faulty"]
    for row in rows:
        delays = [
            row[step]["delay_s"] for step in ("published", "interval", "pole bank", "memory", "sharpened")
        ]
        assert delays[0] == delays[1] >= delays[2] == delays[3] == delays[4]
        if row["profile"] == "incipient":
            assert row["constant"] == row["sharpened"]


def test_the_promises_hold_in_the_small(flown):
    document = summarise(flown[0])
    assert document["kept"]
    assert document["healthy"]["hours"] == pytest.approx(4 * 100 / 3600)
    assert document["schemes"]["sharpened"]["detected"] == 6
    assert "G1 to G3 hold" in summary_text(document)


def _faulty_row(**sharpened):
    well = {
        "delay_s": 0.1, "false_alarm": False, "guaranteed_s": 0.2, "late": False, "isolation_s": 0.2,
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
        "closest": [1.2, 1.3],
    }
    healthy = summarise({"healthy": [row] * 2, "faulty": []})["healthy"]
    assert healthy["false_alarms_per_hour"] == 2.0
    assert not summarise({"healthy": [row], "faulty": []})["kept"]


@given(st.integers(0, 40), st.integers(0, 200), st.floats(0.5, 0.999))
def test_at_the_limit_so_few_events_have_just_the_stated_chance(events, more, confidence):
    limit = poisson_bound(events, 1.0, confidence, upper=True)
    assert poisson.cdf(events, limit) == pytest.approx(1 - confidence, rel=1e-6)
    if more:
        limit = binomial_upper(events, events + more, confidence)
        assert binom.cdf(events, events + more, limit) == pytest.approx(1 - confidence, rel=1e-6)
    assert exp(-limit) < 1
