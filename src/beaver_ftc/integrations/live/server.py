"""The web side: the page, its files, and the websocket; nothing else can be reached.

Who is let in: a one-time token becomes a cookie, and only this server's own page may use it. Cookies know no
ports: a browser would hand one for 127.0.0.1 to whatever else listens there. So ours is bound to a path
nobody else can know. Host and Origin are checked against the one address there is, which keeps out pages of
other ports and names that were made to resolve to this machine.

Who looks on: a slow page misses frames; it never holds up the flight, nor the others.
"""

import asyncio
import secrets
from collections import deque
from collections.abc import Callable
from hmac import compare_digest
from itertools import count
from pathlib import Path

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.integrations.live import EVERYONE, messages

STATIC = Path(__file__).parent / "static"
HOSTS = ("127.0.0.1", "localhost")
TOKENS_OPEN = 16  # addresses given out and not yet used
MAX_PAGES = 20
MAX_WAITING = 1000  # messages that must not be missed; a page that lets more pile up is let go
FRAME = b'{"k":"f"'
UNSUPPORTED = 1003  # a websocket's status for a kind of data that is not taken
REFUSED = 4403  # a websocket's status for "forbidden"

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self' {socket}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}

Ask = Callable[[int, str], None]


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


class Page:
    """One page: what it must be told, in order, and the newest frame."""

    def __init__(self, number: int, socket: WebSocket) -> None:
        self.number, self._socket = number, socket
        self._waiting: deque[bytes] = deque()
        self._frame: bytes | None = None
        self._news = asyncio.Event()

    def tell(self, told: bytes) -> None:
        """Have it sent as soon as the page takes it."""
        if told.startswith(FRAME):
            self._frame = told
        else:
            if not self._waiting and self._frame is not None:
                # a frame flown before an event is drawn before it, one of another flight not after its hello
                self._waiting.append(self._frame)
                self._frame = None
            self._waiting.append(told)
        self._news.set()

    async def send(self) -> None:
        """Send until the page is gone."""
        while len(self._waiting) < MAX_WAITING:
            await self._news.wait()
            self._news.clear()
            while self._waiting:
                await self._socket.send_text(self._waiting.popleft().decode())
            if self._frame is not None:
                frame, self._frame = self._frame, None
                await self._socket.send_text(frame.decode())


class Pages:
    """All of them."""

    def __init__(self) -> None:
        self._pages: dict[int, Page] = {}
        self._numbers = count(1)

    def __len__(self) -> int:
        return len(self._pages)

    def add(self, socket: WebSocket) -> Page:
        """A page more."""
        page = Page(next(self._numbers), socket)
        self._pages[page.number] = page
        return page

    def remove(self, page: Page) -> None:
        """It is gone."""
        self._pages.pop(page.number, None)

    def tell(self, number: int, told: bytes) -> None:
        """Tell one page, or with 0 all of them."""
        for page in list(self._pages.values()):
            if number in (EVERYONE, page.number):
                page.tell(told)


class Doorkeeper:
    """Refuses what is not addressed to this server or has no cookie, before anything else sees it."""

    def __init__(self, app: ASGIApp, gate: Gate) -> None:
        self._app, self._gate = app, gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """An HTTP request or a websocket."""
        if scope["type"] == "http":
            request = Request(scope)
            refusal = self._refusal(request)
            if refusal is not None:
                await refusal(scope, receive, send)
                return
        await self._app(scope, receive, self._with_headers(scope, send))

    def _refusal(self, request: Request) -> Response | None:
        gate = self._gate
        if not gate.is_addressed(request.headers):
            return PlainTextResponse("not this server's name", 421)
        if "token" in request.query_params and request.url.path == f"{gate.room}/":
            return self._welcome(request)
        if not gate.knows(request.cookies.get(gate.cookie)):
            return PlainTextResponse("Open the address that beaver-ftc live has printed.", 403)
        return None

    def _welcome(self, request: Request) -> Response:
        """The token for a cookie; it is gone from the address thereafter."""
        gate, response = self._gate, RedirectResponse(f"{self._gate.room}/", 303)
        session = gate.redeem(request.query_params["token"])
        if session is not None:
            response.set_cookie(gate.cookie, session, path=gate.room, httponly=True, samesite="strict")
        elif not gate.knows(request.cookies.get(gate.cookie)):
            return PlainTextResponse("This address has been used; ask for another one in the page.", 403)
        return response

    def _with_headers(self, scope: Scope, send: Send) -> Send:
        socket = f"ws://127.0.0.1:{self._gate.port} ws://localhost:{self._gate.port}"
        extra = [(k.encode(), v.replace("{socket}", socket).encode()) for k, v in HEADERS.items()]

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *extra]}
            await send(message)

        return sent if scope["type"] == "http" else send


def application(gate: Gate, pages: Pages, ask: Ask) -> Starlette:
    """The whole of it, below the gate's path. ask: hands a page's words to the flight."""

    async def home(_: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def socket(websocket: WebSocket) -> None:
        await _serve(websocket, gate, pages, ask)

    routes = [
        Route("/", home),
        WebSocketRoute("/socket", socket),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    app = Starlette(routes=[Mount(gate.room, routes=routes)], middleware=[Middleware(Doorkeeper, gate=gate)])
    app.router.redirect_slashes = False
    return app


async def _serve(websocket: WebSocket, gate: Gate, pages: Pages, ask: Ask) -> None:
    """One page's websocket, from opening to end."""
    own = gate.is_own_page(websocket.headers) and gate.knows(websocket.cookies.get(gate.cookie))
    if not own or len(pages) >= MAX_PAGES:
        await websocket.close(REFUSED)
        return
    await websocket.accept()
    page = pages.add(websocket)
    sending = asyncio.create_task(page.send())
    ask(0, f"joined {page.number}")
    try:
        while not sending.done():
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                break
            if message.get("text") is None:  # a page of ours sends none such
                await websocket.close(UNSUPPORTED, "a binary message, allowed: JSON as text")
                break
            _hear(message["text"], page.number, gate, pages, ask)
    finally:
        pages.remove(page)
        ask(0, f"left {page.number}")
        sending.cancel()
        await asyncio.gather(sending, return_exceptions=True)


def _hear(text: str, number: int, gate: Gate, pages: Pages, ask: Ask) -> None:
    """What a page says: an address for another browser is the server's to give, the rest is the flight's."""
    try:
        request = messages.parse(text)
    except BadInput as error:
        pages.tell(number, messages.encode(messages.acknowledged(0, False, str(error))))
        return
    if isinstance(request, messages.Invite):
        pages.tell(number, messages.encode(messages.acknowledged(request.n, True, gate.invitation())))
    else:
        ask(number, text)
