"""Signals that arrive while LLVM calls Python.

LLVM asks for kept machine code by a Python function. A signal's handler that raises there, as that of Ctrl-C
does, raises inside of a call from C: the exception is lost, LLVM goes on without the code, and the process
crashes.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator

_HELD = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Handle signals when this is over; what is done meanwhile lasts milliseconds, or cannot be interrupted.

    Python handles signals in the main thread alone. A signal that ends the process at once still does.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    handlers = {number: signal.getsignal(number) for number in _HELD}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in arrived[:1]:
            signal.raise_signal(number)
