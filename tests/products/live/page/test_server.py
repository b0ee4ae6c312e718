"""The server from outside: who gets in, what can be reached, how it ends."""

import contextlib
import json
import signal
import subprocess

import pytest
from live_cockpit import Seat, ended, status, until
from websockets.exceptions import ConnectionClosed, InvalidStatus

from beaver_ftc_live.page import messages
from beaver_ftc_live.page.gate import MAX_PAGES
from commands import beaver


@pytest.fixture(scope="module")
def seat(cockpit):
    """What the address's one use has yielded."""
    seat = Seat(cockpit.address)
    assert seat.jar.path == cockpit.home.split(str(cockpit.port))[1].rstrip("/")
    assert seat.jar.has_nonstandard_attr("HttpOnly")
    return seat


def answer(link, **request):
    link.send(json.dumps({"n": 1, **request}))
    return until(link, "ack")


def test_without_the_cookie_nothing_is_served_and_the_address_works_once(cockpit, seat):
    script = f"{cockpit.home}static/js/main.js"
    assert [status(place) for place in (cockpit.address, cockpit.home, script)] == [403] * 3
    assert status(script, Cookie=seat.cookie) == 200
    assert status(cockpit.home, Cookie=seat.cookie.partition("=")[0] + "=guess") == 403
    assert status(f"{cockpit.home}static/..%2fserver.py", Cookie=seat.cookie) in (403, 404)


def test_two_pages_look_on_and_nonsense_harms_neither(seat):
    with seat.open() as one, seat.open() as other:
        columns = until(one, "hello")["columns"]
        assert len(until(other, "f")["v"]) == len(columns)
        says = answer(one, do="open", path="/etc/passwd")
        assert not says["ok"]
        assert not answer(one, do="break", fault={"type": "stuck", "actuator": "nose"})["ok"]
        assert answer(one, do="speed", times=2)["ok"]
        before = until(other, "f")["v"][0]
        assert until(other, "f")["v"][0] >= before


def say_too_much(link):
    link.send("x" * (messages.MAX_BYTES + 1))
    for _ in range(1000):
        link.recv(timeout=5.0)


def test_a_message_beyond_the_limit_ends_that_page_alone(seat):
    with seat.open() as well_behaved:
        with seat.open() as greedy, pytest.raises(ConnectionClosed):
            say_too_much(greedy)
        assert until(well_behaved, "f")


NONSENSE = [
    "", "{", "null", "[" * 2000, '{"do": "pause", "on": "maybe"}',
    '{"do": "stick", "rates_deg_s": [NaN, 0, 0]}',
    '{"do": "stick", "rates_deg_s": [1e999, 0, 0]}', '{"do": "aim", "altitude_m": Infinity}',
    '{"do": "break", "fault": {"type": "bias", "actuator": "rudder", "bias_deg": NaN}}',
    '{"do": "break", "fault": {}}', '{"do": "break", "fault": {"type": "bias", "at_s": 1}}',
    '{"do": "repair", "actuator": "nose"}', '{"do": "blow", "velocity_mps": [1e9, 0, 0]}',
    '{"do": "change", "law": "nothing"}', '{"do": "change"}', '{"do": "fresh", "law": "\\u0000"}',
    '{"do": "game", "move": "answer"}', '{"do": "speed", "times": true, "n": 1e400}', "é" * 900,
    '{"do": "\\ud800"}',
]  # fmt: skip


def test_nonsense_is_refused_in_a_line_each_and_the_flight_goes_on(seat):
    with seat.open() as link:
        before = until(link, "f")["v"][0]
        for text in NONSENSE:
            link.send(text)
            says = until(link, "ack", timeout_s=60.0)
            assert not says["ok"], text
            assert 0 < len(says["says"]) < 400
            assert "\n" not in says["says"]
        assert until(link, "s")["broken"] == []
        while until(link, "f")["v"][0] <= before:
            pass


def test_there_is_room_for_twenty_pages_and_again_when_one_leaves(seat):
    with contextlib.ExitStack() as pages:
        links = [pages.enter_context(seat.open()) for _ in range(MAX_PAGES)]
        assert until(links[-1], "hello")
        with pytest.raises(InvalidStatus):
            seat.open()
        while until(links[0], "s")["pages"] != MAX_PAGES:
            pass
        links[1].close()
        while until(links[0], "s")["pages"] == MAX_PAGES:
            pass
        assert until(pages.enter_context(seat.open()), "hello")


def test_a_flight_that_cannot_be_trimmed_ends_it_in_a_line(tmp_path):
    (tmp_path / "slow.yaml").write_text("name: slow\ninitial: {airspeed_mps: 20}\n")
    done = beaver("live", "slow.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("slow: no steady straight flight at 20 m/s")


def test_it_ends_cleanly_with_a_page_open(cockpit, seat):
    with seat.open() as link:
        until(link, "f")
        assert ended(cockpit, signal.SIGTERM) == (0, "")
    children = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(cockpit.process.pid)], capture_output=True, text=True, check=False
    )
    assert children.stdout.split() == []
