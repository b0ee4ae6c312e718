"""`beaver-ftc bench`: what it reports, and that all contenders fly the same flight. Never how fast."""

import json
import subprocess
import sys

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.studies.bench import measure
from beaver_ftc.studies.bench.contenders import (
    Bare,
    ClosedLoop,
    InnovationDetector,
    ProportionalInversion,
    state_of,
    take_over,
)
from beaver_ftc.studies.bench.measure import KINDS
from flying import Memory, scenario

ELEVATOR_LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 12}


@pytest.fixture(scope="module")
def document():
    """As the command does, in blocks of a tenth as many frames."""
    with pytest.MonkeyPatch.context() as shorter:
        shorter.setattr(measure, "FRAMES", 100)
        shorter.setattr(measure, "LONG_FLIGHT_S", 33.0)
        return measure.bench(rounds=1, with_parts=False)


def test_the_contract_keys_are_there(document):
    assert {"bare_us", "closed_loop_us", "ratio", "parts"} <= set(document)
    assert document["parts"] == {}
    assert document == json.loads(json.dumps(document, allow_nan=False))


def test_the_spread_encloses_the_median(document):
    for name in ("bare_us", "closed_loop_us", "ratio"):
        low, high = document[f"{name}_quartiles"]
        assert 0 < low <= document[name] <= high


def test_what_is_compared_with_the_loop(document):
    assert {"straightforward", "python_detector", "python_law"} <= set(document["alternatives"])
    assert document["whole_flight"]["frames"] == 3300


def test_every_kind_of_flight_is_taken_apart(document):
    kinds = document["sweep_flights"]
    assert list(kinds) == list(KINDS)
    assert kinds["class all, every error declared"]["frame_us"] > kinds["class all"]["frame_us"]
    for of in kinds.values():
        assert set(of["parts_ms"]) == {"scenario", "aircraft, trim, record", "frames", "metrics and row"}
        assert of["bare_ms"] > 0
        assert 0 < of["frames_ratio"] < of["flight_ratio"]


def test_medians_are_over_rounds_and_ratios_within_one():
    """Three rounds, the second on a machine half as fast: ratios are those of every round."""
    parts = np.array([1.0, 2.0, 12.0, 1.0]) * 1e-3
    rows = [(parts, 1000, 0.01), (2 * parts, 1000, 0.02), (parts, 1000, 0.01)]
    found = measure._medians(rows)
    assert found["parts_ms"]["frames"] == 12.0
    assert (found["bare_ms"], found["frames_ratio"], found["flight_ratio"]) == (10.0, 1.2, 1.6)
    assert found["own_part_us"] == 2.0


@pytest.fixture(scope="module")
def published():
    return load_scenario(measure.SCENARIO)


@pytest.mark.parametrize("at_s", [measure.BEFORE_ALARM_S, measure.AFTER_ALARM_S])
def test_the_bare_aircraft_starts_where_the_loop_does_and_stays_in_the_envelope(published, at_s):
    loop = ClosedLoop(published, at_s)
    bare = Bare(take_over(published, at_s), 1)
    bare.prepare()
    loop.prepare()
    assert state_of(bare.plant) == state_of(loop.loop.plant)
    bare.fly(measure.FRAMES)
    assert bare.plant.read("aero/envelope-valid") == 1.0
    assert bare.plant.read("simulation/sim-time-sec") == pytest.approx(measure.FRAMES / published.rate_hz)


def test_the_phases_are_what_they_are_called(published):
    before, after = (ClosedLoop(published, t) for t in (measure.BEFORE_ALARM_S, measure.AFTER_ALARM_S))
    for loop, alarm in ((before, 0), (after, 1)):
        for _ in range(2):  # a second round starts where the first did
            loop.prepare()
            assert loop.loop.frames["fdi"]["verdict"]["detected"][0] == alarm
            loop.fly(measure.FRAMES)
            assert loop.loop.frames["fdi"]["verdict"]["detected"][0] == alarm
    assert np.abs(after.loop.frames["fdi"]["fdae"]["network"]["memory"]["Phi"]).max() > 0


def test_every_round_flies_what_the_flight_itself_flew():
    """Without sinusoids in the truth, whose phase starts anew with its clock."""
    wanted = scenario(duration_s=20, faults=[ELEVATOR_LOSS], uncertainty={})
    log, contender = Memory(), ClosedLoop(wanted, measure.AFTER_ALARM_S)
    fly(wanted, log)
    first = round(measure.AFTER_ALARM_S * wanted.rate_hz)
    names = ("t_s", "q_residual_rad_s", "elevator_cmd_rad", "flap_cmd_rad", "mode")
    columns = [contender.loop.columns.index(name) for name in names]
    for _ in range(2):
        contender.prepare()
        contender.fly(300)
        flown = contender.loop.log[:300][:, columns]
        np.testing.assert_allclose(flown, log.rows[first : first + 300][:, columns], atol=1e-5)


def test_the_plug_ins_do_a_detectors_and_a_laws_work(published):
    flight = fly(published, detector=InnovationDetector(), law=ProportionalInversion())
    assert 12.0 <= flight.detection_time_s <= 12.1
    assert flight.departure is None


def test_json_is_one_document_and_nothing_else():
    program = "from beaver_ftc.cli.main import main; main()"
    arguments = ["bench", "--rounds", "3", "--no-parts", "--format", "json"]
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout)["ratio"] > 0
