"""The live page beside an autopilot: it shows the same flight, breaks it and repairs it, and does not fly
it."""

import json
from multiprocessing import Pipe

import pytest

import beaver_ftc as bf
from beaver_ftc_links.sitl.page import Shown, Watched
from beaver_ftc_links.sitl.vehicle import Vehicle
from beaver_ftc_live.page.session import ready_for_hands


class Page:
    """The server's end of the pipe, with one page on it."""

    def __init__(self, vehicle):
        self.pipe, theirs = Pipe()
        self.said = []
        self.shown = Shown(theirs, Watched(vehicle), self.said.append)
        self.pipe.send((0, "joined 1"))

    def ask(self, **request):
        self.pipe.send((1, json.dumps(request)))
        return self.told("ack")[-1]

    def told(self, kind):
        """What is told by the next tick, of this kind."""
        self.shown._next_s = 0.0
        self.shown.tick()
        heard = []
        while self.pipe.poll(0):
            _, message = self.pipe.recv()
            heard.append(json.loads(message))
        return [message for message in heard if message["k"] == kind]


@pytest.fixture
def vehicle():
    return Vehicle(ready_for_hands(bf.load("fault-free").with_({"expect": {}})), pulses=True)


def fly(vehicle, frames):
    for _ in range(frames):
        vehicle.fly([1500, 1600, 0, 1500], 100)


def test_the_page_shows_the_flight_of_the_autopilot(vehicle):
    page = Page(vehicle)
    fly(vehicle, 50)
    (hello,) = page.told("hello")
    assert hello["scenario"] == "fault-free"
    (frame,) = page.told("f")
    values = dict(zip(hello["columns"], frame["v"], strict=True))
    assert values["t_s"] == 0.5
    assert values["elevator_cmd_rad"] == pytest.approx(-0.2 * 0.49)


def test_what_is_broken_there_is_broken_here(vehicle):
    page = Page(vehicle)
    fly(vehicle, 50)
    assert page.ask(do="break", n=1, fault={"type": "stuck", "actuator": "rudder"})["says"] == "rudder broken"
    fly(vehicle, 50)
    assert vehicle.flight.read("failures/rudder/stuck") == 1.0
    assert [fault.type for fault in vehicle.flight.in_force] == ["stuck"]
    assert page.ask(do="repair", n=2, actuator="rudder")["ok"]
    fly(vehicle, 2)
    assert vehicle.flight.in_force == ()


def test_the_autopilot_flies_not_the_page(vehicle):
    page = Page(vehicle)
    for n, request in enumerate(
        ({"do": "pause", "on": True}, {"do": "speed", "times": 2}, {"do": "fresh"}, {"do": "save"}), 1
    ):
        answer = page.ask(n=n, **request)
        assert not answer["ok"]
        assert answer["says"] == f"{request['do']}: not under an autopilot, allowed: break, repair, blow"
