"""The flight process: it owns the simulation, keeps its pace by a clock, answers what pages ask.

The pipe carries (page, text) to it, page 0 for the server's own words `joined`, `called`, `left` and `end`;
and (page, text) from it, page 0 for all of them.
"""

import contextlib
import os
import time
from collections import deque
from math import sqrt
from multiprocessing.connection import Connection
from pathlib import Path

from beaver_ftc.documents import BadInput, BeaverFtcError
from beaver_ftc_live.page import BAD_INPUT, EVERYONE, messages
from beaver_ftc_live.page.reports import Reports
from beaver_ftc_live.page.session import NO_STICK, Session

STATE_EVERY = 15  # ticks
TICK_S = 1 / 60  # a page draws as often
BEHIND_S = 0.25  # real time: what cannot be caught up with is let go


class Pace:
    """Real time to flight time. Times of `now_s` are the machine's monotonic clock, s."""

    def __init__(self, rate_hz: float, now_s: float) -> None:
        self.rate_hz, self.times = rate_hz, 1.0
        self._late = deque([0.0], maxlen=60)
        self._flown = deque([(now_s, 0)], maxlen=60)
        self._total = 0
        self.hold(now_s)

    def hold(self, now_s: float) -> None:
        """Begin again from here: after a pause, or a change of speed."""
        self._from_s, self._frames = now_s, 0
        self.next_s = now_s + TICK_S

    def frames_due(self, now_s: float) -> int:
        """Frames to fly at this tick. What a machine too slow for its speed cannot fly in time is let go."""
        self._late.append(now_s - self.next_s)
        self.next_s += TICK_S
        if now_s - self.next_s > BEHIND_S:
            self.hold(now_s)
            return 0
        due = int((now_s - self._from_s) * self.times * self.rate_hz) - self._frames
        due = min(due, int(BEHIND_S * self.times * self.rate_hz) + 1)
        self._frames += due
        self._total += due
        self._flown.append((now_s, self._total))
        return due

    def follow(self, now_s: float, frames: int) -> None:
        """Another keeps the pace: so many frames have been flown in all."""
        if frames < self._total:
            self._flown.clear()
        self._total = frames
        self._flown.append((now_s, frames))

    @property
    def jitter_ms(self) -> float:
        """Root mean square lateness of the last second's ticks, ms."""
        return 1e3 * sqrt(sum(late * late for late in self._late) / len(self._late))

    @property
    def achieved(self) -> float:
        """Times real time of the last second."""
        (from_s, before), (to_s, after) = self._flown[0], self._flown[-1]
        return (after - before) / self.rate_hz / (to_s - from_s) if to_s > from_s else 0.0


def main(connection: Connection, out: str) -> None:
    """The process. Ends when told, or when the server is gone; a flight that cannot be begun says why."""
    from beaver_ftc.loop import fly  # noqa: F401  most of the way to the first frame, while the scenario is read

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
        self._names: dict[int, str] = {}  # of guests, by page
        self._steering = EVERYONE  # the page whose stick is not centred
        self._paused, self._ended = False, False
        self._pace = Pace(session.scenario.rate_hz, time.monotonic())
        self._ticks = 0
        self._reports = Reports()

    def run(self) -> None:
        """Until told to end, or the server is gone."""
        try:
            self._run()
        finally:
            self._reports.leave()

    def _run(self) -> None:
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
        try:
            for _ in range(frames):
                if self._session.over:
                    return
                self._session.step()
        except BeaverFtcError as error:
            self._paused = True
            self._send(EVERYONE, messages.acknowledged(0, False, str(error)))

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
            self._obey(*text.split(" ", 1))
            return
        n, ok = 0, True
        try:
            request = messages.parse(text)
            n = request.n
            says = self._handle(page, request)
            if isinstance(request, messages.Stick):
                return
        except BeaverFtcError as error:
            ok, says = False, str(error)
        self._send(page, messages.acknowledged(n, ok, says))
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
        says = self._session.handle(request, by=self._names.get(page, ""))
        if self._session.sim is not before:
            self._pace.rate_hz, self._paused = self._session.scenario.rate_hz, False
            self._send(EVERYONE, self._session.hello())
        if isinstance(request, messages.Fresh | messages.Save | messages.Game):
            self._pace.hold(time.monotonic())  # these take a while: the flight waits
        while self._session.unreported:
            self._reports.add(self._session.unreported.pop(0))
        return says

    def _obey(self, word: str, of: str = "0") -> None:
        """The server's own words, of a page."""
        page, _, name = of.partition(" ")
        number = int(page)
        if word == "end":
            self._ended = True
        elif word == "called":
            self._names[number] = name
        elif word == "joined":
            self._pages.add(number)
            self._send(number, self._session.hello())
            self._ticks = 0
            if len(self._pages) == 1:
                self._pace.hold(time.monotonic())
        elif word == "left":
            self._pages.discard(number)
            self._names.pop(number, None)
            if self._steering == number:
                self._session.stick = NO_STICK

    def _tell(self) -> None:
        for says in self._reports.news():
            self._session.reported(says)
        events = self._session.take_events()
        if events:
            self._send(EVERYONE, {"k": "e", "events": events})
        if self._ticks % STATE_EVERY == 0 or events:
            pace = self._pace
            clock = {
                "paused": self._paused, "speed": pace.times, "jitter_ms": round(pace.jitter_ms, 2),
                "achieved": round(pace.achieved, 2), "pages": len(self._pages),
            }  # fmt: skip
            self._send(EVERYONE, self._session.state() | clock)
        if not self._holding or self._ticks % STATE_EVERY == 0:
            self._send(EVERYONE, self._session.frame())
        self._ticks += 1

    def _send(self, page: int, message: messages.Message) -> None:
        self._pipe.send((page, messages.encode(message)))
