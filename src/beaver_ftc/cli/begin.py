"""The start of the installed command: Ctrl-C ends it without a traceback, also during its imports."""

import atexit
import gc
import os
import signal
import sys
from typing import Any, NoReturn

from beaver_ftc.cli import repeat

# New containers after which the garbage collector runs. With Python's default of 700, it examines the imports
# many times, which takes a tenth of the time of a short command and saves a few megabytes.
COLLECTED_EVERY = 50_000


def repeat_interrupt(lost: Any) -> None:
    """Repeat a Ctrl-C that Python ignores; report any other exception that it ignores."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        repeat(signal.SIGINT)
    else:
        sys.__unraisablehook__(lost)


def main() -> NoReturn:
    """Run the command line, with one thread for linear algebra unless the environment sets another number.
    With small matrices, threads wait for one another, and sums in another order have other last digits."""
    gc.set_threshold(COLLECTED_EVERY, 20, 100)
    atexit.register(gc.freeze)  # otherwise the collector examines all objects when the process ends
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.unraisablehook = repeat_interrupt
    try:
        from beaver_ftc.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    run()
