"""What is said of a flight, and what a MAVLink command breaks in it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common
from tools.autopilots.small import Small, Told

import beaver_ftc as bf
from beaver_ftc.loop import simulation
from beaver_ftc_links.sitl import failures
from beaver_ftc_links.sitl.link import Times
from beaver_ftc_links.sitl.mavlink import Mavlink
from beaver_ftc_links.sitl.telling import CRITICAL, INFO, WARNING, Teller, Text
from beaver_ftc_links.sitl.vehicle import Vehicle


def vehicle(**keys):
    base = bf.load("fault-free").with_({"expect": {}, "duration_s": 4.0, "fdi.fault_class": "all", **keys})
    return Vehicle(base, pulses=False, rate_hz=100)


def fly(flying, seconds, teller=None):
    """Under the small autopilot; what is said meanwhile."""
    said, autopilot = [], Small()
    for _ in range(round(100 * seconds)):
        now = flying.instant()
        climb, altitude = -now.velocity[2], now.altitude_m
        told = Told(now.t_s, now.gyro, now.attitude, altitude, climb, now.airspeed_mps, now.force[1])
        flying.fly(autopilot.outputs(told), 100)
        said += teller.news(flying.flight) if teller else []
    return said


def test_an_alarm_a_name_and_a_size_are_said_once():
    fault = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 1.0}
    flying, teller = vehicle(faults=[fault], **{"fdi.fault_class": "published"}), Teller()
    said = fly(flying, 3.0, teller)
    assert said == [
        Text(pytest.approx(1.01), WARNING, "FDI: alarm on q"),
        Text(pytest.approx(1.01), CRITICAL, "FDI: elevator, loss of effectiveness"),
        Text(pytest.approx(2.01), INFO, "FDI: elevator, 40 % lost"),
    ]
    assert teller.kept == said
    teller.begin()
    assert teller.kept == []


@pytest.mark.parametrize(
    ("params", "place", "kind"),
    [
        ((102, 2, 2), "elevator", "stuck"), ((102, 1, 1), "aileron", "float"),
        ((102, 4, 4), "rudder", "hardover"), ((102, 5, 2), "elevator", "rate_limit"),
        ((102, 3, 1), "aileron", "oscillatory"), ((3, 2, 0), "altitude", "freeze"),
    ],
)  # fmt: skip
def test_a_failure_is_injected_and_repaired(params, place, kind):
    flying = vehicle()
    result, says = failures.inject(flying.flight, flying.outputs.channels, params)
    assert result == failures.ACCEPTED
    assert says == f"{place}: {kind.replace('_', ' ')}"
    fly(flying, 0.1)
    there = [(getattr(f, "actuator", None) or f.sensor, f.type) for f in flying.flight.in_force]
    assert there == [(place, kind)]
    mended = (params[0], failures.OK, params[2])
    assert failures.inject(flying.flight, flying.outputs.channels, mended)[0] == failures.ACCEPTED
    fly(flying, 0.1)
    assert flying.flight.in_force == ()


@pytest.fixture(scope="module")
def one():
    return vehicle()


UNITS, KINDS = (0, 1, 3, 8, 102), (0, 1, 2, 3, 4, 5)
WHOLE = st.integers(-200, 2000)


@given(unit=WHOLE, kind=WHOLE, which=WHOLE)
def test_what_this_aircraft_has_not_is_unsupported(one, unit, kind, which):
    if unit not in UNITS or kind not in KINDS or (unit == 102 and which not in (0, 1, 2, 4)):
        result, _ = failures.inject(one.flight, one.outputs.channels, (unit, kind, which))
        assert result == failures.UNSUPPORTED
        assert one.flight.in_force == ()


def test_a_failure_the_scenario_refuses_is_denied(monkeypatch):
    monkeypatch.setattr(simulation, "MOST_FAULTS", 1)
    flying = vehicle(faults=[{"type": "bias", "actuator": "flap", "bias_deg": 0.1, "at_s": 3}])
    result, says = failures.inject(flying.flight, flying.outputs.channels, (102, 2, 2))
    assert result == failures.DENIED
    assert says.startswith("faults: this flight has had 1, allowed: ")


def test_only_the_command_for_failures_is_obeyed():
    line = Mavlink()
    asked = []
    other = common.MAVLink_command_long_message(1, 191, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    inject = common.MAVLink_command_long_message(1, 191, 420, 0, 102, 2, 3, 0, 0, 0, 0)
    sender = common.MAVLink(None, srcSystem=255, srcComponent=190)
    answers = []
    for message in (other, inject):
        (received,) = line.unpack(message.pack(sender))
        answers.append(line.obeyed(received, lambda params: (asked.append(params), (0, "broken"))[1]))
    assert asked == [(102.0, 2.0, 3.0)]
    assert answers[0] == (b"", "")
    (ack,) = common.MAVLink(None).parse_buffer(answers[1][0])
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (420, 0, 255, 190)


@given(st.lists(st.floats(2e-6, 9.0), min_size=1, max_size=200), st.floats(0.01, 1.0))
def test_quantiles_to_four_percent(times_s, share):
    times = Times()
    for time_s in times_s:
        times.add(time_s)
    exact = np.sort(times_s)[int(np.ceil(share * len(times_s))) - 1]
    assert exact <= times.quantile(share) * (1 + 1e-12)
    assert times.quantile(share) <= exact * 1.04
    assert times.mean == pytest.approx(np.mean(times_s))
    assert times.spread == pytest.approx(np.std(times_s), abs=1e-6)
