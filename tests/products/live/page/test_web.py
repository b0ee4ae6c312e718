"""The web side without a network: requests and websockets handed to the application as a server does."""

import asyncio
import socket

import pytest
from live_site import HOST, Site, says

from beaver_ftc_live.page import serve, server
from beaver_ftc_live.page.gate import Seat
from beaver_ftc_live.page.serve import Place
from beaver_ftc_live.page.server import STATIC, Page


@pytest.fixture
def site():
    return Site()


def test_the_token_of_an_address_becomes_a_cookie_once(site):
    room, token = site.gate.flyer.room, site.token()
    status, headers, _ = site.get(f"{room}/", f"token={token}")
    assert (status, headers["location"]) == (303, f"{room}/")
    assert headers["set-cookie"] == f"{site.key}; HttpOnly; Path={room}; SameSite=lax"
    status, headers, body = site.get(f"{room}/", f"token={token}")
    assert (status, "set-cookie" in headers, b"has been used" in body) == (403, False, True)
    (again,) = site.said  # in the terminal, for whoever closed the browser
    assert site.get(f"{room}/", again.partition("?")[2])[0] == 303
    status, headers, _ = site.get(f"{room}/", f"token={token}", cookie=site.key)
    assert (status, "set-cookie" in headers) == (303, False)  # who is in already is only led to the page
    assert site.get(f"{room}/static/js/main.js", f"token={site.token()}")[0] == 403


def test_the_page_and_its_files_with_what_it_may_do(site, changed):
    room = site.gate.flyer.room
    status, headers, body = site.get(f"{room}/", cookie=site.key)
    assert (status, body) == (200, (STATIC / "index.html").read_bytes())
    assert not changed({name: headers[name] for name in server.HEADERS})
    assert site.get(f"{room}/static/js/main.js", cookie=site.key)[0] == 200


def test_secrets_are_of_12_24_and_32_bytes_in_base64(site):
    assert len(site.gate.flyer.room) == 1 + 12 * 4 // 3
    assert len(site.token()) == 24 * 4 // 3
    assert len(site.key.partition("=")[2]) == -(-32 * 4 // 3)


@pytest.mark.parametrize(
    ("key", "origin", "others"),
    [(False, f"http://{HOST}", 0), (True, "http://127.0.0.1:1", 0), (True, f"http://{HOST}", 20)],
)
def test_a_socket_is_refused(site, key, origin, others):
    for _ in range(others):
        site.pages.add(None, site.gate.flyer)
    told = site.talk(cookie=site.key if key else None, origin=origin)
    assert [(message["type"], message["code"]) for message in told] == [("websocket.close", 4403)]
    assert (site.asked, len(site.pages)) == ([], others)


def test_a_binary_message_ends_it(site):
    told = site.talk({"type": "websocket.receive", "bytes": b"\0"}, says(do="save"), cookie=site.key)
    assert told[-1] == {
        "type": "websocket.close", "code": 1003, "reason": "a binary message, allowed: JSON as text",
    }  # fmt: skip
    assert site.asked == [(0, "joined 1"), (0, "left 1")]


class Socket:
    """Takes what it is sent; slow: only when it is let."""

    def __init__(self):
        self.sent = []

    async def send_text(self, text):
        self.sent.append(text)


def _sent(*told):
    async def sending():
        socket = Socket()
        page = Page(1, socket, Seat())
        for each in told:
            page.tell(each)
        task = asyncio.create_task(page.send())
        for _ in range(5):
            await asyncio.sleep(0)
        done = task.done()
        task.cancel()
        return socket.sent, done

    return asyncio.run(sending())


EVENT, HELLO = b'{"k":"e"}', b'{"k":"hello"}'


def test_a_page_that_takes_nothing_is_let_go():
    assert _sent(*[EVENT] * 999)[1] is False
    assert _sent(*[EVENT] * 1000) == ([], True)


def test_a_port_is_had_on_the_loopback_alone():
    with serve._listening(Place()) as listener:
        host, port = listener.getsockname()
        assert (host, port > 0) == ("127.0.0.1", True)
        assert listener.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)
    assert listener.fileno() == -1
