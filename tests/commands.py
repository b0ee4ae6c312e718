"""Commands as a shell sees them, but in this process: nothing is imported or loaded a second time."""

import contextlib
import io
import os
import signal
import subprocess
import sys

from beaver_ftc.cli.main import main
from beaver_ftc.documents.errors import say_once
from beaver_ftc.plugins import VARIABLE

_SIGNALS = (signal.SIGTERM, signal.SIGHUP)


def beaver(*arguments, cwd):
    """What `beaver-ftc ARGUMENTS` prints in a folder, and its exit status."""
    given, handlers = sys.argv, [signal.getsignal(number) for number in _SIGNALS]
    registered = os.environ.get(VARIABLE)
    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["beaver-ftc", *map(os.fspath, arguments)]
    say_once.cache_clear()
    try:
        with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as ended:
        status = ended.code or 0
    finally:
        sys.argv = given
        _register(registered)
        for number, handler in zip(_SIGNALS, handlers, strict=True):
            signal.signal(number, handler)
    return subprocess.CompletedProcess(arguments, status, out.getvalue(), err.getvalue())


def _register(plugins):
    """What --plugin of a command registers lasts as long as that command."""
    if plugins is None:
        os.environ.pop(VARIABLE, None)
    else:
        os.environ[VARIABLE] = plugins
