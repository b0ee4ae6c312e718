"""A live cockpit as a user has it: the command, its address, and a browser's cookie."""

import contextlib
import json
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from dataclasses import dataclass
from http.cookiejar import CookieJar
from pathlib import Path
from urllib.parse import urlsplit

from websockets.sync.client import connect

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


class Seat:
    """What an address has yielded to a browser that follows redirects: its cookie, and websockets of it."""

    def __init__(self, link):
        jar = CookieJar()
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar))
        self.home, self.page = link.partition("?")[0], opener.open(link)
        assert (self.page.status, self.page.geturl()) == (200, self.home)  # the token is gone
        (self.jar,) = jar
        self.cookie = f"{self.jar.name}={self.jar.value}"

    def open(self, **more):
        origin = self.home.rpartition("/")[0].rpartition("/")[0]
        place = self.home.replace("http", "ws", 1) + "socket"
        more = {"origin": origin, "max_size": None, "max_queue": None} | more
        return connect(place, additional_headers={"Cookie": self.cookie}, **more)


def status(address, **headers):
    """The HTTP status of a GET."""
    try:
        return urllib.request.urlopen(urllib.request.Request(address, headers=headers)).status
    except urllib.error.HTTPError as error:
        return error.code


def until(link, kind, having=lambda told: True, timeout_s=600.0):
    """The next message of a kind with that; a machine on which nothing has flown yet compiles first."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        told = json.loads(link.recv(timeout=timeout_s))
        if told["k"] == kind and having(told):
            return told
    raise AssertionError(f"no {kind}")


def own_address():
    """This machine's address for others, if it has one."""
    with contextlib.suppress(BadInput):
        return serve._outward()
    return None
