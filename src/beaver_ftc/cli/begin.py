"""Where the installed command begins: Ctrl-C ends it without a traceback, while it imports too."""

import atexit
import gc
import os
import signal
import sys
from typing import Any, NoReturn

from beaver_ftc.cli import repeat

# Containers made before the collector looks for cycles; with Python's 700 it looks through all that is
# imported again and again: a tenth of the time of a short command, for a few megabytes.
COLLECTED_EVERY = 50_000


def repeat_interrupt(lost: Any) -> None:
    """Repeat Ctrl-C; say what else is ignored."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        repeat(signal.SIGINT)
    else:
        sys.__unraisablehook__(lost)


def main() -> NoReturn:
    """Run the command line. With one thread for linear algebra, unless the environment says otherwise: of
    small matrices threads wait for one another, and sums in another order have other last digits."""
    gc.set_threshold(COLLECTED_EVERY, 20, 100)
    atexit.register(gc.freeze)  # a process that ends would look for cycles among all that it has
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.unraisablehook = repeat_interrupt
    try:
        from beaver_ftc.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    run()
