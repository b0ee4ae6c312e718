import socket
import struct

import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc_links.flightgear import paced, show_in_flightgear
from flying import loss, scenario


@pytest.fixture
def listener():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(0.2)
        yield opened


def _packets(listener):
    """(version, longitude rad, latitude rad, altitude m) of each packet [FlightGear, net_fdm.hxx]."""
    found = []
    try:
        while True:
            found.append(struct.unpack(">I4xddd", listener.recv(4096)[:32]))
    except TimeoutError:
        return found


def test_flight_is_sent_as_it_is_flown_and_is_the_same_flight(listener):
    case = scenario(duration_s=1.0, faults=[loss(at_s=0.5)])
    port = listener.getsockname()[1]
    shown = fly(case, prepare=lambda plant: show_in_flightgear(plant, "127.0.0.1", port))
    packets = _packets(listener)
    assert 45 <= len(packets) <= 60
    assert {packet[0] for packet in packets} == {24}
    assert packets[-1][2] == pytest.approx(0.7854, abs=1e-3)
    assert packets[-1][3] == pytest.approx(1828.8, abs=30)
    plain = fly(case)
    assert shown.pre_fault_rms_rad_s == plain.pre_fault_rms_rad_s
    assert shown.detection_time_s == plain.detection_time_s


def test_nobody_listening_is_no_trouble_and_no_noise(capfd):
    fly(scenario(duration_s=0.5), prepare=lambda plant: show_in_flightgear(plant, "127.0.0.1", 9))
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")


def test_frames_keep_to_the_clock_and_do_not_catch_up_in_a_burst():
    now, ran_at = [0.0], []

    def sleep(duration):
        now[0] += duration

    run = paced(lambda: ran_at.append(now[0]), 0.1, clock=lambda: now[0], sleep=sleep)
    for _ in range(3):
        run()
    now[0] += 1.0
    run()
    run()
    assert ran_at == pytest.approx([0.1, 0.2, 0.3, 1.3, 1.4])
