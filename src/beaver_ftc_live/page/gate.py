"""Who is let in, by which name, and what each may ask: a seat a link.

A link's token becomes a cookie, and only this server's own page may use it. Cookies know no ports: a browser
would hand one for 127.0.0.1 to whatever else listens there. So each seat has a path that nobody else can
know, and its cookie is bound to that: a browser may hold several seats, none opens another. The
pilot's link works once; a guest's works again, since that guest has to come back by it.

Host and Origin are checked against the address that the server has, which keeps out pages of other ports and
names that were made to resolve to this machine.
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
HTTP_PORT = 80  # which browsers leave out
TOKENS_OPEN = 16  # addresses given out and not yet used
MAX_PAGES = 20  # of the pilot
MAX_PAGES_OF_A_GUEST = 3
LOOKING_ON = frozenset({"name"})
INVITED = LOOKING_ON | {"break", "repair", "blow"}
MESSAGES_PER_S, BURST = 5.0, 20.0  # of a guest
JOINS_PER_S, BURST_OF_JOINS = 0.5, 6.0  # of a guest: each makes the flight introduce itself, some 7 ms


class Allowance:
    """So many at once, and so many a second thereafter. Times are the machine's monotonic clock, s."""

    def __init__(self, per_s: float, burst: float, now_s: float) -> None:
        self._per_s, self._burst, self._left, self._at_s = per_s, burst, burst, now_s

    def takes(self, now_s: float) -> bool:
        """Whether one more is within it; it then counts."""
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Seat:
    """What one link opens. number: of a guest, from 1; 0: the pilot."""

    def __init__(self, number: int = 0) -> None:
        self.number, self.name, self.is_invited = number, "", False
        self.room = "/" + secrets.token_urlsafe(12)  # the path that everything of it is under
        self.pages = 0  # that are open
        self._session = secrets.token_urlsafe(32)
        self._tokens: deque[str] = deque(maxlen=TOKENS_OPEN)
        self._used: deque[str] = deque(maxlen=TOKENS_OPEN)
        now_s = time.monotonic()
        self._messages = Allowance(MESSAGES_PER_S, BURST, now_s)
        self._joins = Allowance(JOINS_PER_S, BURST_OF_JOINS, now_s)

    def token(self) -> str:
        """A new one."""
        self._tokens.append(secrets.token_urlsafe(24))
        return self._tokens[-1]

    def redeem(self, token: str) -> str | None:
        """The cookie's value for a token of this seat that may be used, else None."""
        known = _found(token, self._tokens)
        if known is not None and not self.number:
            self._tokens.remove(known)
            self._used.append(known)
        return None if known is None else self._session

    def was_used(self, token: str) -> bool:
        """Whether a token was a right one once; that is said once a token."""
        known = _found(token, self._used)
        if known is not None:
            self._used.remove(known)
        return known is not None

    def knows(self, cookie: str | None) -> bool:
        """Whether a cookie is this seat's."""
        return cookie is not None and compare_digest(cookie.encode(), self._session.encode())

    @property
    def is_full(self) -> bool:
        """Whether there is no room for a page more."""
        return self.pages >= (MAX_PAGES_OF_A_GUEST if self.number else MAX_PAGES)

    @property
    def label(self) -> str:
        """A guest to others: the number cannot be chosen, so nobody passes for somebody else."""
        return f"{self.name} (guest {self.number})" if self.name else f"guest {self.number}"

    def shown(self) -> dict[str, Any]:
        """What a guest is told of itself."""
        return {"k": "you", "number": self.number, "name": self.name, "is_invited": self.is_invited}

    def check(self, asked: str) -> None:
        """Raise BadInput for what may not be asked from here."""
        if not self.number:
            if asked == "name":
                raise BadInput("name: you fly, allowed: names of guests")
        elif asked not in INVITED:
            raise BadInput(f"{asked}: not a guest's to ask, allowed: {', '.join(sorted(INVITED))}")
        elif asked not in LOOKING_ON and not self.is_invited:
            raise BadInput(f"{asked}: you are watching, allowed once you are invited")

    def check_pace(self, now_s: float) -> None:
        """Raise BadInput for a guest who asks too much: requests would keep the flight from flying."""
        if self.number and not self._messages.takes(now_s):
            raise BadInput(f"too many requests at once, allowed: {MESSAGES_PER_S:g} a second")

    def may_join(self, now_s: float) -> bool:
        """Whether a page may be opened now: a guest's pages are opened at a bounded pace, as its requests."""
        return not self.is_full and (not self.number or self._joins.takes(now_s))


class Gate:
    """The secrets of one run of the server.

    names: that it is called by, the first in its links. any_own: also by the address a request came to.
    """

    def __init__(
        self, port: int, names: tuple[str, ...] = LOOPBACK_NAMES, guests: int = 0, any_own: bool = False
    ) -> None:
        self._port, self._names, self._any_own = port, names, any_own
        self.flyer = Seat()
        self.guests = tuple(Seat(number) for number in range(1, guests + 1))
        self._seats = {seat.room: seat for seat in (self.flyer, *self.guests)}
        self.wrong = 0  # tokens and cookies that opened nothing

    def link(self, seat: Seat) -> str:
        """An address that lets somebody in, with a token of its own."""
        return f"http://{self._authority(self._names[0])}{seat.room}/?token={seat.token()}"

    def seat_of(self, path: str) -> Seat | None:
        """Whose path that is."""
        return self._seats.get("/" + path.removeprefix("/").partition("/")[0])

    def invite(self, guest: int | None, on: bool) -> str:
        """Let a guest break things, or all, or not any more; in words. Raises BadInput for one not there."""
        chosen = [seat for seat in self.guests if guest in (None, seat.number)]
        if not chosen:
            raise BadInput(f"guest: {guest} is not there, allowed: 1 to {len(self.guests)}")
        for seat in chosen:
            seat.is_invited = on
        who = "all guests" if guest is None else chosen[0].label
        return f"{who} may break" if on else f"{who} may only look on"

    def roster(self) -> dict[str, Any]:
        """All guests, as the pilot's page shows them."""
        guests = [{**seat.shown(), "pages": seat.pages} for seat in self.guests]
        return {"k": "class", "guests": guests, "wrong": self.wrong}

    def is_addressed(self, headers: Headers, came_to: str | None = None) -> bool:
        """Whether a request is meant for this server by its right name. came_to: the address it reached."""
        own = (as_name(came_to),) if self._any_own and came_to else ()
        host = headers.get("host", "")
        name = host if self._port == HTTP_PORT else host.removesuffix(f":{self._port}")
        return name in (*self._names, *own) and host == self._authority(name)

    def is_own_page(self, headers: Headers, came_to: str | None = None) -> bool:
        """Whether a websocket is opened by a page of this server."""
        host = headers.get("host")
        return headers.get("origin") == f"http://{host}" and self.is_addressed(headers, came_to)

    def _authority(self, name: str) -> str:
        return name if self._port == HTTP_PORT else f"{name}:{self._port}"


def as_name(address: str) -> str:
    """An address as it stands in a browser's Host: IPv6 in brackets, IPv4 as such wherever it came from."""
    ip = ip_address(address)
    if isinstance(ip, IPv6Address):
        return str(ip.ipv4_mapped) if ip.ipv4_mapped else f"[{ip.compressed}]"
    return str(ip)


def _found(token: str, among: deque[str]) -> str | None:
    """The one that is equal, each compared in constant time."""
    equal = [known for known in among if compare_digest(known.encode(), token.encode())]
    return equal[0] if equal else None
