"""Both protocols in lockstep: what is flown once, answered again, ignored; and when a flight begins anew."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tools.autopilots import peers, trial
from tools.autopilots.reader import read

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import body_axes
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.mavlink import Mavlink
from beaver_ftc_links.sitl.px4 import Px4, gps, quaternion, sensor, state
from beaver_ftc_links.sitl.vehicle import Instant
from samples import samples
from telling import apart

ZERO = (0.0, 0.0, 0.0)


class Stub:
    """A body without a flight: it counts. refuses: rates it cannot be flown at."""

    def __init__(self, rate_hz=400.0):
        self.packets_hz, self.frames, self.begun, self.given = rate_hz, 0, 0, []
        self.over = False

    def begin(self, packets_hz, channels=16):
        if packets_hz < 20:
            raise BadInput(f"{packets_hz} Hz, allowed: 20 to 4000")
        self.packets_hz, self.frames, self.begun = packets_hz, 0, self.begun + 1

    def fly(self, outputs, frame_hz, in_charge=True):
        self.frames += 1
        self.given.append((tuple(outputs), frame_hz, in_charge))

    def instant(self):
        t_s = self.frames / self.packets_hz
        return Instant(t_s, ZERO, ZERO, ZERO, 45.0, 0.0, 1e3, 1e3, ZERO, ZERO, 45.0, 0.0, 1e3, ZERO)


@pytest.fixture
def ardupilot():
    body, link = Stub(), Link()
    end = Ardupilot(body, link)

    def take(number, peer="it", now_s=0.0, rate_hz=400, channels=16):
        answer = end.take(peers.packet(number, rate_hz, [1500] * 4, channels), peer, now_s)
        return None if answer is None else read(answer)["timestamp"][0]

    return SimpleNamespace(body=body, counts=link.counts, take=take, end=end, link=link)


def test_each_packet_is_answered_with_its_frame(ardupilot):
    assert [ardupilot.take(k) for k in range(4)] == [0.0025, 0.005, 0.0075, 0.01]
    assert ardupilot.take(4, channels=32) == 0.0125
    assert ardupilot.body.begun == 1


@pytest.mark.parametrize("flown", [5, 500])
def test_a_count_begun_anew_begins_the_flight_anew(ardupilot, flown):
    """Long after at once; soon after with the second packet, since a late one would look the same."""
    for k in range(flown):
        ardupilot.take(k)
    answers = [ardupilot.take(0), ardupilot.take(0)]
    assert answers[-1] == 0.0025
    assert (ardupilot.body.begun, ardupilot.counts["resets"]) == (2, 1)


def test_frames_that_never_came_are_counted(ardupilot):
    ardupilot.take(0)
    assert ardupilot.take(4) == 0.005
    assert ardupilot.counts["missed"] == 3


def test_only_the_first_peer_flies_until_it_has_gone(ardupilot):
    for k in range(3):
        ardupilot.take(k, now_s=0.1 * k)
    assert ardupilot.take(3, "other", 0.3) is None
    assert ardupilot.take(0, "other", 0.3) is None
    assert ardupilot.take(7, "other", 9.0) is None  # it has not begun anew
    assert ardupilot.take(0, "other", 9.1) == 0.0025
    assert ardupilot.take(3, "it", 9.2) is None
    assert (ardupilot.counts["strangers"], ardupilot.counts["resets"]) == (4, 1)


def test_a_rate_that_cannot_be_flown_is_complained_of(ardupilot):
    assert ardupilot.take(0, rate_hz=10) is None
    assert ardupilot.end.complaint == "10 Hz, allowed: 20 to 4000"
    assert ardupilot.take(0, rate_hz=50) == 0.02
    assert ardupilot.counts["resets"] == 0


@pytest.fixture
def px4():
    body, link, mavlink = Stub(250.0), Link(), Mavlink()
    end = Px4(body, link, mavlink, lambda params: (0, "done"))
    autopilot = peers.Px4(lambda told: (0.1, 0.2, 0.3, 0.4), silent=0, armed_after=0)
    return SimpleNamespace(body=body, counts=link.counts, end=end, autopilot=autopilot, link=link)


def kinds_of(packed):
    """The kinds of the MAVLink 2 messages in a packet."""
    while packed:
        yield int.from_bytes(packed[7:10], "little")
        packed = packed[12 + packed[1] :]


def test_each_message_comes_at_its_rate_and_what_is_waited_for_last(px4):
    """At 250 Hz: HIL_GPS at 10 Hz, HIL_STATE_QUATERNION at 50 Hz, HIL_SENSOR in each frame."""
    answer, told = px4.autopilot.hear(px4.end.connect(0.0)), []
    for k in range(60):
        sent = px4.end.take(answer, 0.004 * k)
        told.append([kind for kind in kinds_of(sent) if kind in (107, 113, 115)])
        answer = px4.autopilot.hear(sent)
    assert all(kinds[-1] == 107 for kinds in told)
    first = {kind: [k for k, kinds in enumerate(told, 1) if kind in kinds] for kind in (113, 115)}
    assert first == {113: [25, 50], 115: [*range(5, 61, 5)]}


def test_a_new_connection_is_a_new_flight(px4):
    answer = px4.autopilot.hear(px4.end.connect(0.0))
    px4.end.take(answer, 0.0)
    autopilot = peers.Px4(lambda told: (0, 0, 0, 0), silent=0)
    autopilot.hear(px4.end.connect(5.0))
    assert (px4.body.begun, px4.counts["resets"], autopilot.stamps) == (1, 1, [1_000_000])
    assert not px4.end.armed


@settings(max_examples=samples(8), deadline=None)
@given(seed=st.integers(0, 10_000))
@pytest.mark.parametrize("protocol", ["ardupilot", "px4"])
def test_on_a_bad_line_nothing_is_flown_twice_or_lost(protocol, seed):
    found = getattr(trial, protocol)(Stub(), 600, seed, a_flight=120)
    assert (found.frames, found.twice, found.lost) == (600, 0, 0)
    assert len(found.meant) > 2  # a flight has 240 frames at most


ALOFT = Instant(
    12.5, (0.11, -0.23, 0.37), (1.3, -2.9, -9.1), (0.05, 0.21, 6.1), 61.0, -0.04, 1520.0, 3050.0,
    (410.0, -75.0, -2890.0), (58.0, -13.0, 2.5), 45.0036, -0.00095, 2890.0, (0.07, 0.19, 0.6),
)  # fmt: skip


def test_a_state_is_read_again_as_it_was_at_altitude():
    """MAVLink's fields by their names and units; at 3000 m an airspeed is indicated as less than it is."""
    apart(instant=[one for part in ALOFT for one in np.atleast_1d(part) if abs(one) != 2890.0])
    line = Mavlink()
    (read_again,) = line.unpack(line.pack(state(line.messages, ALOFT, 4_000_000)))
    found = read_again.to_dict()
    g = 9.80665
    expected = {
        "time_usec": 4_000_000, "rollspeed": 0.11, "pitchspeed": -0.23, "yawspeed": 0.37,
        "lat": 450036000, "lon": -9500, "alt": 2_890_000, "vx": 5800, "vy": -1300, "vz": 250,
        "ind_airspeed": round(100.0 * np.sqrt(2.0 * 1520.0 / 1.225)), "true_airspeed": 6100,
        "xacc": round(1300 / g), "yacc": round(-2900 / g), "zacc": round(-9100 / g),
    }  # fmt: skip
    assert found.pop("mavpackettype") == "HIL_STATE_QUATERNION"
    assert found.pop("attitude_quaternion") == pytest.approx(quaternion(*ALOFT.true_attitude))
    assert found == pytest.approx(expected)
    (fix,) = line.unpack(line.pack(gps(line.messages, ALOFT, 4_000_000)))
    course = round(100.0 * np.degrees(np.arctan2(-13.0, 58.0))) % 36000
    assert fix.to_dict() == {
        "mavpackettype": "HIL_GPS", "time_usec": 4_000_000, "fix_type": 3, "lat": 450036000, "lon": -9500,
        "alt": 2_890_000, "eph": 30, "epv": 40, "vel": round(100.0 * np.hypot(58.0, 13.0)), "vn": 5800,
        "ve": -1300, "vd": 250, "cog": course, "satellites_visible": 12, "id": 0, "yaw": 0,
    }  # fmt: skip
    (felt,) = line.unpack(line.pack(sensor(line.messages, ALOFT, 4_000_000, True)))
    found = felt.to_dict()
    assert found.pop("mavpackettype") == "HIL_SENSOR"
    dip, east = np.radians(60.5), np.radians(1.2)  # of a field of 0.467 gauss
    north_east_down = np.cos(dip) * np.cos(east), np.cos(dip) * np.sin(east), np.sin(dip)
    field = 0.467 * body_axes(*ALOFT.true_attitude) @ north_east_down
    expected = {
        "time_usec": 4_000_000, "xacc": 1.3, "yacc": -2.9, "zacc": -9.1, "xgyro": 0.11, "ygyro": -0.23,
        "zgyro": 0.37, **dict(zip(("xmag", "ymag", "zmag"), field, strict=True)),
        "abs_pressure": 696.8, "diff_pressure": 15.2, "pressure_alt": 3050.0,
        "temperature": 15.0 - 6.5 * 3.05, "fields_updated": 0b1111111111111, "id": 0,
    }  # fmt: skip
    assert found == pytest.approx(expected, rel=2e-3)
    (felt,) = line.unpack(line.pack(sensor(line.messages, ALOFT, 4_000_000, False)))
    inertial = expected | dict.fromkeys(("xmag", "ymag", "zmag"), 0.0) | {"fields_updated": 0b111111}
    found = felt.to_dict()
    del found["mavpackettype"]
    assert found == pytest.approx(inertial, rel=2e-3)


def test_what_a_field_cannot_hold_is_its_largest():
    """Forces of more than 32 g, speeds of more than 327 m/s (air: 655); no indicated airspeed of a negative
    pressure, no course beyond north."""
    line = Mavlink()
    beyond = ALOFT._replace(force=(400.0, -400.0, 0.0), qdyn_pa=-3.0, velocity=(10.0, -1e-4, 0.0))
    (found,) = line.unpack(line.pack(state(line.messages, beyond, 1)))
    assert (found.xacc, found.yacc, found.zacc, found.ind_airspeed) == (32767, -32768, 0, 0)
    (fix,) = line.unpack(line.pack(gps(line.messages, beyond, 1)))
    assert (fix.cog, fix.vel, fix.vn, fix.ve) == (0, 1000, 1000, 0)
    fast = ALOFT._replace(velocity=(328.0, -400.0, 0.0), airspeed_mps=700.0, qdyn_pa=3e5)
    (found,) = line.unpack(line.pack(state(line.messages, fast, 1)))
    assert (found.vx, found.vy, found.true_airspeed, found.ind_airspeed) == (32767, -32768, 65535, 65535)
    (fix,) = line.unpack(line.pack(gps(line.messages, fast, 1)))
    assert (fix.vn, fix.ve) == (32767, -32768)
