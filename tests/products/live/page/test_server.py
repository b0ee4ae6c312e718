"""The server from outside: who gets in, what can be reached, how it ends."""

import contextlib
import json
import signal
import subprocess
import time
import urllib.error
import urllib.request

import pytest
from live_cockpit import browser, ended, started
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from beaver_ftc_live.page import messages
from beaver_ftc_live.page.gate import MAX_PAGES


@pytest.fixture(scope="module")
def cookie(cockpit):
    """What the address's one use has yielded: NAME=VALUE."""
    opener, jar = browser()
    page = opener.open(cockpit.address)
    assert page.status == 200
    assert page.geturl() == cockpit.home  # the token is gone from the address
    (only,) = jar
    assert only.path == cockpit.home.split(str(cockpit.port))[1].rstrip("/")
    assert only.has_nonstandard_attr("HttpOnly")
    return f"{only.name}={only.value}"


def status(address, **headers):
    """The HTTP status of a GET."""
    try:
        return urllib.request.urlopen(urllib.request.Request(address, headers=headers)).status
    except urllib.error.HTTPError as error:
        return error.code


def opened(cockpit, cookie, origin=None, host=None):
    """The page's websocket."""
    address = f"ws://127.0.0.1:{cockpit.port}"
    headers = {"Cookie": cookie} if cookie else {}
    place = cockpit.home.split(str(cockpit.port))[1]
    return connect(
        f"{address}{place}socket", origin=origin or f"http://127.0.0.1:{cockpit.port}",
        additional_headers=headers, max_size=None, max_queue=None,
    )  # fmt: skip


def until(link, kind, timeout_s=600.0):
    """The next message of a kind; a machine on which nothing has flown yet compiles first."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        told = json.loads(link.recv(timeout=timeout_s))
        if told["k"] == kind:
            return told
    raise AssertionError(f"no {kind}")


def answer(link, **request):
    link.send(json.dumps({"n": 1, **request}))
    return until(link, "ack")


def test_without_the_cookie_nothing_is_served(cockpit, cookie):
    assert status(cockpit.home) == 403
    assert status(f"{cockpit.home}static/js/main.js") == 403
    assert status(f"{cockpit.home}static/js/main.js", Cookie=cookie) == 200
    assert status(cockpit.home, Cookie=cookie.partition("=")[0] + "=guess") == 403


@pytest.mark.parametrize(
    "path",
    [
        "static/../../../pyproject.toml",
        "static/%2e%2e/%2e%2e/server.py",
        "static/..%2fserver.py",
        "static//etc/passwd",
        "static/js",
        "docs",
        "openapi.json",
        "../",
    ],
)
def test_only_the_pages_own_files_can_be_reached(cockpit, cookie, path):
    assert status(cockpit.home + path, Cookie=cookie) in (403, 404)


def test_two_pages_look_on_and_nonsense_harms_neither(cockpit, cookie):
    with opened(cockpit, cookie) as one, opened(cockpit, cookie) as other:
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


def test_a_message_beyond_the_limit_ends_that_page_alone(cockpit, cookie):
    with opened(cockpit, cookie) as well_behaved:
        with opened(cockpit, cookie) as greedy, pytest.raises(ConnectionClosed):
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


def test_nonsense_is_refused_in_a_line_each_and_the_flight_goes_on(cockpit, cookie):
    with opened(cockpit, cookie) as link:
        before = until(link, "f")["v"][0]
        for text in NONSENSE:
            link.send(text)
            says = until(link, "ack", 60.0)
            assert not says["ok"], text
            assert 0 < len(says["says"]) < 400
            assert "\n" not in says["says"]
        assert until(link, "s")["broken"] == []
        while until(link, "f")["v"][0] <= before:
            pass


def test_there_is_room_for_twenty_pages_and_again_when_one_leaves(cockpit, cookie):
    with contextlib.ExitStack() as pages:
        links = [pages.enter_context(opened(cockpit, cookie)) for _ in range(MAX_PAGES)]
        assert until(links[-1], "hello")
        with pytest.raises(InvalidStatus):
            opened(cockpit, cookie)
        while until(links[0], "s")["pages"] != MAX_PAGES:
            pass
        links[1].close()
        while until(links[0], "s")["pages"] == MAX_PAGES:
            pass
        assert until(pages.enter_context(opened(cockpit, cookie)), "hello")


def test_it_ends_cleanly_with_a_page_open(tmp_path):
    cockpit = started(tmp_path)
    opener, jar = browser()
    opener.open(cockpit.address)
    (only,) = jar
    with opened(cockpit, f"{only.name}={only.value}") as link:
        until(link, "f")
        assert ended(cockpit, signal.SIGTERM) == (0, "")
    children = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(cockpit.process.pid)], capture_output=True, text=True, check=False
    )
    assert children.stdout.split() == []


def test_a_flight_that_cannot_be_trimmed_ends_it_in_a_line(tmp_path):
    (tmp_path / "slow.yaml").write_text("name: slow\ninitial: {airspeed_mps: 20}\n")
    cockpit = started(tmp_path, str(tmp_path / "slow.yaml"))
    _, says = cockpit.process.communicate(timeout=600)
    assert cockpit.process.returncode == 2
    assert says.splitlines()[-1].startswith("slow: no steady straight flight at 20 m/s")
