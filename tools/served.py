"""Commands of the package as processes of their own, without half a second to two for what each imports.

One process imports the package and flies once; each command is forked from it, with the arguments, folder,
environment, files and signals of its caller. `Served(python, bin)` starts it, with another
installation's interpreter if need be; `scripts(folder)` puts a `beaver-ftc` and a `python` there that ask it,
for shells: the latter for modules (`python -m tools.docs`), with any other arguments it is the interpreter.
With `ONE_CORE` in its environment a command sees one core: it starts no workers of its own, which would
import the package again. It needs Linux. Where the environment says of kernels what it did not say to the
one process (where they are kept, whether they are compiled), the script starts the command as it is.
"""

import array
import gc
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any, NoReturn

POSSIBLE = hasattr(os, "pidfd_open")
SECONDS = "BEAVER_FTC_SERVED_SECONDS"  # a file to which the script adds the processor time of each command
ONE_CORE = "BEAVER_FTC_SERVED_ONE_CORE"
FIRST = ("run", "elevator-partial-loss", "--certificate")  # what the one process does before it serves
DECIDES = ("XDG_CACHE_HOME", "NUMBA_DISABLE_JIT", "BEAVER_FTC_COMPILER")  # read when kernels are imported
_PATIENCE_S = 600.0
_SCRIPT = """\
#!{python} -IS
import array, json, os, signal, socket, sys
name = os.path.basename(sys.argv[0])
elsewhere = any(os.environ.get(name) != value for name, value in {decides!r}.items())
if elsewhere or (name == "python" and sys.argv[1:2] != ["-m"]):
    own = {bin!r} + "/" + name
    os.execv(own, [own, *sys.argv[1:]])
asked = {{"argv": [name, *sys.argv[1:]], "cwd": os.getcwd(), "environment": dict(os.environ)}}
server = socket.socket(socket.AF_UNIX)
server.connect({address!r})
files = array.array("i", (0, 1, 2))
server.sendmsg([b"x"], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, files)])
server.sendall(json.dumps(asked).encode() + b"\\n")
answers = server.makefile()
started = int(answers.readline())
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    if signal.getsignal(number) is not signal.SIG_IGN:
        signal.signal(number, lambda number, _: os.kill(started, number))
status, seconds = answers.readline().split()
log = os.environ.get({seconds!r})
if log:
    with open(log, "a") as file:
        file.write(seconds + "\\n")
status = int(status)
if status < 0:
    signal.signal(-status, signal.SIG_DFL)
    os.kill(os.getpid(), -status)
os._exit(status)
"""


class Served:
    """The one process from which commands are forked. bin: where the installation's own command lies."""

    def __init__(self, python: Path, bin: Path, environment: dict[str, str] | None = None) -> None:
        self._python, self._bin = python, bin
        self._environment = dict(os.environ if environment is None else environment)
        self._folder = tempfile.TemporaryDirectory(prefix="served-")
        self._address = str(Path(self._folder.name) / "socket")
        self._process = subprocess.Popen(
            [python, __file__, self._address, bin],
            env=self._environment,
            cwd=self._folder.name,
            stdin=subprocess.PIPE,  # closed when this process ends, however it ends: the server ends too
            start_new_session=True,
        )

    def scripts(self, folder: Path) -> None:
        """`beaver-ftc` and `python` in this folder that are served, once the one process is ready."""
        end = time.monotonic() + _PATIENCE_S
        while not Path(self._address).exists():
            if self._process.poll() is not None or time.monotonic() > end:
                raise RuntimeError("the process that serves commands did not begin")
            time.sleep(0.02)
        text = _SCRIPT.format(
            python=self._python,
            decides={name: self._environment.get(name) for name in DECIDES},
            bin=str(self._bin),
            address=self._address,
            seconds=SECONDS,
        )
        for name in ("beaver-ftc", "python"):
            (folder / name).write_text(text)
            (folder / name).chmod(0o755)

    def end(self) -> None:
        """End the one process; commands that still run end by themselves."""
        if self._process.stdin:
            self._process.stdin.close()
        self._process.wait()
        self._folder.cleanup()


def _serve(address: str, bin: str) -> NoReturn:
    """Fork a process for each that connects, until standard input is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _begin(bin)
    gc.collect()
    gc.freeze()
    ready = f"{address}-"
    server = socket.socket(socket.AF_UNIX)
    server.bind(ready)
    server.listen(16)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for those that wait for the commands
    os.rename(ready, address)
    while True:
        readable, _, _ = select.select([server, 0], [], [])
        if 0 in readable:
            os._exit(0)
        asking, _ = server.accept()
        if os.fork() == 0:
            server.close()
            _attend(asking, bin)
        asking.close()


def _begin(bin: str) -> None:
    """Import, load kernels and draw figures, once: as the command would, with its words left unsaid."""
    sys.path[0] = bin
    from beaver_ftc.cli.main import main

    sys.argv = [f"{bin}/beaver-ftc", *FIRST]
    with (
        open(os.devnull, "w") as nothing,
        redirect_stdout(nothing),
        redirect_stderr(nothing),
        suppress(SystemExit),
    ):
        main()
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _attend(asking: socket.socket, bin: str) -> NoReturn:
    """Fork the command, say its number, wait for it, say its status; if the asker goes away, end it."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    files = array.array("i")
    _, given, _, _ = asking.recvmsg(1, socket.CMSG_LEN(3 * files.itemsize))
    files.frombytes(given[0][2])
    asked = json.loads(asking.makefile().readline())
    child = os.fork()
    if child == 0:
        os.setsid()
        asking.close()
        _become(asked, files, bin)
    for number in files:
        os.close(number)
    asking.sendall(f"{child}\n".encode())
    ended = os.pidfd_open(child)
    readable, _, _ = select.select([ended, asking], [], [])
    if ended not in readable:
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
    _, status, used = os.wait4(child, 0)
    with suppress(OSError):
        asking.sendall(f"{os.waitstatus_to_exitcode(status)} {used.ru_utime + used.ru_stime}\n".encode())
    os._exit(0)


def _become(asked: dict[str, Any], files: array.array, bin: str) -> NoReturn:
    """The command itself, in a process that has imported it."""
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    name, *rest = asked["argv"]
    sys.argv = [f"{bin}/{name}", *rest]
    sys.path[1:1] = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for stream, number, mode in (("stdin", 0, "r"), ("stdout", 1, "w"), ("stderr", 2, "w")):
        replacement = open(number, mode, encoding="utf-8", buffering=1 if number == 2 else -1, closefd=False)  # noqa: SIM115
        setattr(sys, stream, replacement)
        setattr(sys, f"__{stream}__", replacement)
    if ONE_CORE in os.environ:
        setattr(os, "sched_getaffinity", lambda _: {0})  # noqa: B010
    from beaver_ftc.cli.begin import main
    from beaver_ftc.documents.errors import say_once

    say_once.cache_clear()
    if name == "python":  # -m MODULE
        sys.path[0], sys.argv = asked["cwd"], rest[1:]
        runpy.run_module(rest[1], run_name="__main__", alter_sys=True)
        sys.exit()
    main()


if __name__ == "__main__":
    _serve(*sys.argv[1:])
