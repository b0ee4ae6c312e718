"""What is said of a flight, and what a MAVLink command breaks in it."""

import select
import socket
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common
from tools.autopilots.small import Small, Told

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results import Metrics
from beaver_ftc_links.commands import address
from beaver_ftc_links.sitl import failures
from beaver_ftc_links.sitl.link import COUNTED, Link, Times
from beaver_ftc_links.sitl.mavlink import GroundLine, Mavlink
from beaver_ftc_links.sitl.serve import Endpoint
from beaver_ftc_links.sitl.telling import CRITICAL, INFO, WARNING, Teller, Text
from beaver_ftc_links.sitl.vehicle import Flown, Vehicle


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


def test_healthy_flight_says_nothing():
    assert fly(vehicle(), 3.0, Teller()) == []


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


def test_all_gyros_at_once():
    flying = vehicle()
    failures.inject(flying.flight, flying.outputs.channels, (0, 2, 0))
    fly(flying, 0.05)
    assert Counter(fault.sensor for fault in flying.flight.in_force) == {"p": 1, "q": 1, "r": 1}


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


def test_a_failure_the_scenario_refuses_is_denied():
    many = [{"type": "bias", "actuator": "flap", "bias_deg": 0.001 * k, "at_s": 3} for k in range(1, 1001)]
    flying = vehicle(faults=many)
    result, says = failures.inject(flying.flight, flying.outputs.channels, (102, 2, 2))
    assert result == failures.DENIED
    assert says.startswith("faults: this flight has had 1000, allowed: ")


def test_a_long_text_is_said_in_parts():
    line = Mavlink()
    long = "x" * 49 + "y" * 50 + "z"
    data = line.texts([Text(1.0, 4, "short"), Text(1.0, 2, long)])
    heard = common.MAVLink(None).parse_buffer(data)
    parts = [(m.severity, m.text, m.id, m.chunk_seq) for m in heard]
    assert parts[0] == (4, "short", 0, 0)
    assert "".join(text for _, text, _, _ in parts[1:]) == long
    assert [part[2:] for part in parts[1:]] == [(1, 0), (1, 1)]


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


def test_a_link_without_a_packet_is_a_document_too():
    document = Link().document()
    assert {document[name] for name in COUNTED} == {0}
    assert document["latency_ms"] == {"median": 0.0, "p99": 0.0, "largest": 0.0}


def test_a_link_is_silent_since_its_last_frame():
    link = Link()
    assert link.silent_s(7.5) == 0.0  # nothing has begun yet
    link.hear(8.0)
    assert link.silent_s(10.25) == 2.25


@pytest.mark.parametrize("detected", [0, 1])
@pytest.mark.parametrize("watched", [0, 1])
@pytest.mark.parametrize("plugged", [None, "a plug-in"])
def test_an_alarm_is_of_surfaces_or_of_instruments_and_a_plug_in_may_have_one(detected, watched, plugged):
    frame = {"fdi": {"verdict": {"detected": detected}, "sensor_monitor": {"output": {"alarmed": watched}}}}
    flight = SimpleNamespace(_frame=frame, _loop=SimpleNamespace(plugin_frame=plugged))
    assert Flown.alarmed.fget(flight) is bool(detected or watched or plugged)


LOSS = {"isolated": "elevator", "type": "loss_of_effectiveness"}
TELLING = [  # time, verdict, what else of the flight, what is said
    (0.0, {"detected": True}, {"alarmed": False}, []),  # of no alarm the verdict is not even looked at
    (1.0, {}, {"listens_from_s": 1.0, "alarmed": False}, [(6, "FDI: listening")]),
    (1.5, {}, {"listens_from_s": 1.0, "alarmed": False}, []),
    (2.0, {"axis": "q", "candidates": ("rudder:jam", "flap", "rudder:float")}, {},
     [(4, "FDI: alarm on q"), (4, "FDI: rudder or flap")]),
    (2.5, {"axis": "q", "candidates": ("rudder:float", "flap")}, {}, []),
    (3.0, {"candidates": ("flap",)}, {}, [(4, "FDI: flap")]),
    (3.5, {}, {}, []),
    (4.0, LOSS | {"estimate": -0.25}, {}, [(2, "FDI: elevator, loss of effectiveness")]),
    (4.9, LOSS | {"estimate": -0.5}, {}, []),
    (5.0, LOSS, {}, []),
    (5.1, LOSS | {"estimate": -0.375}, {}, [(6, "FDI: elevator, 38 % lost")]),
    (6.5, LOSS | {"estimate": -0.375}, {}, []),
    (7.0, {"isolated": "elevator", "type": "rate_limit"}, {}, [(2, "FDI: elevator, rate limit")]),
    (9.0, {"isolated": "elevator", "type": "rate_limit", "estimate": 0.1}, {}, []),
    (9.5, {"isolated": "unanticipated", "type": "unanticipated"}, {}, [(2, "FDI: unanticipated")]),
    (9.6, {"isolated": "flap"}, {"departed": True},
     [(2, "FDI: flap"), (0, "FDI: the aircraft is lost")]),
    (9.7, {"isolated": "flap"}, {"departed": True, "alarmed": False}, []),
]  # fmt: skip


def test_what_is_new_is_said_once():
    teller, kept = Teller(), 0
    for t_s, said, changes, texts in TELLING:
        verdict = Verdict(**{"detected": bool(changes.get("alarmed", True))} | said)
        flight = {"listens_from_s": None, "alarmed": True, "departed": False} | changes
        found = teller.news(SimpleNamespace(t_s=t_s, verdict=verdict, **flight))
        assert found == [Text(t_s, *one) for one in texts], t_s
        kept += len(texts)
        assert len(teller.kept) == kept
    teller.kept *= 20
    teller.kept[199:] = []
    flight |= {"alarmed": True, "departed": False}
    verdict = Verdict(True, isolated="flap")
    teller._said = (False, None, None, ())
    assert len(teller.news(SimpleNamespace(t_s=10.0, verdict=verdict, **flight))) == 2
    assert len(teller.kept) == 200
    teller.begin()
    early = Verdict(True, **LOSS, estimate=-0.25)  # named within the first second of a flight
    counts = [len(teller.news(SimpleNamespace(t_s=t_s, verdict=early, **flight))) for t_s in (0.4, 1.3, 1.5)]
    assert counts == [2, 0, 1]
    teller.begin()
    verdict = Verdict(True)
    (text,) = teller.news(SimpleNamespace(t_s=1.0, verdict=verdict, **flight))
    assert text.text == "FDI: alarm between the instruments"


@pytest.mark.parametrize(("frame_hz", "fixed_hz", "runs", "off"), [
    (20.0, None, 20, 0), (400.0, None, 1, 0), (100.00001, None, 4, 0), (100.001, None, 8, 1),
    (50.0, None, 8, 0),
    (500.0, None, 8, 1), (19.0, None, 8, 1), (0.0, None, 8, 1), (100.0, 100.0, 8, 1), (50.0, 100.0, 8, 0),
    (1000.0, None, 8, 1),
])  # fmt: skip
def test_frames_of_the_model_in_a_frame_of_the_autopilot(frame_hz, fixed_hz, runs, off):
    """At 400 Hz of the model, begun at 50 Hz: where the number is not whole it is that of the beginning."""
    flying = SimpleNamespace(_jsbsim_hz=400.0, _fixed_hz=fixed_hz, packets_hz=50.0, off_rate=0)
    assert (Vehicle.runs_of(flying, frame_hz), flying.off_rate) == (runs, off)


@pytest.mark.parametrize(("from_s", "at_s", "delay_s"), [
    (None, None, None), (None, 3.0, None), (2.0, None, 0.4), (2.0, 2.0, 0.4), (2.0, 1.9, None),
])  # fmt: skip
def test_no_delay_is_promised_of_what_broke_before_the_diagnosis_began(from_s, at_s, delay_s):
    said = []
    flight = SimpleNamespace(
        vehicle=SimpleNamespace(flight=SimpleNamespace(listens_from_s=from_s)), _say=said.append
    )
    fault = None if at_s is None else {"at_s": at_s}
    found = Metrics.of({"fault": fault, "detection": {"guaranteed_delay_s": 0.4, "axis": "q"}})
    promised = Endpoint._without_certainty(flight, found)
    assert promised == replace(found, detection=replace(found.detection, guaranteed_delay_s=delay_s))
    assert said == ["the diagnosis never began: near the ground nothing is diagnosed"] * (from_s is None)


def test_a_failure_is_of_one_output_of_all_or_of_the_instruments_that_are_there():
    """A surface that two outputs move fails with either."""

    def mixed(*channels):
        return [SimpleNamespace(channel=channel) for channel in channels]

    channels = SimpleNamespace(surfaces={"aileron": mixed(1, 4), "elevator": mixed(2), "flap": mixed(4)})
    sim = SimpleNamespace(airframe=load())
    for which, names in (
        (0, ("aileron", "elevator", "flap")), (1, ("aileron",)), (2, ("elevator",)),
        (4, ("aileron", "flap")), (3, ()),
    ):  # fmt: skip
        assert failures._places(failures.SERVO, which, sim, channels) == names
    assert failures._places(0, 7, sim, channels) == ("p", "q", "r")
    assert failures._places(99, 0, sim, channels) == ()


@pytest.mark.parametrize(
    ("given", "found"),
    [
        (None, None), ("host:14550", ("host", 14550)), ("[::1]:1", ("[::1]", 1)), ("h:65535", ("h", 65535)),
        *((wrong, BadInput) for wrong in ("h:65536", "h:0", "h:-1", "h:x", ":14550", "host", "")),
    ],
)  # fmt: skip
def test_an_address_is_a_host_and_a_port(given, found):
    if found is BadInput:
        with pytest.raises(BadInput, match=r"^--mavlink: .* is no address, allowed: HOST:PORT"):
            address(given)
    else:
        assert address(given) == found


def test_what_came_over_the_wire_is_a_document_of_counts_and_of_times_in_ms():
    link = Link()
    for now_s in (10.0, 10.02, 10.06, 11.06, 13.5, 13.56):  # of 1 s, too: no silence yet
        link.hear(now_s)
    for time_s in (0.001, 0.002, 0.0045, 0.001):
        link.latency.add(time_s)
    for count, name in enumerate(COUNTED, 2):
        link.counts[name] += count
    found = link.document()
    gaps_ms = np.array([20.0, 40.0, 1000.0, 60.0])
    assert list(found) == [*COUNTED, "latency_ms", "interval_ms", "longest_silence_s"]
    assert [found[name] for name in COUNTED] == [2, 3, 4, 5, 6, 7, 8, 9, 11]  # one silence is its own
    assert found["interval_ms"] == pytest.approx(
        {"mean": gaps_ms.mean(), "jitter_rms": gaps_ms.std(), "largest": 1000.0}, abs=1e-3
    )
    assert found["longest_silence_s"] == 2.44
    assert found["latency_ms"] == pytest.approx({"median": 1.0, "p99": 4.5, "largest": 4.5}, rel=0.04)
    assert found["latency_ms"]["p99"] == 4.5


SERVOS = {1: {"type": "float"}, 2: {"type": "stuck"}, 4: {"type": "hardover", "direction": 1},
          3: {"type": "oscillatory", "amplitude_deg": 3.0, "frequency_rad_s": 10.0},
          5: {"type": "rate_limit", "scale": 0.1}}  # fmt: skip
INSTRUMENTS = {1: {"type": "lost"}, 2: {"type": "freeze"}, 4: {"type": "scale", "magnitude": 0.3}}
OF_UNITS = {0: ("p", "q", "r"), 1: ("ax", "ay", "az"), 3: ("altitude",), 8: ("V", "qdyn"), 7: (), 102: ()}


@pytest.mark.parametrize("unit", OF_UNITS)
def test_every_unit_and_type_of_a_command_breaks_or_repairs_its_own(unit):
    """FAILURE_UNIT by FAILURE_TYPE [MAVLink, common.xml]: of servos the second and fourth output, of all."""
    channels = SimpleNamespace(
        surfaces={"aileron": [SimpleNamespace(channel=2)], "flap": [SimpleNamespace(channel=4)]}
    )
    done = []
    sim = SimpleNamespace(airframe=load(), inject=done.append, repair=done.append)
    for kind in range(-1, 8):
        for which in (0, 2, 3):
            done.clear()
            params = (unit + 0.2, kind - 0.3, which + 0.4)  # they come as floats
            result, says = failures.inject(sim, channels, params)
            servo = unit == 102
            places = {0: ("aileron", "flap"), 2: ("aileron",)}.get(which, ()) if servo else OF_UNITS[unit]
            faults = {0: None} | (SERVOS if servo else INSTRUMENTS)
            if not places or kind not in faults:
                assert (result, done) == (3, [])
                assert says == f"unit {unit}, type {kind}, number {which}: nothing of this aircraft"
            elif kind == 0:
                assert (result, says) == (0, f"{', '.join(places)}: repaired")
                assert done == [*(places if servo else (f"sensor {place}" for place in places))]
            else:
                words = faults[kind]["type"].replace("_", " ")
                assert (result, says) == (0, f"{', '.join(places)}: {words}")
                assert done == [
                    {"actuator" if servo else "sensor": place, **faults[kind]} for place in places
                ]
    assert failures.inject(sim, channels, (2e6, 1.0, 0.0))[0] == 3
    assert failures.inject(sim, channels, (float("inf"), 1.0, 0.0))[1].startswith("unit -1, ")


def test_a_ground_station_has_a_heartbeat_a_second_texts_and_its_commands_done():
    def received():
        found = []
        while select.select([station], [], [], 0.0)[0]:
            found += common.MAVLink(None).parse_buffer(station.recv(4096))
        return found

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        line = GroundLine(*station.getsockname())
        asked = []

        def inject(params):
            asked.append(params)
            return 2, f"done {len(asked)}"

        times = [
            t_s for t_s in (0.0, 0.5, 0.99, 1.0, 1.5, 2.0, 2.4) if not line.serve(t_s, inject) and received()
        ]
        assert times == [0.0, 1.0, 2.0]
        line.say([])
        assert received() == []
        line.say([Text(1.0, 4, "FDI: alarm on q"), Text(1.0, 2, "FDI: flap")])
        said = received()
        assert [(each.severity, each.text) for each in said] == [(4, "FDI: alarm on q"), (2, "FDI: flap")]
        station.connect(("127.0.0.1", socket_port(line)))
        sender = common.MAVLink(None, srcSystem=255, srcComponent=190)
        for which in (3, 4):
            of = (1, 191, 420, 0, 102, 2, which, 0, 0, 0, 0)
            station.send(common.MAVLink_command_long_message(*of).pack(sender))
        assert line.serve(2.5, inject) == ["done 1", "done 2"]
        assert asked == [(102.0, 2.0, 3.0), (102.0, 2.0, 4.0)]
        acks = [(each.command, each.result, each.target_system) for each in received()]
        assert acks == [(420, 2, 255)] * 2
        assert line.serve(9.0, inject) == []
        (beat,) = received()
        kind = (beat.type, beat.autopilot, beat.base_mode, beat.custom_mode, beat.system_status)
        assert kind == (common.MAV_TYPE_ONBOARD_CONTROLLER, common.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 191)
        line.close()
        assert line.fileno() == -1


def socket_port(line):
    return line._socket.getsockname()[1]
