"""The web side without a network: requests and websockets handed to the application as a server does."""

import asyncio
import json

from beaver_ftc_live.page.gate import COOKIE, Gate
from beaver_ftc_live.page.server import Pages, application

PORT = 8000
HOST = f"127.0.0.1:{PORT}"

EVERYTHING = {  # one of each kind of request there is
    "break": {"fault": {"type": "stuck", "actuator": "rudder"}}, "repair": {},
    "blow": {"velocity_mps": [0, 0, 1]}, "aim": {"altitude_m": 1900}, "stick": {"rates_deg_s": [1, 0, 0]},
    "speed": {"times": 2}, "pause": {"on": True}, "change": {"law": "lqr"}, "fresh": {},
    "game": {"move": "random"}, "save": {}, "invite": {}, "let": {"on": True}, "name": {"name": "Ada"},
}  # fmt: skip


class Site:
    """The application of one gate with two guests; key: the cookie of whoever flies, keys: of guests."""

    def __init__(self):
        self.gate, self.pages, self.asked, self.said = Gate(PORT, guests=2), Pages(), [], []
        self.app = application(
            self.gate, self.pages, lambda *words: self.asked.append(words), self.said.append
        )
        self.key, *self.keys = (
            f"{COOKIE}={seat.redeem(seat.token())}" for seat in (self.gate.flyer, *self.gate.guests)
        )

    def token(self):
        return self.gate.flyer.token()

    def _scope(self, kind, path, cookie, host, **more):
        headers = {"host": host} | ({"cookie": cookie} if cookie else {}) | more.pop("headers", {})
        raw = [(name.encode(), value.encode()) for name, value in headers.items()]
        return {"type": kind, "path": path, "headers": raw, "query_string": b"", "root_path": "", **more}

    def get(self, path, query="", cookie=None, host=HOST):
        """(status, headers, body)."""
        told = []
        scope = self._scope("http", path, cookie, host, method="GET", query_string=query.encode(),
                            scheme="http", server=("127.0.0.1", PORT))  # fmt: skip

        async def receive():
            await asyncio.sleep(0)
            return {"type": "http.request", "body": b"", "more_body": False}

        async def send(message):
            told.append(message)

        asyncio.run(self.app(scope, receive, send))
        headers = {name.decode(): value.decode() for name, value in told[0]["headers"]}
        body = b"".join(message.get("body", b"") for message in told[1:])
        return told[0]["status"], headers, body

    def talk(self, *said, cookie=None, origin=f"http://{HOST}", then=None, seat=None):
        """What a websocket is told while it says these messages; seat: whose path it opens."""
        told, script = [], [{"type": "websocket.connect"}, *said, {"type": "websocket.disconnect"}]
        room = (seat or self.gate.flyer).room
        scope = self._scope("websocket", f"{room}/socket", cookie, HOST, scheme="ws",
                            headers={"origin": origin}, subprotocols=[])  # fmt: skip

        async def receive():
            for _ in range(4):
                await asyncio.sleep(0)
            if then and len(script) == 1:
                then(self)
                await asyncio.sleep(0.001)
            return script.pop(0)

        async def send(message):
            told.append(message)

        asyncio.run(self.app(scope, receive, send))
        return told


def says(**request):
    return {"type": "websocket.receive", "text": json.dumps(request)}
