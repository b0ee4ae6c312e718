"""The web side: the page, its files, and the websocket; nothing else can be reached.

Who is let in is the gate's to say (`gate.py`); what a guest may not ask is refused here, before the flight
receives it.

Who looks on: a slow page misses frames; it never holds up the flight, nor the others.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from itertools import count
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketClose

from beaver_ftc.documents import BadInput
from beaver_ftc_live.page import EVERYONE, messages
from beaver_ftc_live.page.gate import COOKIE, Gate, Seat

STATIC = Path(__file__).parent / "static"
GUEST_FRAME_S = 0.05  # between the frames that a guest is sent
SLOW_S, MAX_SLOW = 1.0, 20  # an attempt with a wrong token waits so long for an answer; so many wait at once
MAX_WAITING = 1000  # messages that must not be missed; a page that lets more pile up is let go
FRAME = b'{"k":"f"'
UNSUPPORTED = 1003  # a websocket's status for a kind of data that is not taken
REFUSED = 4403  # a websocket's status for "forbidden"

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'{socket}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}

Ask = Callable[[int, str], None]
Say = Callable[[str], None]


class Page:
    """One page: what it must be told, in order, and the newest frame; seat: by whose link it is here."""

    def __init__(self, number: int, socket: WebSocket, seat: Seat) -> None:
        self.number, self._socket, self.seat = number, socket, seat
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
                if self.seat.number:
                    await asyncio.sleep(GUEST_FRAME_S)


class Pages:
    """All of them."""

    def __init__(self) -> None:
        self._pages: dict[int, Page] = {}
        self._numbers = count(1)

    def __len__(self) -> int:
        return len(self._pages)

    def add(self, socket: WebSocket, seat: Seat) -> Page:
        """A page more."""
        page = Page(next(self._numbers), socket, seat)
        self._pages[page.number] = page
        seat.pages += 1
        return page

    def remove(self, page: Page) -> None:
        """It is gone."""
        if self._pages.pop(page.number, None):
            page.seat.pages -= 1

    def tell(self, number: int, told: bytes) -> None:
        """Tell one page, or with 0 all of them."""
        for page in list(self._pages.values()):
            if number in (EVERYONE, page.number):
                page.tell(told)

    def call(self, seat: Seat, ask: Ask) -> None:
        """Tell the flight who is behind a guest's pages: it says who broke what."""
        for page in self._pages.values():
            if seat.number and page.seat is seat:
                ask(0, f"called {page.number} {seat.label}")

    def tell_class(self, gate: Gate) -> None:
        """Send the list of guests to the pilot, and its rights to each guest."""
        if not gate.guests:
            return
        roster = messages.encode(gate.roster())
        for page in list(self._pages.values()):
            page.tell(messages.encode(page.seat.shown()) if page.seat.number else roster)


class Doorkeeper:
    """Refuses what is not addressed to this server or has no cookie, before anything else sees it.

    Tokens that open nothing are counted and answered slowly, right ones at once.
    """

    def __init__(self, app: ASGIApp, gate: Gate, pages: Pages, say: Say) -> None:
        self._app, self._gate, self._pages, self._say = app, gate, pages, say
        self._slow = 0  # that wait for an answer

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """An HTTP request or a websocket."""
        request = HTTPConnection(scope)
        is_addressed = self._gate.is_addressed(request.headers, _came_to(scope))
        refusal = await self._refusal(request) if is_addressed else UNKNOWN_NAME
        if scope["type"] == "http":
            send = _with_headers(send, request.headers["host"] if is_addressed else None)
        elif refusal is not None:
            await WebSocketClose(REFUSED)(scope, receive, send)
            return
        await (refusal or self._app)(scope, receive, send)

    async def _refusal(self, request: HTTPConnection) -> Response | None:
        path, cookie = request.scope["path"], request.cookies.get(COOKIE)
        seat, token = self._gate.seat_of(path), request.query_params.get("token")
        if seat is not None and token is not None and path == f"{seat.room}/":
            session = seat.redeem(token)
            if session is not None or seat.knows(cookie):
                return _welcome(seat, session)
            if seat.was_used(token):
                self._say(self._gate.link(seat))
                return PlainTextResponse("This address has been used; the terminal shows a new one.", 403)
        if seat is not None and seat.knows(cookie):
            return None
        return await self._slowly(PRINTED) if token or cookie else PRINTED

    async def _slowly(self, refusal: Response) -> Response:
        """Count a token or a cookie that opens nothing, and delay the answer."""
        self._gate.wrong += 1
        if self._slow >= MAX_SLOW:
            return PlainTextResponse("too many wrong addresses at once", 429)
        self._slow += 1
        try:
            await asyncio.sleep(SLOW_S)
        finally:
            self._slow -= 1
        self._pages.tell_class(self._gate)
        return refusal


UNKNOWN_NAME = PlainTextResponse("not this server's name", 421)
PRINTED = PlainTextResponse("Open the address that beaver-ftc live has printed.", 403)


def _welcome(seat: Seat, session: str | None) -> Response:
    """The token for a cookie; it is gone from the address thereafter.

    `lax`, not `strict`: a link is followed from a page of another site, a chat, and with `strict` the cookie
    would not come along. No request but a websocket's changes anything, and that has its Origin checked.
    """
    response = RedirectResponse(f"{seat.room}/", 303)
    if session is not None:
        response.set_cookie(COOKIE, session, path=seat.room, httponly=True, samesite="lax")
    return response


def _with_headers(send: Send, host: str | None) -> Send:
    """What sends with the headers that every answer has. host: by which this server was rightly called."""
    socket = f" ws://{host}" if host else ""
    extra = [(k.encode(), v.replace("{socket}", socket).encode()) for k, v in HEADERS.items()]

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", []), *extra]}
        await send(message)

    return sent


def _came_to(scope: Scope) -> str | None:
    """The address of this machine that a request has reached."""
    return (scope.get("server") or (None,))[0]


def application(gate: Gate, pages: Pages, ask: Ask, say: Say) -> Starlette:
    """The whole of it, below the paths of the gate's seats.

    ask: hands a page's words to the flight. say: shows the pilot a valid address, in the terminal.
    """

    async def home(_: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def socket(websocket: WebSocket) -> None:
        await _serve(websocket, gate, pages, ask)

    routes = [
        Route("/", home),
        WebSocketRoute("/socket", socket),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    door = Middleware(Doorkeeper, gate=gate, pages=pages, say=say)
    app = Starlette(routes=[Mount("/{room}", routes=routes)], middleware=[door])
    app.router.redirect_slashes = False
    return app


async def _serve(websocket: WebSocket, gate: Gate, pages: Pages, ask: Ask) -> None:
    """One page's websocket, from opening to end."""
    seat = gate.seat_of(websocket.scope["path"])
    own = gate.is_own_page(websocket.headers, _came_to(websocket.scope))
    if seat is None or not own or not seat.may_join(time.monotonic()):
        await websocket.close(REFUSED)
        return
    await websocket.accept()
    page = pages.add(websocket, seat)
    pages.tell_class(gate)
    sending = asyncio.create_task(page.send())
    ask(0, f"joined {page.number}")
    pages.call(seat, ask)
    try:
        while not sending.done():
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                break
            if message.get("text") is None:  # a page of ours sends none such
                await websocket.close(UNSUPPORTED, "a binary message, allowed: JSON as text")
                break
            _hear(message["text"], page, gate, pages, ask)
    finally:
        pages.remove(page)
        pages.tell_class(gate)
        ask(0, f"left {page.number}")
        sending.cancel()
        await asyncio.gather(sending, return_exceptions=True)


def _hear(text: str, page: Page, gate: Gate, pages: Pages, ask: Ask) -> None:
    """What a page says: who may look on or break is the server's to say, the rest is the flight's."""
    n = 0
    try:
        page.seat.check_pace(time.monotonic())
        request = messages.parse(text)
        n = request.n
        page.seat.check(request.do)
        says = _own(request, page, gate, pages, ask)
    except BadInput as error:
        pages.tell(page.number, messages.encode(messages.acknowledged(n, False, str(error))))
        return
    if says is None:
        ask(page.number, text)
        return
    pages.tell(page.number, messages.encode(messages.acknowledged(n, True, says)))


def _own(request: messages.Request, page: Page, gate: Gate, pages: Pages, ask: Ask) -> str | None:
    """Do what is the server's to do; returns what to say of it, None for what is the flight's."""
    if isinstance(request, messages.Invite):
        return gate.link(gate.flyer)
    if isinstance(request, messages.Let):
        says = gate.invite(request.guest, request.on)
    elif isinstance(request, messages.CallMe):
        page.seat.name = request.name
        pages.call(page.seat, ask)
        says = f"you are {page.seat.label}"
    else:
        return None
    pages.tell_class(gate)
    return says
