"""What guests may do, attacked: each kind of request, names, tokens of others, too much and again."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_site import EVERYTHING, Site, says

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages, server


@pytest.fixture
def site(monkeypatch):
    monkeypatch.setattr(server, "SLOW_S", 0.0)
    return Site()


def answers(told):
    """What was acknowledged: (ok, words)."""
    heard = [json.loads(message["text"]) for message in told if "text" in message]
    return [(each["ok"], each["says"]) for each in heard if each["k"] == "ack"]


def as_guest(site, *said, **more):
    return site.talk(*said, cookie=site.keys[0], seat=site.gate.guests[0], **more)


ENTERED = [(0, "joined 1"), (0, "called 1 guest 1")]


@pytest.mark.parametrize("invited", [False, True])
@pytest.mark.parametrize("do", sorted(set(EVERYTHING) - {"name"}))
def test_a_guest_who_is_invited_breaks_and_has_no_other_say(site, do, invited):
    site.gate.invite(1, on=invited)
    told = as_guest(site, says(do=do, n=7, **EVERYTHING[do]))
    reached = [text for page, text in site.asked if page]
    assert len(reached) == (invited and do in ("break", "repair", "blow"))
    assert [ok for ok, _ in answers(told)] == [False] * (1 - len(reached))
    assert all(words.startswith(f"{do}: ") for _, words in answers(told)) or invited
    assert [each for each in site.asked if not each[0]] == [*ENTERED, (0, "left 1")]
    assert (site.said, site.gate.guests[1].is_invited) == ([], False)


@pytest.mark.parametrize(
    ("name", "taken"),
    [
        ("  Ada   Lovelace ", "Ada Lovelace"), ("A\nB", "A B"), ("</script><b onload=x>",) * 2,
        ("x" * 25, None), ("   ", None), ("a\u202eb", None), ("\ue000", None), (7, None),
        ("\u0e17\u0e35\u0e48",) * 2, ("a\u0336\u0301\u035a", None), ("\u3164", None),
    ],
)  # fmt: skip
def test_names(site, name, taken):
    as_guest(site, says(do="name", name=name))
    assert site.gate.guests[0].name == (taken or "")
    called = [text for page, text in site.asked if text.startswith("called")]
    assert called[1:] == ([f"called 1 {taken} (guest 1)"] if taken else [])


def test_nobody_passes_for_another_guest(site):
    for key, seat in zip(site.keys, site.gate.guests, strict=True):
        site.talk(says(do="name", name="Ada (guest 1)"), cookie=key, seat=seat)
    assert [seat.label for seat in site.gate.guests] == ["Ada (guest 1) (guest 1)", "Ada (guest 1) (guest 2)"]


def test_what_opens_one_seat_opens_no_other(site):
    seats, keys = (site.gate.flyer, *site.gate.guests), (site.key, *site.keys)
    for i, seat in enumerate(seats):
        for j, key in enumerate(keys):
            assert site.get(f"{seat.room}/", cookie=key)[0] == (200 if i == j else 403)
            assert site.get(f"{seat.room}/static/js/main.js", cookie=key)[0] == (200 if i == j else 403)
            told = site.talk(cookie=key, seat=seat)
            assert (told[0]["type"] == "websocket.accept") == (i == j)
    assert site.gate.wrong == 3 * 6


def test_anothers_token_on_ones_own_path_opens_nothing(site):
    one, other = site.gate.guests
    token = other.token()
    for seat in (one, site.gate.flyer):
        status, headers, _ = site.get(f"{seat.room}/", f"token={token}")
        assert (status, "set-cookie" in headers) == (403, False)
    assert site.get(f"{other.room}/socket", f"token={token}")[0] == 403
    for again in range(2):  # and its own guest comes back by it
        status, headers, _ = site.get(f"{other.room}/", f"token={token}")
        assert (status, headers["set-cookie"].startswith(site.keys[1])) == (303, True), again


def test_whoever_tries_tokens_waits_and_whoever_has_one_does_not(monkeypatch):
    site, waited = Site(), []

    async def sleep(seconds):
        waited.append(seconds)

    monkeypatch.setattr(server.asyncio, "sleep", sleep)
    room = site.gate.guests[0].room
    assert site.get(f"{room}/", "token=wrong")[0] == 403
    assert [seconds for seconds in waited if seconds] == [1.0]
    waited.clear()
    assert site.get(f"{room}/", f"token={site.gate.guests[0].token()}")[0] == 303
    assert not any(waited)


@pytest.mark.parametrize(
    "path",
    ["static/../../server.py", "static/%2e%2e/server.py", "static/js/../../../gate.py", "static//etc/passwd",
     "../", "static/js", "socket", "runs", "..%2f", "static/\0"],
)  # fmt: skip
def test_a_guest_reaches_the_pages_files_alone(site, path):
    room = site.gate.guests[0].room
    status, _, body = site.get(f"{room}/{path}", cookie=site.keys[0])
    assert status in (403, 404)
    assert b"import" not in body


@given(st.text(max_size=40))
def test_a_name_is_one_short_line_that_says_whose_it_is(name):
    try:
        request = messages.parse(json.dumps({"do": "name", "name": name}))
    except BadInput:
        return
    assert 0 < len(request.name) <= 24
    assert request.name.isprintable()
    assert request.name == request.name.strip()
