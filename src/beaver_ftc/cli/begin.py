"""Where the installed command begins: Ctrl-C ends it without a traceback, while it imports too."""

import gc
import signal
import sys
from typing import NoReturn

# Containers made before the collector looks for cycles; with Python's 700 it looks through all that is
# imported again and again: a tenth of the time of a short command, for a few megabytes.
COLLECTED_EVERY = 50_000


def main() -> NoReturn:
    """Run the command line."""
    gc.set_threshold(COLLECTED_EVERY, 20, 100)
    try:
        from beaver_ftc.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    run()
