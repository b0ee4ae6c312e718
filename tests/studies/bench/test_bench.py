"""`beaver-ftc bench`: what it reports, and that all contenders fly the same flight. Never how fast."""

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
from flying import Memory, loss, scenario


@pytest.fixture(scope="module")
def document():
    """As the command does, in blocks of a tenth as many frames."""
    with pytest.MonkeyPatch.context() as shorter:
        shorter.setattr(measure, "FRAMES", 100)
        shorter.setattr(measure, "LONG_FLIGHT_S", 33.0)
        return measure.bench(rounds=1, with_parts=False)


def test_the_spread_encloses_the_median(document):
    low, high = document["ratio_quartiles"]
    assert 0 < low <= document["ratio"] <= high


@pytest.fixture(scope="module")
def published():
    return load_scenario(measure.SCENARIO)


@pytest.mark.parametrize("at_s", [measure.BEFORE_ALARM_S, measure.AFTER_ALARM_S])
def test_the_bare_aircraft_starts_where_the_loop_does_and_stays_in_the_envelope(published, at_s):
    loop = ClosedLoop(published, at_s)
    moment = take_over(published, at_s)
    bare = Bare(moment, 1)
    bare.prepare()
    loop.prepare()
    assert state_of(moment.plant) == state_of(loop.loop.plant)
    bare.fly(measure.FRAMES)
    assert moment.plant.read("aero/envelope-valid") == 1.0
    assert moment.plant.read("simulation/sim-time-sec") == pytest.approx(measure.FRAMES / published.rate_hz)


def test_every_round_flies_what_the_flight_itself_flew():
    """Without sinusoids in the truth, whose phase starts anew with its clock."""
    wanted = scenario(duration_s=20, faults=[loss()], uncertainty={})
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
