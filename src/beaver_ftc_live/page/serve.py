"""Everything together: the flight process, the web server, the address, and a clean end."""

import asyncio
import contextlib
import errno
import multiprocessing
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from ipaddress import ip_address
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.documents import BadInput, SimulationFailed
from beaver_ftc_live.page import BAD_INPUT, EVERYONE, MAX_BYTES

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

    import uvicorn

    from beaver_ftc.scenario import Scenario

LOOPBACK = "127.0.0.1"
NO_SENSOR = ((socket.AF_INET, "198.51.100.1"), (socket.AF_INET6, "2001:db8::1"))  # addresses for documents
LAST_WORDS_S = 3.0  # the flight process is given so long to end

Receive = Callable[[int | str, bytes | str], None]  # a page and its message, or why the flight has ended
Say = Callable[[str, list[str]], None]  # an address for the pilot, and one for each guest


@dataclass(frozen=True)
class Place:
    """Where to listen, and for whom. host: an address of this machine, or a name of one."""

    port: int = 0
    host: str = LOOPBACK
    guests: int = 0


def serve(load: "Callable[[], Scenario]", out: Path, place: Place, say: Say) -> None:
    """Serve the page until SIGINT or SIGTERM. say: prints addresses once a page can be opened.

    load: gives the scenario, while the flight's process gets ready beside. Raises BadInput for an address
    that cannot be had or a flight that cannot be begun, SimulationFailed if the flight's process dies.
    """
    with _listening(place) as listener, _flight(out) as (process, pipe):
        try:
            pipe.send(load())
        except BadInput:
            process.terminate()
            raise
        ended = asyncio.run(_serve(listener, pipe, say, place))
    if ended is not None:
        kind, says = ended
        raise BadInput(says) if kind == BAD_INPUT else SimulationFailed(says)


@contextlib.contextmanager
def beside(port: int) -> Iterator[Connection]:
    """Serve the page from a process of its own, for a flight of this one: the flight's end of the pipe.

    Its first word is `at ADDRESS`; `flying.py` has the others. Raises BadInput for a port in use.
    """
    context = multiprocessing.get_context("spawn")
    with _listening(Place(port)) as listener:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve_beside, args=(theirs, listener), daemon=True)
        process.start()
        theirs.close()
    try:
        yield ours
    finally:
        process.terminate()
        process.join()


def _serve_beside(pipe: Connection, listener: socket.socket) -> None:
    """What that process does."""
    asyncio.run(_serve(listener, pipe, lambda address, _: pipe.send((EVERYONE, f"at {address}"))))


@contextlib.contextmanager
def _listening(place: Place) -> Iterator[socket.socket]:
    """A socket at that address; port 0: whichever is free."""
    family, address = _resolved(place)
    with contextlib.ExitStack() as opened:
        try:
            listener = opened.enter_context(socket.socket(family, socket.SOCK_STREAM))
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, not _is_any(address[0]))
            listener.bind(address)
        except OSError as error:
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise BadInput(f"--host: {place.host} is no address of this machine, {ALLOWED}") from None
            raise BadInput(
                f"--port: {place.port} cannot be had ({error.strerror}), allowed: another, 0 for any"
            ) from None
        yield listener


ALLOWED = "allowed: one that it has, 0.0.0.0 for all of them"


def _resolved(place: Place) -> tuple[socket.AddressFamily, Any]:
    """What to bind. Raises BadInput for an address that no browser can be sent to."""
    try:
        found = socket.getaddrinfo(place.host, place.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, _, _, _, address = found[0]
        ip = ip_address(str(address[0]))
    except (OSError, UnicodeError, ValueError):
        raise BadInput(f"--host: {place.host!r:.60} is no address, {ALLOWED}") from None
    if ip.is_multicast or (ip.is_reserved if ip.version == 4 else ip.is_link_local):
        raise BadInput(f"--host: {place.host} is none that a browser can open, {ALLOWED}")
    return family, address


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach it. Raises BadInput for what is no address."""
    return ip_address(str(_resolved(Place(host=host))[1][0])).is_loopback


def _is_any(address: str) -> bool:
    """Whether that stands for all addresses of this machine."""
    return ip_address(address).is_unspecified


def names_of(listener: socket.socket, host: str) -> tuple[str, ...]:
    """By which names browsers may call the server, the one for its links first. Raises BadInput if none."""
    from beaver_ftc_live.page.gate import LOOPBACK_NAMES, as_name

    bound = listener.getsockname()[0]
    if _is_any(bound):
        return as_name(_outward()), *LOOPBACK_NAMES
    own = as_name(bound)
    given = () if _is_address(host) else (host.lower(),)
    local = LOOPBACK_NAMES[1:] if ip_address(bound).is_loopback else ()
    return tuple(dict.fromkeys((*given, own, *local)))


def _is_address(host: str) -> bool:
    with contextlib.suppress(ValueError):
        return bool(ip_address(host))
    return False


def _outward() -> str:
    """The address of this machine by which it reaches others. Nothing is sent to find it."""
    for family, nobody in NO_SENSOR:
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((nobody, 9))
            return str(probe.getsockname()[0])
    raise BadInput("--host: this machine has no way to others, allowed: the address that they know it by")


@contextlib.contextmanager
def _flight(out: Path) -> Iterator[tuple["BaseProcess", Connection]]:
    """The flight process, and the pipe to it; the first thing it is sent is the scenario."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_fly, args=(theirs, str(out)), name="beaver-ftc flight", daemon=True)
    process.start()
    theirs.close()
    try:
        yield process, ours
    finally:
        with contextlib.suppress(OSError):
            ours.send((EVERYONE, "end"))
        process.join(LAST_WORDS_S)
        if process.is_alive():
            process.terminate()
            process.join()


def _fly(connection: Connection, out: str) -> None:
    """What the process does; the server itself imports nothing of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends it
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    from beaver_ftc_live.page import flying

    flying.main(connection, out)


async def _serve(
    listener: socket.socket, pipe: Connection, say: Say, place: Place = Place()
) -> tuple[str, str] | None:
    """Run the server; returns why it ended, kind and words, None for a signal."""
    import uvicorn

    from beaver_ftc_live.page.gate import Gate
    from beaver_ftc_live.page.server import Pages, application

    bound, port = listener.getsockname()[:2]
    gate = Gate(port, names_of(listener, place.host), place.guests, any_own=_is_any(bound))
    pages = Pages()

    def ask(page: int, text: str) -> None:
        with contextlib.suppress(OSError):  # it has died: `_listen` says so
            pipe.send((page, text))

    config = uvicorn.Config(
        application(gate, pages, ask, lambda address: say(address, [])),
        log_level="error", access_log=False, lifespan="off", server_header=False, proxy_headers=False,
        ws_max_size=MAX_BYTES, ws_ping_interval=20.0, ws_per_message_deflate=False,
        timeout_graceful_shutdown=2,
    )  # fmt: skip
    server = uvicorn.Server(config)
    # its own raises the signals again at its end
    server.capture_signals = contextlib.nullcontext  # type: ignore[assignment, method-assign]
    _on_signals(server)
    ended: list[tuple[str, str]] = []

    def receive(page: int | str, message: bytes | str) -> None:
        if isinstance(page, int) and isinstance(message, bytes):
            pages.tell(page, message)
        else:
            ended.append((str(page), str(message)))
            server.should_exit = True

    arguments = pipe, asyncio.get_running_loop(), receive
    threading.Thread(target=_listen, args=arguments, daemon=True, name="flight").start()
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    while not (server.started or serving.done()):
        await asyncio.sleep(0.01)
    # the page loads while the flight is being prepared
    say(gate.link(gate.flyer), [gate.link(guest) for guest in gate.guests])
    await serving
    return ended[0] if ended else None


def _listen(pipe: Connection, loop: asyncio.AbstractEventLoop, receive: Receive) -> None:
    """Hand on what the flight process says, from a thread of its own, until there is nothing more."""
    with contextlib.suppress(RuntimeError):  # the loop is closed: the server has ended
        try:
            while True:
                loop.call_soon_threadsafe(receive, *pipe.recv())
        except (EOFError, OSError):
            loop.call_soon_threadsafe(receive, "died", "the flight process has ended unexpectedly")


def _on_signals(server: "uvicorn.Server") -> None:
    """SIGINT and SIGTERM end the server in good order."""
    loop = asyncio.get_running_loop()

    def end(*_: object) -> None:
        server.should_exit = True

    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, end)
        except NotImplementedError:  # Windows
            signal.signal(number, end)
