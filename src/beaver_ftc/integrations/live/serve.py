"""Everything together: the flight process, the web server, the address, and a clean end."""

import asyncio
import contextlib
import multiprocessing
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.integrations.live import BAD_INPUT, EVERYONE, MAX_BYTES

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

    import uvicorn

    from beaver_ftc.scenario.schema import Scenario

LOOPBACK = "127.0.0.1"
LAST_WORDS_S = 3.0  # the flight process is given so long to end

Heard = Callable[[int | str, bytes | str], None]  # a page and its message, or why the flight has ended


def serve(load: "Callable[[], Scenario]", out: Path, port: int, say: Callable[[str], None]) -> None:
    """Serve the page until SIGINT or SIGTERM. say: prints the address once a page can be opened.

    load: gives the scenario, while the flight's process gets ready beside. Raises BadInput for a port in use
    or a flight that cannot be begun, SimulationFailed if the flight's process dies.
    """
    with _listening(port) as listener, _flight(out) as (process, pipe):
        try:
            pipe.send(load())
        except BadInput:
            process.terminate()
            raise
        ended = asyncio.run(_serve(listener, pipe, say))
    if ended is not None:
        kind, says = ended
        raise BadInput(says) if kind == BAD_INPUT else SimulationFailed(says)


@contextlib.contextmanager
def beside(port: int) -> Iterator[Connection]:
    """Serve the page from a process of its own, for a flight of this one: the flight's end of the pipe.

    Its first word is `at ADDRESS`; `flying.py` has the others. Raises BadInput for a port in use.
    """
    context = multiprocessing.get_context("spawn")
    with _listening(port) as listener:
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
    asyncio.run(_serve(listener, pipe, lambda address: pipe.send((EVERYONE, f"at {address}"))))


@contextlib.contextmanager
def _listening(port: int) -> Iterator[socket.socket]:
    """A socket on the loopback interface; port 0: whichever is free."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    with listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((LOOPBACK, port))
        except OSError as error:
            raise BadInput(
                f"--port: {port} cannot be had ({error.strerror}), allowed: another, 0 for any"
            ) from None
        yield listener


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
    from beaver_ftc.integrations.live import flying

    flying.main(connection, out)


async def _serve(
    listener: socket.socket, pipe: Connection, say: Callable[[str], None]
) -> tuple[str, str] | None:
    """Run the server; returns why it ended, kind and words, None for a signal."""
    import uvicorn

    from beaver_ftc.integrations.live.server import Gate, Pages, application

    gate, pages = Gate(listener.getsockname()[1]), Pages()

    def ask(page: int, text: str) -> None:
        with contextlib.suppress(OSError):  # it has died: `_listen` says so
            pipe.send((page, text))

    config = uvicorn.Config(
        application(gate, pages, ask),
        log_level="error", access_log=False, lifespan="off", server_header=False,
        ws_max_size=MAX_BYTES, ws_ping_interval=20.0, timeout_graceful_shutdown=2,
    )  # fmt: skip
    server = uvicorn.Server(config)
    # its own raises the signals again at its end
    server.capture_signals = contextlib.nullcontext  # type: ignore[assignment, method-assign]
    _on_signals(server)
    ended: list[tuple[str, str]] = []

    def heard(page: int | str, message: bytes | str) -> None:
        if isinstance(page, int) and isinstance(message, bytes):
            pages.tell(page, message)
        else:
            ended.append((str(page), str(message)))
            server.should_exit = True

    arguments = pipe, asyncio.get_running_loop(), heard
    threading.Thread(target=_listen, args=arguments, daemon=True, name="flight").start()
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    while not (server.started or serving.done()):
        await asyncio.sleep(0.01)
    say(gate.invitation())  # the page loads while the flight is being prepared
    await serving
    return ended[0] if ended else None


def _listen(pipe: Connection, loop: asyncio.AbstractEventLoop, heard: Heard) -> None:
    """Hand on what the flight process says, from a thread of its own, until there is nothing more."""
    with contextlib.suppress(RuntimeError):  # the loop is closed: the server has ended
        try:
            while True:
                loop.call_soon_threadsafe(heard, *pipe.recv())
        except (EOFError, OSError):
            loop.call_soon_threadsafe(heard, "died", "the flight process has ended unexpectedly")


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
