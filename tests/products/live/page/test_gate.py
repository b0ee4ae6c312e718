"""Who is let in, and what each may ask."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_site import EVERYTHING
from starlette.datastructures import Headers

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.gate import BURST, MESSAGES_PER_S, Gate, Seat


def may(seat, do):
    assert messages.parse(json.dumps({"do": do, **EVERYTHING[do]})).do == do
    try:
        seat.check(do)
    except BadInput as error:
        return not str(error).startswith(f"{do}: ")
    return True


def test_who_may_ask_what():
    kinds = messages.Request.__subclasses__()
    assert set(EVERYTHING) == {kind.model_fields["do"].annotation.__args__[0] for kind in kinds}
    gate = Gate(8000, guests=2)
    one, two = gate.guests
    gate.invite(1, on=True)
    assert {do for do in EVERYTHING if may(gate.flyer, do)} == set(EVERYTHING) - {"name"}
    assert {do for do in EVERYTHING if may(one, do)} == {"name", "break", "repair", "blow"}
    assert {do for do in EVERYTHING if may(two, do)} == {"name"}
    gate.invite(None, on=True)
    assert may(two, "break")
    gate.invite(2, on=False)
    assert [may(one, "break"), may(two, "break")] == [True, False]


@given(st.lists(st.floats(0, 30), min_size=1, max_size=200))
def test_a_guest_cannot_keep_the_flight_busy(times_s):
    """Whenever it asks: in any time t no more than a burst and the pace times t are let through."""
    seat, let = Seat(1), []
    seat._at_s = 0.0
    for at_s in sorted(times_s):
        try:
            seat.check_pace(at_s)
        except BadInput:
            continue
        let.append(at_s)
    for i, first in enumerate(let):
        for j in range(i, len(let)):
            assert j - i + 1 <= BURST + MESSAGES_PER_S * (let[j] - first) + 1e-6


@pytest.mark.parametrize(
    ("names", "any_own", "host", "own"),
    [
        (("192.0.2.7",), False, "192.0.2.7:8000", True), (("192.0.2.7",), False, "192.0.2.8:8000", False),
        (("192.0.2.7",), False, "127.0.0.1:8000", False), (("192.0.2.7",), False, "localhost:8000", False),
        (("192.0.2.7",), False, "192.0.2.7", False), (("192.0.2.7",), False, "192.0.2.7:80", False),
        (("192.0.2.7",), False, "192.0.2.7:8000:8000", False), (("192.0.2.7",), False, "", False),
        (("[fd00::2]",), False, "[fd00::2]:8000", True), (("[fd00::2]",), False, "fd00::2:8000", False),
        (("lab", "192.0.2.7"), False, "lab:8000", True),
        (("lab", "192.0.2.7"), False, "192.0.2.7:8000", True),
        (("lab", "192.0.2.7"), False, "lab.evil.example:8000", False),
        (("192.0.2.7",), True, "192.0.2.9:8000", True),  # which the request came to
        (("192.0.2.7",), True, "evil.example:8000", False), (("192.0.2.7",), True, "192.0.2.8:8000", False),
    ],
)  # fmt: skip
def test_it_is_called_by_the_address_it_was_given(names, any_own, host, own):
    """A name that somebody made resolve to the address is none of it."""
    gate = Gate(8000, names, any_own=any_own)
    headers = Headers({"host": host, "origin": f"http://{host}"})
    assert gate.is_addressed(headers, "192.0.2.9") is own
    assert gate.is_own_page(headers, "192.0.2.9") is own
    assert not gate.is_own_page(Headers({"host": host, "origin": "http://evil.example"}), "192.0.2.9")


@pytest.mark.parametrize(
    ("host", "origin", "own"),
    [
        ("127.0.0.1:8000", "http://127.0.0.1:8000", True),
        ("localhost:8000", "http://localhost:8000", True),
        ("127.0.0.1:8000", "http://127.0.0.1:8001", False),
        ("127.0.0.1:8000", "http://localhost:8000", False),
        ("127.0.0.1:8000", "https://127.0.0.1:8000", False),
        ("127.0.0.1:8000", "null", False),
        ("127.0.0.1:8000", None, False),
        ("evil.example:8000", "http://evil.example:8000", False),
    ],
)
def test_only_its_own_page_by_its_own_name(host, origin, own):
    headers = {"host": host} | ({"origin": origin} if origin else {})
    assert Gate(8000).is_own_page(Headers(headers)) is own
