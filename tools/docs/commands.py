"""What the commands of the marks print: each is run once, in a folder with the files that the pages show."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from tools.docs.pages import ROOT
from tools.served import ONE_CORE, POSSIBLE, SECONDS, Served

LONGEST_S = 120.0  # of processor, for a command that is not dear
PATIENCE = 5.0  # so many times longer by the clock, on a busy machine
SHARED = "BEAVER_FTC_DOCS_SHARED"  # the folder of what table makers share
_OURS = ("PYTEST", "COV_", "COVERAGE", "BEAVER_FTC", "FORCE_COLOR", "NUMBA_DISABLE")  # no reader has them
BIN = "bin"  # in the shared folder: commands that are served
_BIN = Path(sys.executable).parent
PICTURES = "images"  # what a command draws, below its folder and below docs/


@dataclass(frozen=True)
class Output:
    """What a command printed and drew. fault: why it cannot be used, in words; empty if it can."""

    text: str
    fault: str = ""
    processor_s: float = 0.0
    pictures: Mapping[str, bytes] = field(default_factory=dict)


class Checkout:
    """The package of this checkout, as the tests of the pages use an installed one."""

    def __init__(self, shared: Path, needed: Collection[str] = ()) -> None:
        self._running: set[int] = set()
        self._ended = False
        inherited = os.environ.items()
        self.environment = {
            **{name: value for name, value in inherited if name in needed or not name.startswith(_OURS)},
            "PATH": os.pathsep.join((str(shared / BIN), str(_BIN), os.environ.get("PATH", os.defpath))),
            "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'src'}",
            "COLUMNS": "80",
            "NO_COLOR": "1",
            ONE_CORE: "1",
            SHARED: str(shared),
        }

    def run(self, line: str, cwd: Path, longest_s: float | None) -> tuple[int, str, str, float]:
        """(status, standard output, standard error, processor time in s) of a line in bash."""
        with (
            tempfile.TemporaryFile() as out,
            tempfile.TemporaryFile() as err,
            tempfile.NamedTemporaryFile() as served,
        ):
            process = subprocess.Popen(
                ["bash", "-c", line],
                cwd=cwd,
                env=self.environment | {SECONDS: served.name},
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
            self._running.add(process.pid)
            if self._ended:
                _end(process.pid)
            clock = threading.Timer(PATIENCE * (longest_s or 1e6), _end, (process.pid,))
            clock.start()
            _, status, used = os.wait4(process.pid, 0)  # with the time of its children
            clock.cancel()
            self._running.discard(process.pid)
            process.returncode = os.waitstatus_to_exitcode(status)
            said = [stream.seek(0) or stream.read().decode(errors="replace") for stream in (out, err)]
            seconds = sum(map(float, served.read().split()))
        return process.returncode, *said, used.ru_utime + used.ru_stime + seconds

    def end(self) -> None:
        """End what is running, with everything it has started."""
        self._ended = True
        for group in list(self._running):
            _end(group)

    def beaver(self, *arguments: str, cwd: Path) -> subprocess.CompletedProcess:
        """Run `beaver-ftc` with these arguments in a folder."""
        line = " ".join(("beaver-ftc", *map(str, arguments)))
        status, out, err, _ = self.run(line, cwd, None)
        return subprocess.CompletedProcess(line, status, out, err)


def _end(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def outputs(
    cheap: Iterable[str],
    dear: Collection[str] = (),
    needed: Collection[str] = (),
) -> dict[str, Output]:
    """{command: what it printed} of each command, once; only those that are dear may take their time.

    needed: environment variables that lead to data.
    """
    lines = sorted(dict.fromkeys((*dear, *cheap)), key=_rank)
    limits = [None if line in dear else LONGEST_S for line in lines]
    with tempfile.TemporaryDirectory() as shared, ThreadPoolExecutor(os.cpu_count()) as threads:
        checkout = Checkout(Path(shared), needed)
        served = None
        if POSSIBLE and lines:
            (Path(shared) / BIN).mkdir()  # commands are forked from one process that has imported the package
            served = Served(Path(sys.executable), _BIN, checkout.environment)
            served.scripts(Path(shared) / BIN)
        try:
            done = threads.map(lambda line, limit: _output(checkout, line, limit), lines, limits)
            return dict(zip(lines, done, strict=True))
        except BaseException:  # interrupted: nothing goes on behind us
            threads.shutdown(wait=False, cancel_futures=True)
            checkout.end()
            raise
        finally:
            if served:
                served.end()


def _rank(line: str) -> int:
    """Probes and tables fly most: begun last, one of them would keep one process while others have none."""
    return ("-probe" not in line) + ("tools.docs table" not in line)


def _output(checkout: Checkout, line: str, longest_s: float | None) -> Output:
    """What a command prints in a folder of its own, with its pictures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            _lay_out(line, folder, checkout)
        except (AssertionError, OSError, StopIteration) as error:
            return Output("", f"what it needs cannot be laid out: {str(error) or type(error).__name__}")
        status, out, err, used = checkout.run(line, folder, longest_s)
        text = "\n".join(row.rstrip() for row in out.strip("\n").splitlines())
        fault = _fault(status, text, err, used, longest_s, folder)
        return Output(text, fault, used, _pictures(folder / PICTURES))


def _lay_out(line: str, folder: Path, checkout: Checkout) -> None:
    """The files that the pages show, as the tests of the pages lay them out; tools need none."""
    if "python -m tools." in line:
        return
    if str(ROOT / "tests") not in sys.path:
        sys.path.insert(0, str(ROOT / "tests"))
    from acceptance.materials import lay_out

    lay_out(line, folder, checkout)


def _fault(status: int, text: str, err: str, used: float, longest_s: float | None, folder: Path) -> str:
    """Why what a command printed cannot stand in a page; empty if it can."""
    if longest_s is not None and (used > longest_s or status == -signal.SIGKILL):
        return f"takes more than {longest_s:g} s, make it dear"
    if status not in (0, 1) or "Traceback (most recent call last)" in err:
        last = err.strip().splitlines()[-1:] or ["nothing on standard error"]
        return f"ends with status {status}: {last[0]}"
    if not text:
        return "prints nothing" + (f": {err.strip().splitlines()[-1]}" if err.strip() else "")
    if str(folder) in text or str(ROOT) in text:
        return "prints a path of this machine"
    return ""


def _pictures(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
