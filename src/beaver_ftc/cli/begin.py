"""Where the installed command begins: Ctrl-C ends it without a traceback, while it imports too."""

import atexit
import gc
import os
import signal
import sys
import threading
from typing import Any, NoReturn

# Containers made before the collector looks for cycles; with Python's 700 it looks through all that is
# imported again and again: a tenth of the time of a short command, for a few megabytes.
COLLECTED_EVERY = 50_000


AGAIN_S = 0.01


def deliver_again(lost: Any) -> None:
    """Repeat Ctrl-C that arrived where Python ignores exceptions, as in a callback of an import's lock.

    From a thread and a little later: at once it would arrive in this very function, and be lost again.
    """
    if issubclass(lost.exc_type, KeyboardInterrupt):
        threading.Timer(AGAIN_S, os.kill, [os.getpid(), signal.SIGINT]).start()
    else:
        sys.__unraisablehook__(lost)


def main() -> NoReturn:
    """Run the command line. With one thread for linear algebra, unless the environment says otherwise: of
    small matrices threads wait for one another, and sums in another order have other last digits."""
    gc.set_threshold(COLLECTED_EVERY, 20, 100)
    atexit.register(gc.freeze)  # a process that ends would look for cycles among all that it has
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.unraisablehook = deliver_again
    try:
        from beaver_ftc.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    run()
