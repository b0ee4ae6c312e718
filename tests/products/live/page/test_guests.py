"""A class from outside: its links, who breaks what, who comes back, who is slow, and at which address."""

import contextlib
import socket
import time

import pytest
from live_cockpit import Seat, ended, own_address, started, status, until
from websockets.exceptions import InvalidStatus

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import serve
from beaver_ftc_live.page.serve import Place


@pytest.fixture(scope="module")
def cockpit(tmp_path_factory):
    """A class of four; whoever flies has taken the first link."""
    running = started(tmp_path_factory.mktemp("class"), "--guests", "4")
    running.links = [running.process.stdout.readline().split()[-1] for _ in range(4)]
    running.seat = Seat(running.address)
    yield running
    assert ended(running) == (0, "")


def test_a_guest_who_takes_nothing_holds_nobody_up(cockpit):
    """Its socket is opened and never read: the flight keeps its pace, the others their frames."""
    seat = Seat(cockpit.links[2])
    with contextlib.ExitStack() as pages:
        flyer = pages.enter_context(cockpit.seat.open())
        until(flyer, "f")
        host, _, rest = seat.home.removeprefix("http://").partition("/")
        for _ in range(3):
            idle = pages.enter_context(socket.create_connection(("127.0.0.1", cockpit.port)))
            idle.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            idle.sendall(
                f"GET /{rest}socket HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n"
                f"Cookie: {seat.cookie}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                "Sec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
            )
            assert idle.recv(12) == b"HTTP/1.1 101"
        until(flyer, "class", having=lambda told: told["guests"][2]["pages"] == 3)
        from_s, frames = time.monotonic(), 0
        start_s = until(flyer, "f")["v"][0]
        while frames < 60:
            now_s, frames = until(flyer, "f")["v"][0], frames + 1
        took_s = time.monotonic() - from_s
        assert now_s - start_s == pytest.approx(took_s, rel=0.5)


@pytest.mark.parametrize("host", ["0.0.0.0", "own", "::1"])
def test_it_is_reached_at_the_address_given_and_by_its_name_alone(tmp_path, host):
    shown = {"::1": "[::1]"}.get(host, own_address())
    if shown is None:
        pytest.skip("this machine has no other address")
    running = started(tmp_path, "--host", own_address() if host == "own" else host, "--guests", "1")
    try:
        (link, *_) = [running.process.stdout.readline().split()[-1]]
        assert link.startswith(f"http://{shown}:{running.port}/")
        means = running.process.stdout.readline()
        assert ("is no loopback" in means) == (host in ("0.0.0.0", "own"))
        seat, flyer = Seat(link), Seat(running.address)
        with flyer.open() as one, seat.open() as other:
            assert until(one, "class", having=lambda told: told["guests"][0]["pages"] == 1)
            assert until(other, "you")["number"] == 1
        for name in ("evil.example", f"{shown}.evil.example", "192.0.2.77", "[2001:db8::77]"):
            assert status(seat.home, Cookie=seat.cookie, Host=f"{name}:{running.port}") == 421
            for origin in (f"http://{name}:{running.port}", "null", f"https://{shown}:{running.port}"):
                with pytest.raises(InvalidStatus):
                    seat.open(origin=origin)
        policy = seat.page.headers["content-security-policy"]
        assert f"connect-src 'self' ws://{shown}:{running.port};" in policy
        if host == "own":
            assert not can_connect("127.0.0.1", running.port)
        if host == "0.0.0.0":  # other addresses that it has will do, each by its own name
            other = seat.home.replace(shown, "127.0.0.1")
            assert status(other, Cookie=seat.cookie) == 200
            assert status(other, Cookie=seat.cookie, Host=f"{shown}:{running.port}") == 200
    finally:
        assert ended(running) == (0, "")


def can_connect(host, port):
    with socket.socket() as probe:
        probe.settimeout(2.0)
        return probe.connect_ex((host, port)) == 0


@pytest.mark.parametrize(
    ("host", "says"),
    [
        ("192.0.2.77", "192.0.2.77 is no address of this machine"), ("2001:db8::77", "is no address of"),
        ("1", "1 is no address of this machine"), ("", "'' is no address"), ("x.invalid", "is no address"),
        ("a b", "'a b' is no address"), ("224.0.0.1", "is none that a browser can open"),
        ("255.255.255.255", "is none that a browser can open"),
        ("fe80::1", "is none that a browser can open"), ("1.2.3.4:80", "'1.2.3.4:80' is no address"),
        ("http://127.0.0.1", "is no address"),
    ],
)  # fmt: skip
def test_an_address_that_cannot_be_had_is_said_in_a_line(host, says):
    with pytest.raises(BadInput) as refused, serve._listening(Place(host=host)):
        pytest.fail("it listens")
    (line,) = str(refused.value).splitlines()
    assert line.startswith("--host: ")
    assert says in line
    assert "allowed: one that it has, 0.0.0.0 for all of them" in line


@pytest.mark.parametrize(
    ("host", "names"),
    [
        ("127.0.0.1", ("127.0.0.1", "localhost")), ("127.3.2.1", ("127.3.2.1", "localhost")),
        ("LocalHost", ("localhost", "127.0.0.1")),
        ("0.0.0.0", ("198.51.100.9", "127.0.0.1", "localhost")),
        ("::", ("198.51.100.9", "127.0.0.1", "localhost")), ("::1", ("[::1]", "localhost")),
    ],
)  # fmt: skip
def test_by_which_names_it_is_called(host, names, monkeypatch):
    monkeypatch.setattr(serve, "_outward", lambda: "198.51.100.9")
    found = [(socket.AF_INET, 0, 0, "", ("127.0.0.1", 0))]
    if host == "LocalHost":  # a name may have addresses of both kinds
        monkeypatch.setattr(serve.socket, "getaddrinfo", lambda *_, **__: found)
    with serve._listening(Place(host=host)) as listener:
        assert serve.names_of(listener, host) == names
        if listener.family == socket.AF_INET6:  # every address: of both kinds, else those of its own
            takes_one_kind = listener.getsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY)
            assert bool(takes_one_kind) is (host != "::")


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "0.0.0.0", "::"])
def test_a_port_in_use_is_said_whatever_the_address(host):
    with serve._listening(Place(host=host)) as listener:
        listener.listen()
        port = listener.getsockname()[1]
        says = f"^--port: {port} cannot be had .Address already in use., allowed: another, 0 for any$"
        with pytest.raises(BadInput, match=says), serve._listening(Place(port, host)):
            pytest.fail("two servers have one port")
