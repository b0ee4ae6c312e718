"""The web side without a network: requests and websockets handed to the application as a server does."""

import pytest
from live_site import HOST, Site, says


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
