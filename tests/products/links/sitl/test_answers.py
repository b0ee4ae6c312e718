"""ArduPilot's packets and answers: both forms, and the reader on the other side."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tools.autopilots.reader import read

from beaver_ftc_links.sitl.ardupilot import decoded, encoded
from beaver_ftc_links.sitl.vehicle import Instant

NUMBER = st.floats(-1e6, 1e6)
THREE = st.tuples(NUMBER, NUMBER, NUMBER)
INSTANTS = st.builds(
    Instant, st.floats(0, 1e6), THREE, THREE, THREE, NUMBER, NUMBER, NUMBER, NUMBER, THREE, THREE,
    NUMBER, NUMBER, NUMBER, THREE,
)  # fmt: skip


@pytest.mark.parametrize(("magic", "channels"), [(18458, 16), (29569, 32)])
def test_both_forms_of_a_packet(magic, channels):
    pulses = tuple(range(1000, 1000 + channels))
    datagram = struct.pack(f"<HHI{channels}H", magic, 400, 70_000, *pulses)
    assert len(datagram) == 8 + 2 * channels
    assert decoded(datagram) == (400, 70_000, pulses)


@given(st.binary(max_size=120))
def test_what_is_no_packet_is_none(noise):
    known = {18458: 40, 29569: 72}
    is_one = len(noise) > 8 and known.get(struct.unpack_from("<H", noise)[0]) == len(noise)
    assert (decoded(noise) is not None) == is_one


@given(INSTANTS)
def test_the_reader_of_the_protocol_reads_what_was_meant(now):
    values = read(encoded(now))
    meant = {
        "timestamp": (now.t_s,), "imu/gyro": now.gyro, "imu/accel_body": now.force, "position": now.position,
        "attitude": now.attitude, "velocity": now.velocity, "rng_1": (-now.position[2],),
        "windvane/direction": (now.beta_rad,), "windvane/speed": (now.airspeed_mps,),
        "airspeed": (now.airspeed_mps,),
    }  # fmt: skip
    assert values == meant


def test_the_reader_takes_the_last_whole_line():
    one, other = encoded(INSTANT), encoded(INSTANT._replace(t_s=2.0))
    assert read(one + other)["timestamp"] == (2.0,)


INSTANT = Instant(
    1.0, (0.1, -0.25, 1e-9), (0.5, -0.0, -9.80665), (0.01, 0.2, 6.2), 45.5, -0.01, 1040.0, 1829.0,
    (10.0, -3.0, -1829.0), (44.0, 1.0, -0.5), 45.0, 1e-7, 1829.0, (0.0, 0.1, 0.2),
)  # fmt: skip
