"""Who is let in: a one-time token becomes a cookie, and only this server's own page may use it.

Cookies know no ports: a browser would hand one for 127.0.0.1 to whatever else listens there. So ours is bound
to a path nobody else can know. Host and Origin are checked against the one address there is, which keeps out
pages of other ports and names that were made to resolve to this machine.
"""

import secrets
from hmac import compare_digest

from starlette.datastructures import Headers

HOSTS = ("127.0.0.1", "localhost")
TOKENS_OPEN = 16  # addresses given out and not yet used


class Gate:
    """The secrets of one run of the server."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.room = "/" + secrets.token_urlsafe(12)  # the path everything is under
        self.cookie = "beaver-ftc-live"
        self._session = secrets.token_urlsafe(32)
        self._tokens: list[str] = []

    def invitation(self) -> str:
        """An address that lets one browser in, once."""
        self._tokens = [*self._tokens, secrets.token_urlsafe(24)][-TOKENS_OPEN:]
        return f"http://{HOSTS[0]}:{self.port}{self.room}/?token={self._tokens[-1]}"

    def redeem(self, token: str) -> str | None:
        """The cookie's value for a token that has not been used, else None."""
        match = [known for known in self._tokens if compare_digest(known.encode(), token.encode())]
        if not match:
            return None
        self._tokens.remove(match[0])
        return self._session

    def knows(self, cookie: str | None) -> bool:
        """Whether a cookie is ours."""
        return cookie is not None and compare_digest(cookie.encode(), self._session.encode())

    def is_addressed(self, headers: Headers) -> bool:
        """Whether a request is meant for this server by its right name."""
        return headers.get("host") in {f"{host}:{self.port}" for host in HOSTS}

    def is_own_page(self, headers: Headers) -> bool:
        """Whether a websocket is opened by a page of this server."""
        return headers.get("origin") == f"http://{headers.get('host')}" and self.is_addressed(headers)
