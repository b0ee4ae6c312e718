"""The flight process: it owns the simulation, keeps its pace, answers what pages ask.

The pipe carries (page, text) to it, page 0 for the server's own words `joined`, `left` and `end`; and (page,
text) from it, page 0 for all of them.
"""

import contextlib
import os
import time
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.integrations.live import messages
from beaver_ftc.integrations.live.pace import Pace
from beaver_ftc.integrations.live.session import NO_STICK, Session
from beaver_ftc.integrations.live.telling import encode
from beaver_ftc.integrations.live.words import BAD_INPUT, EVERYONE

STATE_EVERY = 15  # ticks


def main(connection: Connection, out: str) -> None:
    """The process. Ends when told, or when the server is gone; a flight that cannot be begun says why."""
    import_module("beaver_ftc.loop.loop")  # most of the way to the first frame, while the scenario is read
    try:
        scenario = connection.recv()
    except EOFError:  # the server is gone
        return
    if isinstance(scenario, tuple):  # told to end
        return
    try:
        session = Session(scenario, Path(out))
    except BeaverFtcError as error:
        kind = BAD_INPUT if isinstance(error, BadInput) else "failed"
        connection.send((kind, f"{scenario.name}: {error}"))
        return
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):  # the server is gone
        Flying(connection, session).run()
    os._exit(0)  # to take an interpreter with compiled code apart takes a second, and nothing is left to do


class Flying:
    """The loop of the process: take what was asked, fly what is due, tell what was flown."""

    def __init__(self, connection: Connection, session: Session) -> None:
        self._pipe, self._session = connection, session
        self._pages: set[int] = set()
        self._steering = EVERYONE  # the page whose stick is not centred
        self._paused, self._ended = False, False
        self._pace = Pace(session.scenario.rate_hz, time.monotonic())
        self._ticks = 0

    def run(self) -> None:
        """Until told to end."""
        while not self._ended:
            self._listen()
            if not self._pages:
                continue
            now_s = time.monotonic()
            frames = self._pace.frames_due(now_s)
            if self._holding:
                self._pace.hold(now_s)
            else:
                self._fly(frames)
            self._tell()

    @property
    def _holding(self) -> bool:
        return self._paused or self._session.over

    def _fly(self, frames: int) -> None:
        session = self._session
        try:
            for _ in range(frames):
                if session.over:
                    return
                session.step()
        except BeaverFtcError as error:
            self._paused = True
            self._send(EVERYONE, {"k": "ack", "n": 0, "ok": False, "says": str(error)})

    def _listen(self) -> None:
        """Take requests until the next tick; with nobody looking on, for as long as it takes."""
        while not self._ended:
            left_s = self._pace.next_s - time.monotonic() if self._pages else None
            if left_s is not None and left_s <= 0.0 and not self._pipe.poll(0):
                return
            if self._pipe.poll(None if left_s is None else max(left_s, 0.0)):
                self._take(*self._pipe.recv())
            else:
                return

    def _take(self, page: int, text: str) -> None:
        if page == EVERYONE:
            self._obey(*text.split())
            return
        request = None
        try:
            request = messages.parse(text)
            says = self._handle(page, request)
        except BeaverFtcError as error:
            self._answer(page, request, False, str(error))
        else:
            self._answer(page, request, True, says)

    def _answer(self, page: int, request: Any, ok: bool, says: str) -> None:
        if isinstance(request, messages.Stick) and ok:
            return
        self._send(page, {"k": "ack", "n": request.n if request else 0, "ok": ok, "says": says})
        self._ticks = 0  # the state with the next frame

    def _handle(self, page: int, request: messages.Request) -> str:
        now_s = time.monotonic()
        if isinstance(request, messages.Speed):
            self._pace.times = request.times
            self._pace.hold(now_s)
            return f"{request.times:g} times real time"
        if isinstance(request, messages.Pause):
            self._paused = request.on
            return "paused" if request.on else "flying"
        if isinstance(request, messages.Stick):
            self._steering = page
        before = self._session.sim
        says = self._session.handle(request)
        if self._session.sim is not before:
            self._pace.rate_hz, self._paused = self._session.scenario.rate_hz, False
            self._send(EVERYONE, self._session.hello())
        if isinstance(request, messages.Fresh | messages.Save | messages.Game):
            self._pace.hold(time.monotonic())  # these take a while: the flight waits
        return says

    def _obey(self, word: str, page: str = "0") -> None:
        """The server's own words."""
        number = int(page)
        if word == "end":
            self._ended = True
        elif word == "joined":
            self._pages.add(number)
            self._send(number, self._session.hello())
            self._ticks = 0
            if len(self._pages) == 1:
                self._pace.hold(time.monotonic())
        elif word == "left":
            self._pages.discard(number)
            if self._steering == number:
                self._session.stick = NO_STICK

    def _tell(self) -> None:
        events = self._session.take_events()
        if events:
            self._send(EVERYONE, {"k": "e", "events": events})
        if self._ticks % STATE_EVERY == 0 or events:
            pace = self._pace
            told = self._session.state() | {"paused": self._paused, "speed": pace.times}
            told |= {"jitter_ms": round(pace.jitter_ms, 2), "achieved": round(pace.achieved, 2)}
            self._send(EVERYONE, told | {"pages": len(self._pages)})
        if not self._holding or self._ticks % STATE_EVERY == 0:
            self._send(EVERYONE, self._session.frame())
        self._ticks += 1

    def _send(self, page: int, told: dict[str, Any]) -> None:
        self._pipe.send((page, encode(told)))
