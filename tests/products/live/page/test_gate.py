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


OWN = {  # names that it has: those it is called by
    "192.0.2.7": "192.0.2.7:8000", "[fd00::2]": "[fd00::2]:8000", "lab 192.0.2.7": "lab:8000 192.0.2.7:8000",
    "127.0.0.1 localhost": "127.0.0.1:8000 localhost:8000",
}  # fmt: skip
HOSTS = (
    "192.0.2.8:8000 192.0.2.7 192.0.2.7:80 192.0.2.7:8000:8000 fd00::2:8000 lab.evil.example:8000 "
    "evil.example:8000 192.0.2.9:8000"
)


@pytest.mark.parametrize("names", OWN)
def test_it_is_called_by_the_address_it_was_given(names):
    """A name that somebody made resolve to the address is none of it; a page is its own by the same name."""
    known = {host for hosts in OWN.values() for host in hosts.split()} | {"", *HOSTS.split()}
    gate, own = Gate(8000, tuple(names.split())), OWN[names].split()
    for host in known:
        headers = Headers({"host": host, "origin": f"http://{host}"})
        assert gate.is_addressed(headers, "192.0.2.9") is (host in own), host
        assert gate.is_own_page(headers, "192.0.2.9") is (host in own), host
    for origin in ("http://127.0.0.1:8001", f"https://{own[0]}", "http://evil.example", "null", None):
        headers = {"host": own[0]} | ({"origin": origin} if origin else {})
        assert not gate.is_own_page(Headers(headers), "192.0.2.9"), origin
    open_to_all = Gate(8000, tuple(names.split()), any_own=True)  # by the address that the request came to
    for host, its in (("192.0.2.9:8000", True), ("evil.example:8000", False), ("192.0.2.8:8000", False)):
        assert open_to_all.is_addressed(Headers({"host": host}), "192.0.2.9") is its
