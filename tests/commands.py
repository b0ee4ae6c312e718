"""Commands and runs of pytest as a shell sees them, in this process: nothing is imported or loaded twice."""

import contextlib
import io
import os
import signal
import subprocess
import sys

import pytest

from beaver_ftc.cli.main import main
from beaver_ftc.documents.errors import say_once
from beaver_ftc.plugins import VARIABLE

_SIGNALS = (signal.SIGTERM, signal.SIGHUP)


def beaver(*arguments, cwd):
    """What `beaver-ftc ARGUMENTS` prints in a folder, and its exit status."""
    arguments = [*map(os.fspath, arguments)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["beaver-ftc", *arguments])
        return _completed(main, arguments, cwd)


def run_pytest(*arguments, cwd):
    """What `python -m pytest ARGUMENTS` prints in a folder, and its exit status; modules of that folder
    are forgotten.
    """
    before = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(cwd)
        asked = ["-p", "no:cacheprovider", "-p", "no:faulthandler", "--basetemp", "tmp", *arguments]
        try:
            return _completed(lambda: sys.exit(pytest.main(asked)), asked, cwd)
        finally:
            for name in set(sys.modules) - before:
                if (getattr(sys.modules[name], "__file__", None) or "").startswith(f"{cwd}{os.sep}"):
                    del sys.modules[name]


def _completed(main, arguments, cwd):
    handlers, registered = [signal.getsignal(number) for number in _SIGNALS], os.environ.get(VARIABLE)
    out, err = io.StringIO(), io.StringIO()
    say_once.cache_clear()
    try:
        with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as ended:
        status = ended.code or 0
    finally:
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
