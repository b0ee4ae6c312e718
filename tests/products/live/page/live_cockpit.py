"""A live cockpit as a user has it: the command, its address, and a browser's cookie."""

import contextlib
import signal
import subprocess
import sys
import urllib.request
from dataclasses import dataclass
from http.cookiejar import CookieJar
from pathlib import Path
from urllib.parse import urlsplit

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import serve


@dataclass
class Cockpit:
    """The running command; address: as printed, good for one browser."""

    process: subprocess.Popen
    address: str
    out: Path

    @property
    def port(self):
        return urlsplit(self.address).port

    @property
    def home(self):
        """The page without its token."""
        return self.address.partition("?")[0]


def started(out, *arguments):
    """Start the command, wait for the address."""
    code = "from beaver_ftc.cli.main import main; main()"
    command = [sys.executable, "-c", code, "live", *arguments, "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    assert line.startswith("live: "), process.stderr.read()
    return Cockpit(process, line.split()[1], out)


def ended(cockpit, number=signal.SIGINT):
    """End it; (exit status, what it said on standard error, but for a cold machine's word)."""
    cockpit.process.send_signal(number)
    _, says = cockpit.process.communicate(timeout=30)
    cold = "compiling", "making ready"
    lines = [line for line in says.splitlines() if not any(word in line for word in cold)]
    return cockpit.process.returncode, "\n".join(lines)


def browser():
    """An opener that keeps cookies and follows redirects, as a browser does; and its jar."""
    jar = CookieJar()
    return urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar)), jar


def own_address():
    """This machine's address for others, if it has one."""
    with contextlib.suppress(BadInput):
        return serve._outward()
    return None
