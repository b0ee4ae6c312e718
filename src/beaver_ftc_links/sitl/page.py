"""The flight on the live page: it looks on, breaks and repairs; the autopilot flies."""

import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

from beaver_ftc.documents import BadInput
from beaver_ftc_links.sitl.vehicle import Vehicle
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.flying import TICK_S, Flying
from beaver_ftc_live.page.session import Session

ALLOWED = ("break", "repair", "blow")


class Watched(Session):
    """A session around the vehicle's flight, which others begin and step."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        super().__init__(vehicle.scenario, Path())

    def _begin(self, scenario: object, faults: bool = True) -> None:
        self._take_up(self._vehicle.given, self._vehicle.scenario, self._vehicle.flight)
        self._frames = 0

    def has_restarted(self) -> bool:
        """Whether it is another flight than at the last call; that is then taken up."""
        flight, before = self._vehicle.flight, self._frames
        restarted = flight is not self.sim or flight.frames < before
        if restarted:
            self._begin(self.scenario)
        self._frames = flight.frames
        return restarted

    def notice(self) -> None:
        """Notice what the frames since the last call have brought."""
        self._notice_faults()
        self._notice()


class Shown(Flying):
    """The flight process' side of the pipe where something else flies: `tick` is called between frames.

    say: takes a line for people.
    """

    def __init__(self, pipe: Connection, session: Watched, say: Callable[[str], None]) -> None:
        super().__init__(pipe, session)
        self._watched, self._say, self._next_s, self._there = session, say, 0.0, True

    def tick(self) -> None:
        """Take what pages ask; tell them how it goes, as often as they draw."""
        now_s = time.monotonic()
        if now_s < self._next_s or not self._there:
            return
        self._next_s = now_s + TICK_S
        self._pace.follow(now_s, self._watched.sim.frames)
        try:
            self._serve()
        except (EOFError, OSError):  # the server has ended: the flight goes on
            self._there = False

    def _serve(self) -> None:
        if self._watched.has_restarted() and self._pages:
            self._send(0, self._watched.hello())
        while self._pipe.poll(0):
            self._take(*self._pipe.recv())
        self._watched.notice()
        if self._pages:
            self._tell()

    def _handle(self, page: int, request: messages.Request) -> str:
        if request.do not in ALLOWED:
            raise BadInput(f"{request.do}: not under an autopilot, allowed: {', '.join(ALLOWED)}")
        return self._watched.handle(request)

    def _obey(self, word: str, of: str = "0") -> None:
        if word == "at":
            self._say(f"live: {of}")
        else:
            super()._obey(word, of)
