"""A bad line between an autopilot and an endpoint: is a frame flown twice, or lost?

The line loses, doubles, reorders and cuts packets. Garbage and packets of other senders arrive. Either side
is silent for seconds, and the autopilot is restarted. The line has a clock of its own, so that no test waits.
The outputs of each frame contain its number, and `Spy` records the numbers of the frames that are flown.
"""

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common

from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.mavlink import Mavlink
from beaver_ftc_links.sitl.px4 import Px4
from tools.autopilots import peers
from tools.autopilots.reader import read

AGAIN_S = 1.0  # without an answer an autopilot asks again
STEP_S = 0.0025
RATE_HZ = 400
ODDS = {
    "lost": 0.01,
    "doubled": 0.01,
    "overtaken": 0.01,
    "garbage": 0.01,
    "stranger": 0.005,
    "silence": 0.001,
}


class Spy:
    """A vehicle that records the number of each frame, and flies it. flown: a list for each flight."""

    def __init__(self, body: Any, number_of: Any) -> None:
        self._body, self._number_of = body, number_of
        self.flown: list[list[int]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._body, name)

    def begin(self, packets_hz: float, channels: int = 16) -> None:
        self.flown.append([])
        self._body.begin(packets_hz, channels)

    def fly(self, outputs: Any, frame_hz: float, in_charge: bool = True) -> None:
        if len(outputs):
            self.flown[-1].append(self._number_of(outputs))
        self._body.fly(outputs, frame_hz, in_charge)


@dataclass
class Found:
    """The frames of a trial. meant, flown: numbers of the frames that were requested, and of those that were
    flown; a list for each flight."""

    flown: list[list[int]]
    meant: list[list[int]] = field(default_factory=list)

    @property
    def frames(self) -> int:
        """Number of requested frames."""
        return sum(map(len, self.meant))

    @property
    def twice(self) -> int:
        """Number of frames that were flown before, or that were not requested at this place."""
        return sum(len(flown) - len(set(flown)) for flown in self.flown)

    @property
    def lost(self) -> int:
        """Number of requested frames that were not flown, or not in order."""
        pairs = zip(self.meant, self.flown, strict=False)
        wrong = sum(list(meant) != list(flown) and len(set(meant) ^ set(flown)) + 1 for meant, flown in pairs)
        return wrong + abs(len(self.meant) - len(self.flown))


class Line:
    """The random events of a line. seed: of the random numbers."""

    def __init__(self, seed: int) -> None:
        self.rng, self.now_s = np.random.default_rng(seed), 0.0

    def does(self, what: str) -> bool:
        """Whether an event happens now."""
        return bool(self.rng.random() < ODDS[what])

    def wait(self) -> None:
        """Let the time of a frame pass, sometimes some seconds."""
        self.now_s += STEP_S
        if self.does("silence"):
            self.now_s += float(self.rng.uniform(1.5, 8.0))

    def noise(self) -> bytes:
        """Garbage: random bytes, or bytes that begin like a packet."""
        some = self.rng.bytes(int(self.rng.integers(0, 80)))
        return some if self.rng.random() < 0.5 else struct.pack("<HHI", 18458, 400, 7) + some[:20]


def number_in_pulses(outputs: Any) -> int:
    """The number of a frame, from channels 15 and 16."""
    return int(outputs[14]) + 65536 * int(outputs[15])


def _flights(line: Line, found: Found, frames: int, a_flight: int) -> Iterator[tuple[int, list[int]]]:
    """Yield the size of each flight, about `a_flight` frames, until so many frames are requested, and the
    list for its frames."""
    while (left := frames - found.frames) > 0:
        size = min(int(line.rng.integers(a_flight // 2, 2 * a_flight)), left)
        found.meant.append([])
        yield size, found.meant[-1]


def ardupilot(body: Any, frames: int, seed: int, a_flight: int) -> Found:
    """Fly frames of ArduPilot's protocol over a bad line, with a restart after about `a_flight` of them."""
    line, spy = Line(seed), Spy(body, number_in_pulses)
    found, end, port = Found(spy.flown), Ardupilot(spy, Link()), 1
    for size, meant in _flights(line, found, frames, a_flight):
        if len(found.meant) > 1:
            line.now_s += 0.0 if line.rng.random() < 0.5 else 3.0
            port += bool(line.rng.random() < 0.5)  # a process started again mostly has another
        _fly_ardupilot(line, end, port, size, meant)
    return found


def _fly_ardupilot(line: Line, end: Ardupilot, port: int, size: int, meant: list[int]) -> None:
    """A flight of `size` packets, each sent again until its answer arrives."""
    before: deque[bytes] = deque(maxlen=40)
    last_s = -1.0
    for count in range(size):
        given = [1500, 1500, 1400, 1500, *[0] * 10, count % 65536, count // 65536]
        datagram = peers.packet(count, RATE_HZ, given)
        answer = None
        while answer is None:
            answer = _asked(line, end, port, datagram, before)
            line.now_s += 0.0 if answer else AGAIN_S
        (t_s,) = read(answer)["timestamp"]
        assert t_s > last_s, f"time stood still at {t_s}"
        last_s = t_s
        meant.append(count)
        before.append(datagram)


def _asked(line: Line, end: Ardupilot, port: int, datagram: bytes, before: deque[bytes]) -> bytes | None:
    """The answer to a packet that is sent once; None if packet or answer is lost."""
    line.wait()
    if line.does("garbage"):
        assert end.take(line.noise(), port, line.now_s) is None
    if line.does("stranger"):
        assert end.take(datagram, "stranger", line.now_s) is None or line.now_s < 0
    if line.does("overtaken") and len(before) > 2:
        old = before[int(line.rng.integers(0, len(before) - 1))]
        assert end.take(old, port, line.now_s) is None
    if line.does("lost"):
        return None
    answer = end.take(datagram, port, line.now_s)
    if line.does("doubled"):
        assert end.take(datagram, port, line.now_s) == answer
    return None if line.does("lost") else answer


def number_in_controls(outputs: Any) -> int:
    """The number of a frame, from the last control."""
    return round(outputs[15] * 2**20)


def px4(body: Any, frames: int, seed: int, a_flight: int) -> Found:
    """Fly frames of PX4's protocol over a bad line, with a connection for each flight."""
    line, spy = Line(seed), Spy(body, number_in_controls)
    spy.flown.append([])
    found, end = Found(spy.flown), Px4(spy, Link(), Mavlink(), lambda params: (3, ""))
    for size, meant in _flights(line, found, frames, a_flight):
        _fly_px4(line, end, size, meant)
    return found


def _fly_px4(line: Line, end: Px4, size: int, meant: list[int]) -> None:
    """A flight that answers each new time of a sensor message; it ends once the last answer was flown."""
    mav = common.MAVLink(None, srcSystem=1, srcComponent=1)
    mav.robust_parsing = True
    before: deque[bytes] = deque(maxlen=40)
    coming, known_us, number = end.connect(line.now_s), 0, 0
    for _ in range(3):  # it starts: time passes, nobody answers
        line.now_s += STEP_S
        coming += end.tick(line.now_s, STEP_S)
    last = b""
    while True:
        line.wait()
        stamps = [m.time_usec for m in mav.parse_buffer(coming) or [] if m.get_type() == "HIL_SENSOR"]
        new = [stamp for stamp in stamps if stamp > known_us]
        if new and number == size:
            return
        if new:
            known_us = new[-1]
            message = common.MAVLink_hil_actuator_controls_message(
                known_us, [*[0.0] * 15, number / 2**20], 129, 1
            )
            last = bytes(message.pack(mav))
            meant.append(number)
            number += 1
            before.append(last)
        coming = _told(line, end, last if stamps else b"", before)


def _told(line: Line, end: Px4, answer: bytes, before: deque[bytes]) -> bytes:
    """The bytes that come back for an answer. If none come, time passes until the endpoint repeats its last.

    The first answer is not lost: until it arrives, the endpoint assumes that the autopilot starts.
    """
    if len(before) == 1:
        return end.take(answer, line.now_s)
    coming = b""
    if line.does("garbage"):
        coming += end.take(line.noise(), line.now_s)
    if line.does("overtaken") and len(before) > 2:
        coming += end.take(before[int(line.rng.integers(0, len(before) - 1))], line.now_s)
    if answer and not line.does("lost"):
        cut = int(line.rng.integers(0, len(answer)))  # TCP keeps no messages together
        coming += end.take(answer[:cut], line.now_s) + end.take(answer[cut:], line.now_s)
        if line.does("doubled"):
            coming += end.take(answer, line.now_s)
    if not coming:
        line.now_s += AGAIN_S
        coming += end.tick(line.now_s, STEP_S)
    return coming
