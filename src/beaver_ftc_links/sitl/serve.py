"""The endpoint: sockets, the clock, the end; and what the flight leaves behind."""

import contextlib
import select
import signal
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from math import inf
from multiprocessing.connection import Connection
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Flight, LinkMetrics, Metrics
from beaver_ftc.scenario import Scenario
from beaver_ftc_links.sitl import PORTS, Protocol, failures, px4
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.mavlink import GroundLine, Mavlink
from beaver_ftc_links.sitl.page import Shown, Watched
from beaver_ftc_links.sitl.px4 import Px4
from beaver_ftc_links.sitl.telling import Teller, Text
from beaver_ftc_links.sitl.vehicle import Vehicle, without_reference
from beaver_ftc_live.page.serve import beside
from beaver_ftc_live.page.session import ready_for_hands

LOOPBACK = "127.0.0.1"
PX4_HZ = 250.0  # of HIL_SENSOR, where nobody says otherwise
MOST_BYTES = 65536
WAIT_S = 0.25  # at most, for whatever may come
HANG_UP_S = 0.5  # at most, for the other end to hang up too
NAMES = {Protocol.ardupilot: "ArduPilot", Protocol.px4: "PX4"}

Say = Callable[[str], None]


@dataclass(frozen=True)
class Options:
    """How the endpoint is set up.

    port 0: any. speed: times real time, 0 as fast as the autopilot answers. ground: host and port of a ground
    station. page: port of the live page, 0 any, None without. The others are `Vehicle`'s.
    """

    protocol: Protocol
    host: str = LOOPBACK
    port: int | None = None
    rate_hz: float | None = None
    speed: float | None = None
    hold_s: float = 0.0
    ground_m: float | None = None
    ground: tuple[str, int] | None = None
    page: int | None = None


@dataclass
class Pace:
    """Holds answers back until their time. speed: times real time, 0 not at all. late_s: the largest
    delay."""

    speed: float
    late_s: float = 0.0
    _from: tuple[float, float] = field(default=(0.0, inf))  # of the clock, of the flight, s

    def wait(self, t_s: float, ended: Callable[[], bool] = lambda: False) -> None:
        """Until flight time t_s is due; a flight restarted restarts here, and what is late is let go.

        ended: whether there is nothing to wait for any more; it is called every WAIT_S.
        """
        if not self.speed:
            return
        now_s = time.monotonic()
        if t_s < self._from[1]:
            self._from = now_s, t_s
        due_s = self._from[0] + (t_s - self._from[1]) / self.speed
        if due_s > now_s:
            while (left_s := due_s - time.monotonic()) > 0.0 and not ended():
                time.sleep(min(left_s, WAIT_S))
        elif now_s - due_s > WAIT_S:
            self._from = now_s, t_s
        self.late_s = max(self.late_s, now_s - due_s)


class Endpoint:
    """What both protocols share: the flight, what is said of it, and when it ends.

    say: takes a line for people.
    """

    def __init__(self, scenario: Scenario, options: Options, say: Say) -> None:
        pulses = options.protocol is Protocol.ardupilot
        rate_hz = PX4_HZ if options.rate_hz is None and not pulses else options.rate_hz
        self.options, self._say, self.ended = options, say, False
        self.link, self._teller = Link(), Teller()
        self.vehicle = Vehicle(scenario, pulses, rate_hz, options.hold_s, options.ground_m)
        if not pulses:
            self.vehicle.outputs.check(px4.CHANNELS)
        speed = options.speed if options.speed is not None else (0.0 if pulses else 1.0)
        self.pace = Pace(speed)
        self._ground = GroundLine(*options.ground) if options.ground else None
        self._page: Shown | None = None
        self._resets = 0

    def show(self, pipe: Connection) -> None:
        """Show the flight on the live page, whose server is at the other end of the pipe."""
        self._page = Shown(pipe, Watched(self.vehicle), self._say)

    def after(self, began_s: float) -> list[Text]:
        """What is new after an answer, whose making began at that time of perf_counter; the answer then waits
        for its time."""
        if self.link.counts["resets"] != self._resets:
            self._resets = self.link.counts["resets"]
            self._teller.begin()
            self._say("restarted")
        sim = self.vehicle.flight
        news = self._teller.news(sim)
        for t_s, _, text in news:
            self._say(f"{t_s:.2f} s: {text}")
        if self._ground is not None:
            self._ground.say(news)
        self.listen()
        self.link.latency.add(time.perf_counter() - began_s)
        self.pace.wait(sim.frames / sim.rate_hz, lambda: self.ended)
        return news

    def listen(self) -> None:
        """Obey the ground station and the page, and let them know how it goes."""
        if self._page is not None:
            self._page.tick()
        if self._ground is not None:
            for says in self._ground.serve(time.monotonic(), self.inject):
                self._say(says)

    def inject(self, params: tuple[float, float, float]) -> tuple[int, str]:
        """Break or repair what a MAVLink command asks for."""
        return failures.inject(self.vehicle.flight, self.vehicle.outputs.channels, params)

    @property
    def over(self) -> bool:
        """Whether there is nothing left to answer."""
        return self.ended or self.vehicle.over

    def result(self) -> Flight:
        """What the flight has yielded, with a section `link` in its metrics."""
        landed = self.vehicle.flight.land()
        found = self._without_certainty(self._ended_early(Metrics.of(landed.metrics)))
        found = replace(
            found,
            flight=replace(found.flight, law=NAMES[self.options.protocol]),
            tracking=replace(found.tracking, pre_fault_rms_deg_s=None, post_fault_rms_deg_s=None),
            link=self._link_metrics(),
        )
        return replace(landed, metrics=found.document())

    def _link_metrics(self) -> LinkMetrics:
        self.link.counts["off_rate"] = self.vehicle.off_rate
        return LinkMetrics.of({
            "protocol": self.options.protocol.value,
            "packets_hz": self.vehicle.packets_hz,
            "frames_hz": self.vehicle.scenario.rate_hz,
            **self.link.document(),
            "diagnosed_from_s": self.vehicle.flight.listens_from_s,
            "speed": self.pace.speed,
            "late_ms": round(1e3 * self.pace.late_s, 3),
            "said": [text._asdict() for text in self._teller.kept],
        })  # fmt: skip

    def _ended_early(self, found: Metrics) -> Metrics:
        """A flight that somebody ended before its time has not done what is expected of it."""
        if not self.ended or self.vehicle.over:
            return found
        at_s = self.vehicle.flight.t_s
        self._say(f"interrupted at {at_s:.2f} s of {self.vehicle.scenario.duration_s:g} s: not passed")
        return replace(found, interrupted_s=at_s, passed=False)

    def _without_certainty(self, found: Metrics) -> Metrics:
        """No alarm was certain of what broke before the diagnosis began, near the ground."""
        from_s, fault = self.vehicle.flight.listens_from_s, found.fault
        if from_s is None:
            self._say("the diagnosis never began: near the ground nothing is diagnosed")
        if from_s is None or (fault and fault.at_s < from_s):
            return replace(found, detection=replace(found.detection, guaranteed_delay_s=None))
        return found

    def close(self) -> None:
        """Hang up."""
        if self._ground is not None:
            self._ground.close()


def serve(scenario: Scenario, options: Options, say: Say) -> Flight:
    """Fly a scenario under the autopilot that calls, until the flight or SIGINT or SIGTERM ends it.

    say: takes lines for people: the address, what is left out of the scenario, what the diagnosis finds.
    Raises BadInput for an address that cannot be had, or a flight that cannot be begun.
    """
    scenario, left_out = without_reference(scenario)
    for line in left_out:
        say(line)
    if options.page is not None:
        scenario = ready_for_hands(scenario)
    kind = socket.SOCK_DGRAM if options.protocol is Protocol.ardupilot else socket.SOCK_STREAM
    with _listening(options, kind) as listener, contextlib.ExitStack() as besides:
        endpoint = Endpoint(scenario, options, say)
        if options.page is not None:
            endpoint.show(besides.enter_context(beside(options.page)))
        if kind == socket.SOCK_STREAM:
            listener.listen()
        host, port = listener.getsockname()[:2]
        say(f"{NAMES[options.protocol]}: {'UDP' if kind == socket.SOCK_DGRAM else 'TCP'} {host}:{port}")
        try:
            with _until_told(endpoint):
                (_serve_datagrams if kind == socket.SOCK_DGRAM else _serve_stream)(endpoint, listener, say)
            return endpoint.result()
        finally:
            endpoint.close()


@contextlib.contextmanager
def _listening(options: Options, kind: int) -> Iterator[socket.socket]:
    """A socket at the address asked for."""
    port = PORTS[options.protocol] if options.port is None else options.port
    with socket.socket(socket.AF_INET, kind) as listener:
        if kind == socket.SOCK_STREAM:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((options.host, port))
        except (OSError, UnicodeError) as error:
            says = getattr(error, "strerror", None) or error
            where = f"--host, --port: {options.host}:{port}"
            raise BadInput(f"{where} cannot be had ({says}), allowed: an address of this machine") from None
        yield listener


@contextlib.contextmanager
def _until_told(endpoint: Endpoint) -> Iterator[None]:
    """SIGINT and SIGTERM end the flight in good order."""

    def end(*_: Any) -> None:
        endpoint.ended = True

    before = {}
    with contextlib.suppress(ValueError):  # not the main thread: it ends in its own way
        before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _serve_datagrams(endpoint: Endpoint, listener: socket.socket, say: Say) -> None:
    protocol, complaint = Ardupilot(endpoint.vehicle, endpoint.link), ""
    listener.settimeout(WAIT_S)
    while not endpoint.over:
        try:
            datagram, peer = listener.recvfrom(MOST_BYTES)
        except TimeoutError:
            endpoint.listen()
            continue
        except ConnectionError:  # the peer that was answered last has gone
            continue
        began_s = time.perf_counter()
        answer = protocol.take(datagram, peer, time.monotonic())
        if protocol.complaint and protocol.complaint != complaint:
            complaint = protocol.complaint
            say(complaint)
        if answer is not None:
            endpoint.after(began_s)
            with contextlib.suppress(OSError):  # the autopilot has gone: it will ask again, or another will
                listener.sendto(answer, peer)


def _serve_stream(endpoint: Endpoint, listener: socket.socket, say: Say) -> None:
    mavlink = Mavlink()
    protocol = Px4(endpoint.vehicle, endpoint.link, mavlink, endpoint.inject)
    listener.setblocking(False)
    while not endpoint.over:
        endpoint.listen()
        ready, _, _ = select.select([listener], [], [], WAIT_S)
        if ready:
            with contextlib.suppress(OSError), listener.accept()[0] as line:
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                say("connected")
                _serve_line(endpoint, protocol, mavlink, line, listener)
                say("disconnected")


def _serve_line(
    endpoint: Endpoint, protocol: Px4, mavlink: Mavlink, line: socket.socket, listener: socket.socket
) -> None:
    """One connection, to its end. Another caller meanwhile is turned away."""
    vehicle = endpoint.vehicle
    _send(line, protocol.connect(time.monotonic()), endpoint)
    while not endpoint.over:
        step_s = 1.0 / (vehicle.packets_hz * (endpoint.pace.speed or 1.0))
        ready, _, _ = select.select([line, listener], [], [], step_s)
        began_s = time.perf_counter()
        if line in ready:
            data = line.recv(MOST_BYTES)
            if not data:
                return
            answer = protocol.take(data, time.monotonic())
        else:
            answer = protocol.tick(time.monotonic(), step_s)
        if listener in ready and not _has_gone(line):
            listener.accept()[0].close()
            endpoint.link.counts["strangers"] += 1
        for says in protocol.done:
            endpoint._say(says)
        protocol.done.clear()
        if answer:
            _send(line, mavlink.texts(endpoint.after(began_s)) + answer, endpoint)
    _hang_up(line)


def _send(line: socket.socket, data: bytes, endpoint: Endpoint) -> None:
    """Send all of it; a peer that does not read is waited for until somebody ends the flight."""
    line.setblocking(False)
    left = memoryview(data)
    while left and not endpoint.ended:
        _, ready, _ = select.select([], [line], [], WAIT_S)
        if ready:
            with contextlib.suppress(BlockingIOError):
                left = left[line.send(left) :]


def _has_gone(line: socket.socket) -> bool:
    """Whether the other end has hung up, and nothing it said before is left to be read."""
    readable, _, _ = select.select([line], [], [], 0.0)
    return bool(readable) and not line.recv(1, socket.MSG_PEEK)


def _hang_up(line: socket.socket) -> None:
    """Close a line of which the other end is to hear the last word: with words unread it would be reset."""
    line.shutdown(socket.SHUT_WR)
    line.setblocking(False)
    until_s = time.monotonic() + HANG_UP_S
    while (left_s := until_s - time.monotonic()) > 0.0:
        ready, _, _ = select.select([line], [], [], left_s)
        if ready and not line.recv(MOST_BYTES):
            return
