"""The endpoint for an autopilot: sockets, real time, the end of the flight, and its result."""

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
PX4_HZ = 250.0  # rate of HIL_SENSOR without the option --rate
MOST_BYTES = 65536  # largest number of bytes that are received at once
WAIT_S = 0.25  # longest wait for a packet
HANG_UP_S = 0.5  # longest wait until the autopilot closes the connection, too
NAMES = {Protocol.ardupilot: "ArduPilot", Protocol.px4: "PX4"}

Say = Callable[[str], None]


@dataclass(frozen=True)
class Options:
    """The settings of the endpoint.

    port: 0 for any. speed: multiple of real time, 0: as fast as the autopilot answers. ground: host and port
    of a ground station. page: port of the live page, 0 for any, None without a page. The others are those of
    `Vehicle`.
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
    """Delays answers to real time. speed: multiple of real time; 0: no delay. late_s: the largest time by
    which an answer was late."""

    speed: float
    late_s: float = 0.0
    _from: tuple[float, float] = field(default=(0.0, inf))  # of the clock, of the flight, s

    def wait(self, t_s: float, ended: Callable[[], bool] = lambda: False) -> None:
        """Wait until the flight time t_s is due. After a restart of the flight, or a delay above WAIT_S, time
        counts from this instant.

        ended: function that returns whether the wait is to end; it is called every WAIT_S.
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
    """The part that both protocols share: the flight, the texts on it, and its end. say: function that prints
    a line."""

    def __init__(self, scenario: Scenario, options: Options, say: Say) -> None:
        pulses = options.protocol is Protocol.ardupilot
        rate_hz = PX4_HZ if options.rate_hz is None and not pulses else options.rate_hz
        self.options = options
        self._say = say
        self.ended = False
        self.link = Link()
        self._teller = Teller()
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
        """The new texts, after the answer of a frame is made and its time has come. began_s: time of
        perf_counter at which the answer was begun."""
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
        """Execute the commands of the ground station and the page, and send the state to the page."""
        if self._page is not None:
            self._page.tick()
        if self._ground is not None:
            for says in self._ground.serve(time.monotonic(), self.inject):
                self._say(says)

    def inject(self, params: tuple[float, float, float]) -> tuple[int, str]:
        """Inject or repair a fault by the parameters of a MAVLink command (`failures.inject`)."""
        return failures.inject(self.vehicle.flight, self.vehicle.outputs.channels, params)

    @property
    def over(self) -> bool:
        """Whether the flight has ended, by itself or by a signal."""
        return self.ended or self.vehicle.over

    def result(self) -> Flight:
        """The flight with its metrics, which have a section `link`."""
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
        """The metrics, which a flight that a signal ended before its time does not pass."""
        if not self.ended or self.vehicle.over:
            return found
        at_s = self.vehicle.flight.t_s
        self._say(f"interrupted at {at_s:.2f} s of {self.vehicle.scenario.duration_s:g} s: not passed")
        return replace(found, interrupted_s=at_s, passed=False)

    def _without_certainty(self, found: Metrics) -> Metrics:
        """The metrics, without a guaranteed delay for a fault before the diagnosis began near the ground."""
        from_s = self.vehicle.flight.listens_from_s
        fault = found.fault
        if from_s is None:
            self._say("the diagnosis never began: near the ground nothing is diagnosed")
        if from_s is None or (fault and fault.at_s < from_s):
            return replace(found, detection=replace(found.detection, guaranteed_delay_s=None))
        return found

    def close(self) -> None:
        """Close the line to the ground station."""
        if self._ground is not None:
            self._ground.close()


def serve(scenario: Scenario, options: Options, say: Say) -> Flight:
    """Fly a scenario under the autopilot that connects, until the flight, SIGINT or SIGTERM ends it.

    say: function that prints a line: the address, the keys that are left out, the results of the diagnosis.
    Raises BadInput for an address that is not available, or a flight that cannot begin.
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
        host, port = listener.getsockname()
        say(f"{NAMES[options.protocol]}: {'UDP' if kind == socket.SOCK_DGRAM else 'TCP'} {host}:{port}")
        try:
            with _ended_by_signal(endpoint):
                (_serve_datagrams if kind == socket.SOCK_DGRAM else _serve_stream)(endpoint, listener, say)
            return endpoint.result()
        finally:
            endpoint.close()


@contextlib.contextmanager
def _listening(options: Options, kind: int) -> Iterator[socket.socket]:
    """A socket at the address in the options."""
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
def _ended_by_signal(endpoint: Endpoint) -> Iterator[None]:
    """Context in which SIGINT and SIGTERM end the flight, so that its result is still written."""

    def end(*_: Any) -> None:
        endpoint.ended = True

    before = {}
    with contextlib.suppress(ValueError):  # not the main thread, which alone may set handlers
        before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _serve_datagrams(endpoint: Endpoint, listener: socket.socket, say: Say) -> None:
    protocol = Ardupilot(endpoint.vehicle, endpoint.link)
    complaint = ""
    listener.settimeout(WAIT_S)
    while not endpoint.over:
        try:
            datagram, peer = listener.recvfrom(MOST_BYTES)
        except TimeoutError:
            endpoint.listen()
            continue
        except ConnectionError:  # the peer of the last answer has gone
            continue
        began_s = time.perf_counter()
        answer = protocol.take(datagram, peer, time.monotonic())
        if protocol.complaint and protocol.complaint != complaint:
            complaint = protocol.complaint
            say(complaint)
        if answer is not None:
            endpoint.after(began_s)
            with contextlib.suppress(OSError):  # the autopilot has gone
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
    """Serve a connection to its end. A second one is closed meanwhile, and counted."""
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
    """Send all of the data; wait for a peer that does not read, unless the flight ends."""
    line.setblocking(False)
    left = memoryview(data)
    while left and not endpoint.ended:
        _, ready, _ = select.select([], [line], [], WAIT_S)
        if ready:
            with contextlib.suppress(BlockingIOError):
                left = left[line.send(left) :]


def _has_gone(line: socket.socket) -> bool:
    """Whether the other end has closed the connection, and all of its data are read."""
    readable, _, _ = select.select([line], [], [], 0.0)
    return bool(readable) and not line.recv(1, socket.MSG_PEEK)


def _hang_up(line: socket.socket) -> None:
    """Close a connection so that the other end still receives the last data: while its own data are unread,
    the connection would be reset."""
    line.shutdown(socket.SHUT_WR)
    line.setblocking(False)
    until_s = time.monotonic() + HANG_UP_S
    while (left_s := until_s - time.monotonic()) > 0.0:
        ready, _, _ = select.select([line], [], [], left_s)
        if ready and not line.recv(MOST_BYTES):
            return
