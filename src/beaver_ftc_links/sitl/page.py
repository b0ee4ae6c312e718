"""The flight on the live page, which shows it and can inject and repair faults; the autopilot flies."""

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
    """A session of the live page for the flight of a vehicle, which the autopilot begins and steps."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        super().__init__(vehicle.scenario, Path())

    def _begin(self, scenario: object, faults: bool = True) -> None:
        self._take_up(self._vehicle.given, self._vehicle.scenario, self._vehicle.flight)
        self._frames = 0

    def has_restarted(self) -> bool:
        """Whether the flight has restarted since the last call; the session then follows the new one."""
        flight = self._vehicle.flight
        before = self._frames
        restarted = flight is not self.sim or flight.frames < before
        if restarted:
            self._begin(self.scenario)
        self._frames = flight.frames
        return restarted

    def notice(self) -> None:
        """Note the faults and verdicts of the frames since the last call."""
        self._notice_faults()
        self._notice()


class Shown(Flying):
    """The side of the flight process in the pipe to the live page. The endpoint calls `tick` between frames.

    say: function that prints a line.
    """

    def __init__(self, pipe: Connection, session: Watched, say: Callable[[str], None]) -> None:
        super().__init__(pipe, session)
        self._watched = session
        self._say = say
        self._next_s = 0.0
        self._there = True

    def tick(self) -> None:
        """Handle the requests of the pages, and send the state at the rate at which the pages draw."""
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
