"""Verification campaigns: what is drawn, that it does not depend on who flies it, and how it is counted."""

from math import exp, log

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


def test_draws_reach_the_declared_bounds_and_both_profiles():
    drawn = [Draw(3, "faulty", i).scenario() for i in range(60)]
    assert {scenario.faults[0].actuator for scenario in drawn} == {"aileron", "elevator", "rudder"}
    assert {scenario.faults[0].profile for scenario in drawn} == {"abrupt", "incipient"}
    assert any(scenario.uncertainty.sinusoid.q.amplitude_rad_s2 == 0.02 for scenario in drawn)
    assert any(scenario.substeps > 1 for scenario in drawn)


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


def test_nothing_left_to_fly_flies_nothing(flown, monkeypatch):
    rows, folder = flown
    monkeypatch.setattr(verify, "fly_draw", pytest.fail)
    assert conduct(SMALL, folder, workers=1) == rows


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


def test_delays_that_never_come_count_as_longest():
    rows = [_faulty_row(delay_s=d) for d in (0.1, 0.2, None)]
    delay = summarise({"healthy": [], "faulty": rows})["schemes"]["sharpened"]["delay_s"]
    assert delay == {"median": 0.2, "p90": None}


def test_no_events_give_the_textbook_limits():
    assert poisson_bound(0, 10.0, 0.95, upper=True) == pytest.approx(-log(0.05) / 10.0)
    assert binomial_upper(0, 50) == pytest.approx(1 - 0.05 ** (1 / 50))
    assert binomial_upper(7, 7) == 1.0


@given(st.integers(0, 40), st.integers(0, 200), st.floats(0.5, 0.999))
def test_at_the_limit_so_few_events_have_just_the_stated_chance(events, more, confidence):
    limit = poisson_bound(events, 1.0, confidence, upper=True)
    assert poisson.cdf(events, limit) == pytest.approx(1 - confidence, rel=1e-6)
    if more:
        limit = binomial_upper(events, events + more, confidence)
        assert binom.cdf(events, events + more, limit) == pytest.approx(1 - confidence, rel=1e-6)
    assert exp(-limit) < 1


def _campaign(published_s, sharpened_s):
    well = _faulty_row()["published"]
    rows = [{**_faulty_row(delay_s=sharpened_s), "published": {**well, "delay_s": published_s}}]
    return summarise({"healthy": [], "faulty": [*rows, {"skipped": "no trim"}]})


def test_how_much_shorter_the_delay_is_needs_both_delays():
    document = _campaign(0.4, 0.1)
    assert document["delay_shorter_by"] == pytest.approx(0.75)
    assert "delay shorter by 75%" in summary_text(document)
    assert "1 flights drawn could not be trimmed" in summary_text(document)
    assert _campaign(None, 0.1)["delay_shorter_by"] is None
    assert _campaign(0.4, None)["delay_shorter_by"] is None
    assert _campaign(0.0, 0.1)["delay_shorter_by"] is None  # there is nothing to be shorter than
    assert _campaign(0.4, 0.0)["delay_shorter_by"] == 1.0


def test_a_delay_over_what_is_guaranteed_is_of_those_that_are_certain():
    rows = [_faulty_row(delay_s=0.1, guaranteed_s=0.4), _faulty_row(guaranteed_s=None, isolation_s=None)]
    scheme = summarise({"healthy": [], "faulty": rows})["schemes"]["sharpened"]
    assert scheme["delay_over_guaranteed"]["median"] == pytest.approx(0.25)
    assert (scheme["detected"], scheme["isolated"], scheme["detection_certain"]) == (2, 1, 1)
