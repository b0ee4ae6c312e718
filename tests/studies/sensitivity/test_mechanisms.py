"""`sensitivity --mechanisms`: what is removed, what pairs amount to, and which false alarms have a reason."""

import json
from functools import partial

import numpy as np
import pytest
from scipy.stats import beta
from typer.testing import CliRunner

import needs
from beaver_ftc.cli.main import app
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import measure
from beaver_ftc.scenario.undeclared import undeclared
from beaver_ftc.studies.sensitivity import command, effects, mechanisms, outcomes
from beaver_ftc.studies.sensitivity.effects import CRITERIA, document_of, net
from beaver_ftc.studies.sensitivity.mechanisms import (
    CONSTANT,
    FACTORS,
    INSTRUMENTS,
    Flight,
    scenario_of,
    without_mechanism,
)
from beaver_ftc.studies.sensitivity.systems import DEFAULT, LAW, MECHANISMS, PAPER

ELEVATOR = Flight("loss 80 %", "high", 0.0, "exact sensors", 1)
HARD = Flight("unanticipated", "low", 0.05, "real sensors, light turbulence", 0)
EVERY = pytest.mark.parametrize("mechanism", MECHANISMS, ids=lambda each: each.key)
BY_KEY = {each.key: each for each in MECHANISMS}


def flat(value, path=""):
    """Every leaf of a document by its dotted key."""
    if not isinstance(value, dict):
        return {path: value}
    return {
        key: leaf
        for name, part in value.items()
        for key, leaf in flat(part, f"{path}.{name}".lstrip(".")).items()
    }


@EVERY
def test_only_the_keys_of_a_mechanism_differ(mechanism, changed):
    whole = scenario_of(HARD, 7, mechanism.system)
    there, gone = (
        flat(scenario.model_dump(mode="json"))
        for scenario in (whole.with_(mechanism.present), without_mechanism(whole, mechanism))
    )
    differ = {key for key in {*there, *gone} if there.get(key) != gone.get(key)}
    own = {*mechanism.without, *mechanism.present} | ({CONSTANT} if "thresholds" in mechanism.name else set())
    assert bool(differ) != bool(mechanism.withheld)
    assert all(key.startswith(tuple(own)) for key in differ), differ
    assert not changed({key: gone.get(key) for key in differ})


@EVERY
def test_both_flights_of_a_pair_have_the_same_healthy_loop(mechanism):
    """To the bit, so that their stability margins are the same: nothing of the law acts before an alarm."""
    if mechanism.serves != LAW:
        return
    healthy = scenario_of(ELEVATOR, 7, mechanism.system).with_({"faults": [], "duration_s": 3.0})
    rows = []
    for scenario, withheld in ((healthy, ""), (without_mechanism(healthy, mechanism), mechanism.withheld)):
        log = Columns(*(f"{surface}_cmd_rad" for surface in healthy.airframe.surfaces))
        fly(scenario, log, watch=partial(outcomes.withhold, withheld))
        rows.append([*log.values()])
    assert np.array_equal(*rows)


@pytest.mark.parametrize(("withheld", "modes"), [
    ("", ["nominal", "adaptive", "reallocated"]), ("stand-in", ["nominal", "adaptive"]),
    ("verdict", ["nominal"]),
])  # fmt: skip
def test_what_is_withheld_from_the_law_it_does_not_use(withheld, modes):
    log = Columns("t_s", "flap_cmd_rad")
    flight = fly(scenario_of(ELEVATOR, 7, DEFAULT), log, watch=partial(outcomes.withhold, withheld))
    found = measure(flight)
    assert found.isolation.correct
    assert [change.mode for change in found.supervisor] == modes
    moved = np.ptp(log["flap_cmd_rad"][log["t_s"] > found.fault.at_s])
    assert (moved > 0.01) == (withheld == "")


def test_draws_are_within_the_declaration_but_for_the_undeclared_error():
    for instruments in INSTRUMENTS:
        for system in (PAPER, DEFAULT):
            sound, wrong = (
                scenario_of(Flight("loss 40 %", "low", error, instruments, 2), 7, system)
                for error in (0.0, 0.02)
            )
            assert list(undeclared(sound)) == []
            assert {fact.key.rpartition(".")[0] for fact in undeclared(wrong)} == {"uncertainty.coefficients"}


def test_systems_fly_the_same_draw_and_cells_have_draws_of_their_own(changed):
    paper, default = (scenario_of(ELEVATOR, 7, system) for system in (PAPER, DEFAULT))
    assert not changed(
        [flat(each.model_dump(mode="json")) for each in (paper, scenario_of(HARD, 7, DEFAULT))]
    )
    for of in (
        "seed",
        "initial",
        "reference",
        "uncertainty",
        "faults",
        "sensors",
        "environment",
        "duration_s",
    ):
        assert getattr(paper, of) == getattr(default, of)
    others = [ELEVATOR._replace(run=4), ELEVATOR._replace(bandwidth="low"), ELEVATOR._replace(error=0.02)]
    assert len({scenario_of(flight, 7, PAPER).seed for flight in (ELEVATOR, *others)}) == 4
    assert paper.faults[0].actuator == "elevator"


def test_a_constant_threshold_promises_what_the_adaptive_one_does():
    """No less than the adaptive one at any time of the flight as declared."""
    whole = scenario_of(ELEVATOR, 7, PAPER)
    constant = without_mechanism(whole, BY_KEY["published: adaptive thresholds"]).fdi.options[
        CONSTANT.split(".")[-1]
    ]
    names = [f"{axis}_threshold_rad_s" for axis in "pqr"]
    log = Columns(*names)
    fly(whole.with_({"faults": []}), log)
    assert constant == max(log[name].max() for name in names)


def outcome(**keys):
    usual = {"delay_s": 0.05, "named": True, "tracking_deg_s": 0.2, "false_alarm": False, "failed": False}
    return usual | {"verdict": [7.0, "elevator", 7.1], "reason": None} | keys


@pytest.mark.parametrize(("criterion", "worse"), [
    ("false_alarms", {"false_alarm": True, "delay_s": None}), ("late", {"delay_s": 0.16}),
    ("late", {"delay_s": None}), ("names", {"named": False}), ("tracking", {"tracking_deg_s": 0.221}),
    ("tracking", {"tracking_deg_s": None}),
])  # fmt: skip
def test_what_is_worse(criterion, worse):
    pair = outcome(), outcome(**worse)
    assert {name for name, is_worse in CRITERIA.items() if is_worse(*pair)} == {criterion}
    assert not any(is_worse(*reversed(pair)) for is_worse in CRITERIA.values())
    assert not any(
        is_worse(outcome(), outcome(delay_s=0.14, tracking_deg_s=0.219)) for is_worse in CRITERIA.values()
    )


def test_the_interval_of_a_net_share_is_that_of_both_shares():
    """Each by the quantiles of the beta distribution at 97.5 %."""
    pairs = [(outcome(), outcome(named=False))] * 6 + [(outcome(named=False), outcome())] * 2
    pairs += [(outcome(), outcome())] * 12
    found = net(pairs, CRITERIA["names"])
    tail = 0.0125
    lost = beta.ppf(tail, 6, 15), beta.ppf(1 - tail, 7, 14)
    gained = beta.ppf(tail, 2, 19), beta.ppf(1 - tail, 3, 18)
    assert (found["worse"], found["better"], found["value"]) == (6, 2, 0.2)
    assert (found["low"], found["high"]) == pytest.approx((lost[0] - gained[1], lost[1] - gained[0]))
    none = net([(outcome(), outcome())] * 20, CRITERIA["names"])
    assert (none["low"], none["high"]) == pytest.approx(
        (-beta.ppf(1 - tail, 1, 20), beta.ppf(1 - tail, 1, 20))
    )


@pytest.fixture
def few_cells(monkeypatch):
    """A survey of one cell, with an undeclared error."""
    few = FACTORS | {
        "fault": ("loss 40 %",), "bandwidth": ("high",), "error": (0.05,), "instruments": ("exact sensors",),
    }  # fmt: skip
    for module in (mechanisms, effects):
        monkeypatch.setattr(module, "FACTORS", few)


def rows_of(reason, key=DEFAULT):
    keys = {key for mechanism in MECHANISMS for key in (mechanism.with_key, mechanism.without_key)}
    rows = [{each: outcome() for each in sorted(keys)} for _ in effects.cases_of(1)]
    rows[0][key] = outcome(false_alarm=True, delay_s=None, named=False, reason=reason)
    return rows


@pytest.mark.parametrize(("reason", "key", "passed"), [
    ({"undeclared": 3, "certified": True}, DEFAULT, True),
    ({"undeclared": 0, "certified": True}, DEFAULT, False),
    ({"undeclared": 3, "certified": False}, DEFAULT, False),
    ({"undeclared": 3, "certified": None}, PAPER, True),
    ({"undeclared": 0, "certified": None}, PAPER, False),
    ({"undeclared": 0, "certified": False}, "with default: statistical detector", True),  # it promises a rate
])  # fmt: skip
def test_a_false_alarm_of_a_worst_case_detector_wants_a_reason(few_cells, reason, key, passed):
    document = document_of(1, 1, rows_of(reason, key), [])
    assert document["passed"] == passed
    assert sum(row["unexplained"] for row in document["false_alarms"] if row["worst_case"]) == (not passed)


def test_a_flight_that_failed_is_not_one_without_an_alarm(few_cells):
    rows = rows_of(None)
    rows[0][DEFAULT] = outcomes.FAILED
    of, flown = document_of(1, 1, rows, [])["systems"][DEFAULT], len(rows) - 1
    counts = [of[name][key] for name in ("detected", "lost") for key in ("count", "of")]
    assert (of["flights"], *counts) == (flown, flown, flown, 0, flown)


@needs.service("proof")
def test_a_document_and_its_files(tmp_path, monkeypatch, few_cells, changed):
    monkeypatch.setattr(command, "margin_cells", lambda: [(DEFAULT, "high", "exact sensors")])
    line = ["mechanisms", "--draws", "1", "--workers", "1", "--out", str(tmp_path), "--format", "json"]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert not changed(document | {"versions": 0, "folder": 0}, relative=1e-3)
    alarms = next(row for row in document["false_alarms"] if row["flown"] == DEFAULT)
    assert (alarms["count"], alarms["certified"], alarms["unexplained"]) == (1, 1, 0)
    folder = tmp_path / "mechanisms-sensitivity"
    assert {path.name for path in folder.iterdir()} == {
        f"sensitivity.{k}" for k in ("json", "csv", "png", "html")
    }
