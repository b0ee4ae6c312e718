"""Who is let in."""

import pytest
from starlette.datastructures import Headers

from beaver_ftc.integrations.live.server import TOKENS_OPEN, Gate


def token_of(address):
    return address.rpartition("=")[2]


def test_a_token_works_once():
    gate = Gate(8000)
    token = token_of(gate.invitation())
    session = gate.redeem(token)
    assert gate.knows(session)
    assert gate.redeem(token) is None


@pytest.mark.parametrize("wrong", ["", "x", "é", "a" * 10_000])
def test_nothing_else_opens(wrong):
    gate = Gate(8000)
    gate.invitation()
    assert gate.redeem(wrong) is None
    assert not gate.knows(wrong)
    assert not gate.knows(None)


def test_two_servers_share_nothing():
    one, other = Gate(8000), Gate(8001)
    assert one.room != other.room
    assert not other.knows(one.redeem(token_of(one.invitation())))


def test_old_invitations_lapse():
    gate = Gate(8000)
    first = token_of(gate.invitation())
    for _ in range(TOKENS_OPEN):
        gate.invitation()
    assert gate.redeem(first) is None


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
