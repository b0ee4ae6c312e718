"""The web side: the page, its files, and the websocket; nothing else can be reached."""

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.integrations.live import messages
from beaver_ftc.integrations.live.gate import Gate
from beaver_ftc.integrations.live.pages import Pages

STATIC = Path(__file__).parent / "static"
MAX_PAGES = 20
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
        pages.tell(number, _answer(0, False, str(error)))
        return
    if isinstance(request, messages.Invite):
        pages.tell(number, _answer(request.n, True, gate.invitation()))
    else:
        ask(number, text)


def _answer(n: int, ok: bool, says: str) -> bytes:
    return json.dumps({"k": "ack", "n": n, "ok": ok, "says": says}).encode()
