"""Access to the live page: pilot and guests, their links, and what each may request.

Each link opens a *seat*. Its token is exchanged for a cookie, which only the page of this server may use. A
browser sends the cookies of 127.0.0.1 to every port there. Each seat therefore has a secret path, and its
cookie is bound to this path: a browser may have several seats, and none opens another. The link of the pilot
works once, that of a guest again, since the guest returns by it.

Host and Origin are compared with the address of the server. This refuses pages of other ports, and names that
resolve to this machine.
"""

import secrets
import time
from collections import deque
from hmac import compare_digest
from ipaddress import IPv6Address, ip_address
from typing import Any

from starlette.datastructures import Headers

from beaver_ftc.documents import BadInput

COOKIE = "beaver-ftc-live"
LOOPBACK_NAMES = ("127.0.0.1", "localhost")
HTTP_PORT = 80  # browsers leave this port out
TOKENS_OPEN = 16  # largest number of links of a seat that are not used yet
MAX_PAGES = 20  # open pages of the pilot
MAX_PAGES_OF_A_GUEST = 3
LOOKING_ON = frozenset({"name"})
INVITED = LOOKING_ON | {"break", "repair", "blow"}
MESSAGES_PER_S, BURST = 5.0, 20.0  # of a guest
JOINS_PER_S, BURST_OF_JOINS = 0.5, 6.0  # new pages of a guest: each costs the flight about 7 ms


class Allowance:
    """A limit on events: `burst` at once, and `per_s` in a second after them. Times: monotonic clock, s."""

    def __init__(self, per_s: float, burst: float, now_s: float) -> None:
        self._per_s, self._burst, self._left, self._at_s = per_s, burst, burst, now_s

    def takes(self, now_s: float) -> bool:
        """Whether one more event is within the limit. This event is then counted."""
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Seat:
    """The access that a link opens. number: of a guest, from 1 on; 0 for the pilot."""

    def __init__(self, number: int = 0) -> None:
        self.number, self.name, self.is_invited = number, "", False
        self.room = "/" + secrets.token_urlsafe(12)  # secret path of all its addresses
        self.pages = 0  # number of open pages
        self._session = secrets.token_urlsafe(32)
        self._tokens: deque[str] = deque(maxlen=TOKENS_OPEN)
        self._used: deque[str] = deque(maxlen=TOKENS_OPEN)
        now_s = time.monotonic()
        self._messages = Allowance(MESSAGES_PER_S, BURST, now_s)
        self._joins = Allowance(JOINS_PER_S, BURST_OF_JOINS, now_s)

    def token(self) -> str:
        """A new token."""
        self._tokens.append(secrets.token_urlsafe(24))
        return self._tokens[-1]

    def redeem(self, token: str) -> str | None:
        """The value of the cookie for a valid token of this seat; None for any other token."""
        known = _found(token, self._tokens)
        if known is not None and not self.number:
            self._tokens.remove(known)
            self._used.append(known)
        return None if known is None else self._session

    def was_used(self, token: str) -> bool:
        """Whether a token was valid and has been used; true only once for each token."""
        known = _found(token, self._used)
        if known is not None:
            self._used.remove(known)
        return known is not None

    def knows(self, cookie: str | None) -> bool:
        """Whether this is the cookie of the seat."""
        return cookie is not None and compare_digest(cookie.encode(), self._session.encode())

    @property
    def is_full(self) -> bool:
        """Whether no further page may be opened."""
        return self.pages >= (MAX_PAGES_OF_A_GUEST if self.number else MAX_PAGES)

    @property
    def label(self) -> str:
        """The name of a guest for others. It has the number, which guests cannot choose, so that no guest can
        use the name of another."""
        return f"{self.name} (guest {self.number})" if self.name else f"guest {self.number}"

    def shown(self) -> dict[str, Any]:
        """The message to a guest about its own seat."""
        return {"k": "you", "number": self.number, "name": self.name, "is_invited": self.is_invited}

    def check(self, asked: str) -> None:
        """Raise BadInput for a request that this seat may not make."""
        if not self.number:
            if asked == "name":
                raise BadInput("name: you fly, allowed: names of guests")
        elif asked not in INVITED:
            raise BadInput(f"{asked}: not a guest's to ask, allowed: {', '.join(sorted(INVITED))}")
        elif asked not in LOOKING_ON and not self.is_invited:
            raise BadInput(f"{asked}: you are watching, allowed once you are invited")

    def check_pace(self, now_s: float) -> None:
        """Raise BadInput for a guest with too many requests, which would delay the flight."""
        if self.number and not self._messages.takes(now_s):
            raise BadInput(f"too many requests at once, allowed: {MESSAGES_PER_S:g} a second")

    def may_join(self, now_s: float) -> bool:
        """Whether a page may be opened now. The rate of new pages of a guest is limited."""
        return not self.is_full and (not self.number or self._joins.takes(now_s))


class Gate:
    """The seats of one run of the server.

    names: host names of the server; links have the first. any_own: the address that a request has reached is
    a name, too.
    """

    def __init__(
        self, port: int, names: tuple[str, ...] = LOOPBACK_NAMES, guests: int = 0, any_own: bool = False
    ) -> None:
        self._port, self._names, self._any_own = port, names, any_own
        self.flyer = Seat()
        self.guests = tuple(Seat(number) for number in range(1, guests + 1))
        self._seats = {seat.room: seat for seat in (self.flyer, *self.guests)}
        self.wrong = 0  # number of wrong tokens and cookies

    def link(self, seat: Seat) -> str:
        """An address with a new token, which opens the seat."""
        return f"http://{self._authority(self._names[0])}{seat.room}/?token={seat.token()}"

    def seat_of(self, path: str) -> Seat | None:
        """The seat whose path begins this path; None if there is none."""
        return self._seats.get("/" + path.removeprefix("/").partition("/")[0])

    def invite(self, guest: int | None, on: bool) -> str:
        """Allow a guest, or all guests if None, to inject faults, or withdraw this. Returns the text for the
        pilot. Raises BadInput for an unknown guest."""
        chosen = [seat for seat in self.guests if guest in (None, seat.number)]
        if not chosen:
            raise BadInput(f"guest: {guest} is not there, allowed: 1 to {len(self.guests)}")
        for seat in chosen:
            seat.is_invited = on
        who = "all guests" if guest is None else chosen[0].label
        return f"{who} may break" if on else f"{who} may only look on"

    def roster(self) -> dict[str, Any]:
        """The message about all guests to the page of the pilot."""
        guests = [{**seat.shown(), "pages": seat.pages} for seat in self.guests]
        return {"k": "class", "guests": guests, "wrong": self.wrong}

    def is_addressed(self, headers: Headers, came_to: str | None = None) -> bool:
        """Whether the Host of a request is a name of this server. came_to: the address that it reached."""
        own = (as_name(came_to),) if self._any_own and came_to else ()
        host = headers.get("host", "")
        name = host if self._port == HTTP_PORT else host.removesuffix(f":{self._port}")
        return name in (*self._names, *own) and host == self._authority(name)

    def is_own_page(self, headers: Headers, came_to: str | None = None) -> bool:
        """Whether a page of this server opens a websocket."""
        host = headers.get("host")
        return headers.get("origin") == f"http://{host}" and self.is_addressed(headers, came_to)

    def _authority(self, name: str) -> str:
        return name if self._port == HTTP_PORT else f"{name}:{self._port}"


def as_name(address: str) -> str:
    """An address as a browser writes it in Host: IPv6 in brackets; IPv4 without, also if mapped to IPv6."""
    ip = ip_address(address)
    if isinstance(ip, IPv6Address):
        return str(ip.ipv4_mapped) if ip.ipv4_mapped else f"[{ip.compressed}]"
    return str(ip)


def _found(token: str, among: deque[str]) -> str | None:
    """The token that is equal, each compared in constant time; None if there is none."""
    equal = [known for known in among if compare_digest(known.encode(), token.encode())]
    return equal[0] if equal else None
