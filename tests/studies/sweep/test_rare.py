"""Subset simulation: known normal tails, their intervals, what it says when it cannot, and flights."""

import json
import math
from statistics import NormalDist

import numpy as np
import pytest
import yaml
from tools.drawn.rare import ANALYTIC, repeated
from tools.drawn.rare import SWEEP as BIASED

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.flight import fly
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.engine import study
from beaver_ftc.studies.sweep import rare
from beaver_ftc.studies.sweep.rare import as_text, rare_study, scored
from beaver_ftc.studies.sweep.subset_simulation import Chains

TRACKED = "post_fault_rms_deg_s.q"


@pytest.mark.parametrize("problem", ANALYTIC)
def test_intervals_hold_in_ninety_of_a_hundred_repeats(problem):
    held, near, flights = repeated(problem, 100)
    assert held >= 90
    assert near >= 93
    assert flights <= 100 * 0.01 * 10 / 1e-5  # a hundredth of the plain flights that see ten such events


@pytest.fixture
def biased(tmp_path):
    (tmp_path / "biased.yaml").write_text(yaml.safe_dump(BIASED))
    return load_sweep(tmp_path / "biased.yaml")


def test_the_likeliest_event_is_near_the_design_point():
    chains = Chains(2, 1)
    chains.go(lambda points: points.sum(1) / math.sqrt(2) - 4.0)
    distance, _, point = chains.design
    assert 4.0 <= distance < 4.3
    assert point == pytest.approx([4 / math.sqrt(2)] * 2, abs=0.8)


def test_a_frequent_event_needs_no_levels():
    chains = Chains(1, 3)
    chains.go(lambda points: points[:, 0])
    found = chains.estimate()
    assert (found["levels"], found["flights"]) == (0, rare.RUNS * rare.MEMBERS)
    assert found["low"] < 0.5 < found["high"]
    assert (found["plain"]["events"], found["plain"]["of"]) == (int((chains.points >= 0.0).sum()), 1760)
    assert found["probability"] == pytest.approx(found["plain"]["events"] / 1760)


@pytest.mark.parametrize(
    ("score", "why"),
    [
        (lambda points: np.full(len(points), -1.0), "the score stops rising before the event"),
        (lambda points: np.full(len(points), -np.inf), "the score stops rising before the event"),
        (lambda points: points[:, 0] - 20.0, "too rare for so many levels"),
    ],
)
def test_where_it_cannot_get_there_it_says_so(score, why):
    chains = Chains(2, 1)
    chains.go(score)
    found = chains.estimate()
    assert (math.isnan(found["probability"]), found["low"], found["why"]) == (True, 0.0, why)
    assert chains.design is None
    assert found["levels"] == (0 if "stops" in why else 10)
    assert found["flights"] == rare.RUNS * rare.MEMBERS + found["levels"] * rare.RUNS * 9 * 22
    assert (found["high"] == 1.0) if "stops" in why else (1e-11 <= found["high"] < 1e-9)


def test_an_event_that_the_last_level_reaches_is_known():
    chains = Chains(2, 3)
    p = 1e-9
    chains.go(lambda points: points[:, 0] + NormalDist().inv_cdf(p))
    found = chains.estimate()
    assert (found["levels"], found["why"]) == (10, "")
    assert found["low"] < p < found["high"]


def test_a_score_that_most_flights_share_is_passed():
    chains = Chains(1, 1)
    chains.go(lambda points: np.where(points[:, 0] < 1.5, -9.0, points[:, 0] - 4.0))  # of 93 % of the flights
    found = chains.estimate()
    assert found["low"] < NormalDist().cdf(-4.0) < found["high"]
    assert found["why"] == ""


SWEEP = {
    "name": "drift",
    "base": {
        "name": "drift", "duration_s": 1.0, "rate_hz": 50, "control": {"law": "nominal"},
        "faults": [{"actuator": "elevator", "type": "bias", "bias_deg": 0.1, "at_s": 0.2}],
        "expect": {
            "no_departure": True, "detected_within_s": 0.5, "isolated_as": "elevator",
            "post_fault_rms_deg_s": {"q": 12},
        },
    },
    "runs": 1,
    "vary": {"faults[0].bias_deg": {"normal": [0, 1]}, "initial.airspeed_mps": {"uniform": [40, 50]}},
}  # fmt: skip


@pytest.fixture
def drift(tmp_path):
    (tmp_path / "drift.yaml").write_text(yaml.safe_dump(SWEEP))
    return load_sweep(tmp_path / "drift.yaml")


def test_flights_give_a_number_an_interval_and_the_likeliest_of_them(drift, tmp_path, monkeypatch):
    monkeypatch.setattr(rare, "RUNS", 3)
    monkeypatch.setattr(rare, "MEMBERS", 20)
    monkeypatch.setattr(Chains.__init__, "__defaults__", (3, 20))
    said = []
    document = study.run_into(rare_study(drift, TRACKED, said.append), tmp_path / "runs")
    folder = tmp_path / "runs" / "drift-rare-post_fault_rms_deg_s-q"
    assert document["folder"] == str(folder)
    assert json.loads((folder / "rare.json").read_text())["probability"] == document["probability"]
    assert 0.0 < document["probability"] < 0.3
    assert document["low"] < document["high"]
    nearest = document["likeliest"]
    bias_deg, airspeed_mps = nearest["values"].values()  # normal, and uniform from 40 to 50
    across = NormalDist().inv_cdf((airspeed_mps - 40) / 10)
    assert nearest["distance"] == pytest.approx(math.hypot(bias_deg, across), rel=1e-6)
    assert document["flights"] == int(said[-1].split(": ")[1].split()[0])
    again = fly(str(folder / "flight.yaml"))
    missed = {one.name for one in again.expectations if not one.passed}
    assert TRACKED in missed
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == [folder.name]
    text = as_text(document)
    assert f"beaver-ftc run {folder}/flight.yaml" in text
    assert "plain" in text
    assert "not flown" not in text
    assert "not flown    2 flights, counted as no event" in as_text(document | {"failed": 2})


def test_what_is_stopped_goes_on_where_it_was(drift, tmp_path, monkeypatch):
    monkeypatch.setattr(Chains.__init__, "__defaults__", (2, 10))
    monkeypatch.setattr(study, "OF_A_PART", 6)
    whole = study.run_study(rare_study(drift, TRACKED), tmp_path / "whole")
    flown = []
    stops = [16]
    fly = rare.Event.fly

    def stopped(event, case):
        flown.append(case)
        if len(flown) in stops:  # of the first round's twenty, twelve have landed
            raise KeyboardInterrupt
        return fly(event, case)

    monkeypatch.setattr(rare.Event, "fly", stopped)
    with pytest.raises(KeyboardInterrupt):
        study.run_study(rare_study(drift, TRACKED), tmp_path / "parts")
    flown.clear()
    stops.clear()
    assert study.run_study(rare_study(drift, TRACKED), tmp_path / "parts") == whole
    assert len(flown) == whole["flights"] - 12


def test_an_alarm_or_a_loss_that_is_wanted_has_no_score(tmp_path):
    """What is expected then is the event itself."""
    wanted = {"no_false_alarm": False, "no_departure": False, "post_fault_rms_deg_s": {"p": 3, "r": 2.5}}
    (tmp_path / "other.yaml").write_text(
        yaml.safe_dump({**SWEEP, "base": SWEEP["base"] | {"expect": wanted}})
    )
    found = scored(load_sweep(tmp_path / "other.yaml"))
    assert found == ["post_fault_rms_deg_s.p", "post_fault_rms_deg_s.r"]


@pytest.mark.parametrize("name", ["isolated_as", "no_departur", "", "x" * 500])
def test_what_the_base_does_not_expect_is_refused(name, drift):
    with pytest.raises(BadInput, match=r"^--rare: .* is nothing that drift expects.* allowed: detected_"):
        rare_study(drift, name)


def test_nothing_varies(tmp_path):
    (tmp_path / "still.yaml").write_text(yaml.safe_dump({**SWEEP, "vary": {}}))
    with pytest.raises(BadInput, match="vary: nothing varies"):
        rare_study(load_sweep(tmp_path / "still.yaml"), "no_departure")


@pytest.mark.parametrize(
    ("name", "bias", "event"),
    [
        ("no_departure", 0.5, False), ("no_departure", 25.0, True),
        ("detected_within_s", 3.0, False), ("detected_within_s", 0.0, True),
        (TRACKED, 0.2, False), (TRACKED, 9.0, True),
    ],
)  # fmt: skip
def test_a_score_is_below_zero_until_the_event_has_come(name, bias, event, drift):
    base = {"duration_s": 4.0} if name == "no_departure" else {}
    flown = drift.scenario({"faults[0].bias_deg": bias}, name="x", seed=1, **base)
    assert (rare.score_of(flown, name) >= 0.0) is event
