"""Where the installed command begins: Ctrl-C ends it without a traceback, while it imports too."""

import signal
import sys
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line."""
    try:
        from beaver_ftc.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    run()
