"""The grader's end of the line: a submitted detector or law in a process of its own, flown as a plug-in.

Nothing that comes from there is trusted: messages have a length that is known before, hold plain numbers,
and bear the number of the frame they answer. No answer in time ends the process.
"""

import contextlib
import os
import pickle
import re
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.control import Reference
from beaver_ftc.design import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.documents import SimulationFailed
from beaver_ftc.studies.engine import ONE_THREAD_EACH
from beaver_ftc_live.challenge import confine, pilot

START_S, LOAD_S, FRAME_S, ALL_S = 60.0, 10.0, 1.0, 60.0
END_S = 3.0  # from its last word to its end
MOST_ASKED = 1000  # times in a frame
MOST_ROWS = 64  # of x that the design model is asked for at once
MOST_TEXT = 200
POLL_S = 0.02
PACE_S = 0.002  # at least from an answer to the next question: a fault's first frame takes longest to fly
_READY = re.compile(r"(detector|law|fault-tolerant law):([A-Za-z_]\w{0,60})", re.ASCII)


class Mistake(SimulationFailed):
    """What a submission does wrong in a flight: that flight counts nothing."""


class Barred(Mistake):
    """What ends a submission: an act that is refused, a time that is over, a process that has gone."""


@dataclass
class Allowance:
    """Seconds a submission may still take, over all its flights; without those it waits for a processor."""

    left_s: float = ALL_S


def plain(text: str) -> str:
    """Third-party text, fit for a terminal, a page and a table: plain letters of ASCII, not many."""
    shown = "".join(letter if " " <= letter <= "~" and letter not in "<>&|`[]" else "?" for letter in text)
    return shown if len(shown) <= MOST_TEXT else shown[: MOST_TEXT - 3] + "..."


class _Accounts:
    """What Linux says of a process and of the thread that asks it; of others nothing. A busy machine is
    nobody's fault."""

    def __init__(self, pid: int | None) -> None:
        self._files: list[int] = []
        wanted = ("thread-self/schedstat", f"{pid}/schedstat", f"{pid}/stat")
        with contextlib.suppress(OSError):
            for path in () if pid is None or sys.platform != "linux" else wanted:
                self._files.append(os.open(f"/proc/{path}", os.O_RDONLY | os.O_CLOEXEC))

    def _numbers(self, file: int) -> tuple[float, float]:
        """Seconds on a processor, and waiting for one before that; 0 where nobody counts them."""
        try:
            computed, waited = os.pread(self._files[file], 80, 0).split()[:2]
        except (OSError, IndexError, ValueError):  # it has gone
            return 0.0, 0.0
        return 1e-9 * int(computed), 1e-9 * int(waited)

    def waited_s(self) -> float:
        """How long both have waited for a processor that others had, but for a wait that has not ended."""
        return self._numbers(0)[1] + self._numbers(1)[1]

    def computed_s(self) -> float:
        """How long the process has had a processor."""
        return self._numbers(1)[0]

    def wants_a_processor(self) -> bool:
        """Whether the process has one or waits for one, or for the disk: it does not sleep."""
        try:
            return os.pread(self._files[2], 400, 0).rpartition(b")")[2].split()[0] in (b"R", b"D")
        except (OSError, IndexError):
            return False

    def close(self) -> None:
        """Ask no more."""
        while self._files:
            os.close(self._files.pop())


class SubmittedCode:
    """A class of a submission, in a process that is begun by `reset`; a context manager that ends it.

    source, name: the submission's text and what it is called. kind, class_name, walls: known once it has
    started.
    """

    fault_tolerant = False

    def __init__(self, source: str, name: str, allowance: Allowance) -> None:
        self._told = {"source": source, "name": name}
        self._allowance = allowance
        self._process: subprocess.Popen[bytes] | None = None
        self._deadline, self._late, self._t_s, self._frame = float("inf"), False, 0.0, 0
        self._last_chance, self._accounts, self._answered_s = False, _Accounts(None), 0.0
        self._before = (0.0, 0.0, 0.0)  # limit, waited and computed, s, as the wait for an answer began
        self.kind, self.class_name, self.walls = "", "", ""
        self._model: Any = None
        self._sizes = (0, 0)
        self.surfaces: tuple[str, ...] = ()

    def __enter__(self) -> "SubmittedCode":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def look(self) -> "SubmittedCode":
        """Start it, and find out which class there is and of which kind."""
        self._start(None)
        return self

    def reset(self, context: Context) -> None:
        """Start it with what a plug-in is given, but for options; the design model is asked on this line."""
        self._model, self.surfaces = context.model, context.surfaces
        self._sizes = context.trim_y.size, len(context.surfaces)
        self._start(replace(context, model=None, options={}))  # type: ignore[arg-type]
        self._answer(pilot.BEGUN, 0, LOAD_S)

    def _start(self, context: Context | None) -> None:
        self.end()
        self._frame, self._late = 0, False
        confine.hide()
        # its own settings alone in the environment, nothing but the package's folder among the arguments
        root = str(Path(pilot.__file__).resolve().parents[2])
        self._folder = tempfile.TemporaryDirectory(prefix="challenge-")
        needed = {
            key: os.environ[key] for key in ("SYSTEMROOT",) if key in os.environ
        }  # Windows starts nothing without
        self._process = subprocess.Popen(
            [sys.executable, "-s", "-P", "-B", pilot.__file__, root],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0,
            cwd=self._folder.name, env=ONE_THREAD_EACH | {"PYTHONHASHSEED": "0"} | needed,
            close_fds=True, start_new_session=True,
        )  # fmt: skip
        self._accounts = _Accounts(self._process.pid)
        threading.Thread(target=self._watch, args=(self._process,), daemon=True).start()
        self._send(pickle.dumps(self._told | {"context": context}))
        self.walls = plain(self._answer(pilot.WALLS, None, START_S, charged=False).decode("ascii", "replace"))
        said = _READY.fullmatch(self._answer(pilot.READY, None, LOAD_S).decode("ascii", "replace"))
        if said is None:
            raise Barred("writes on the line to the grader")
        self.kind, self.class_name = said.groups()
        self.fault_tolerant = self.kind == pilot.TOLERANT

    def _watch(self, process: "subprocess.Popen[bytes]") -> None:
        """End a process whose answer is late."""
        while process.poll() is None:
            if self._is_late(process):
                self._late = True
                process.kill()
                return
            time.sleep(POLL_S)

    def _is_late(self, process: "subprocess.Popen[bytes]") -> bool:
        """Whether it has had its time, and has not answered. A wait for a processor is counted when it ends:
        while it goes on, what has been computed decides."""
        over_s = time.monotonic() - self._deadline
        if over_s <= 0.0 or (os.name == "posix" and select.select([process.stdout], [], [], 0)[0]):  # type: ignore[type-var]
            return False
        limit_s, waited_s, computed_s = self._before
        if self._accounts.wants_a_processor():
            return self._accounts.computed_s() - computed_s > limit_s
        return over_s > self._accounts.waited_s() - waited_s

    def asked(self, kind: bytes, measured: Measured, *besides: Any) -> np.ndarray:
        """Show it a frame; its answer's numbers, finite or not."""
        self._t_s, self._frame = measured.t_s, self._frame + 1
        time.sleep(max(self._answered_s + PACE_S - time.monotonic(), 0.0))
        self._send(pickle.dumps((measured, *besides)))
        answer = np.frombuffer(self._answer(kind, self._length(kind), FRAME_S))
        self._answered_s = time.monotonic()
        return answer

    def _length(self, kind: bytes) -> int:
        return 8 * (self._sizes[1] + (7 if kind == pilot.VERDICT else 0))

    def _answer(self, kind: bytes, length: int | None, within_s: float, charged: bool = True) -> bytes:
        """The message that must come now, after questions to the design model; length: None is any text's."""
        began, asked = time.monotonic(), 0
        self._last_chance = charged and self._allowance.left_s < within_s
        limit_s = self._allowance.left_s if self._last_chance else within_s
        self._before = limit_s, self._accounts.waited_s(), self._accounts.computed_s()
        self._deadline = began + limit_s
        try:
            while True:
                said, frame, size = pilot.HEAD.unpack(self._read(pilot.HEAD.size))
                if said == pilot.ASKS and size <= 8 * (3 * MOST_ROWS + self._sizes[0]) + 4:
                    asked += 1
                    self._evaluate(self._read(size), asked)
                elif said in (pilot.ERROR, pilot.REFUSED) and size <= 1000:
                    self._refuse(said, self._read(size))
                elif (
                    said != kind
                    or frame != self._frame
                    or (size > 1000 if length is None else size != length)
                ):
                    raise Barred("writes on the line to the grader")
                else:
                    return self._read(size)
        finally:
            self._deadline = float("inf")
            if charged:
                waited_s = self._accounts.waited_s() - self._before[1]
                self._allowance.left_s -= max(time.monotonic() - began - waited_s, 0.0)

    def _refuse(self, said: bytes, text: bytes) -> None:
        what = plain(text.decode(errors="replace"))
        if said == pilot.REFUSED:
            raise Barred(f"tried what is not allowed: {what}{self._when()}")
        limit = f" (the limit is {confine.MEMORY_BYTES >> 20} MiB)" if what.startswith("MemoryError") else ""
        raise Mistake(f"{what}{limit}{self._when()}")

    def _when(self) -> str:
        return f", at {self._t_s:g} s" if self._frame else ""

    def _evaluate(self, asked: bytes, times: int) -> None:
        """What the design model says of x and y: f, then G. That time is not charged to the submission."""
        if times > MOST_ASKED:
            raise Barred(f"asks the design model more than {MOST_ASKED} times in a frame")
        deadline, began = self._deadline, time.monotonic()
        self._deadline = float("inf")
        y_size, x_bytes = self._sizes[0], int.from_bytes(asked[:4], "little") * 8
        numbers = np.frombuffer(asked[4:], count=(len(asked) - 4) // 8)
        if len(asked) != 4 + x_bytes + 8 * y_size or not x_bytes or x_bytes % 24 or self._model is None:
            raise Mistake(f"asks the design model for shapes that are none: x (3,) or (n, 3), y ({y_size},)")
        x, y = numbers[: x_bytes // 8].reshape(-1, 3), numbers[x_bytes // 8 :]
        self._send(np.concatenate((self._model.f(x, y).ravel(), self._model.G(y).ravel())).tobytes())
        self._deadline = deadline + time.monotonic() - began

    def _send(self, content: bytes) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            content = len(content).to_bytes(4, "little") + content
            while content:
                content = content[self._process.stdin.write(content) or 0 :]
        except OSError:  # it has gone: what it said before is read first
            pass

    def _read(self, size: int) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        found = b""
        while len(found) < size:
            part = self._process.stdout.read(size - len(found))
            if not part:
                self._gone(self._process)
            found += part
        return found

    def _gone(self, process: "subprocess.Popen[bytes]") -> None:
        """Say why nothing more comes."""
        try:
            status = process.wait(END_S)
        except subprocess.TimeoutExpired:
            raise Barred(f"closes the line to the grader{self._when()}") from None
        if self._late:
            over = f"the {ALL_S:g} s for all its flights are over"
            raise Barred(f"{over if self._last_chance else 'no answer in time'}{self._when()}")
        if status < 0:
            raise Barred(f"its process was ended by {signal.Signals(-status).name}{self._when()}")
        raise Barred(f"its process ended, status {status}{self._when()}")

    def end(self) -> None:
        """End the process, whatever it is doing, with all that it has started."""
        process, self._process = self._process, None
        if process is None:
            return
        if hasattr(os, "killpg") and process.poll() is None:  # else its number may be another's by now
            with contextlib.suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.wait()
        self._accounts.close()
        for stream in (process.stdin, process.stdout):
            if stream:
                stream.close()
        self._folder.cleanup()


def _finite(numbers: np.ndarray, what: str) -> np.ndarray:
    if not np.isfinite(numbers).all():
        raise Mistake(f"{what} is not finite: {', '.join(f'{n:g}' for n in numbers)}")
    return numbers


class SubmittedDetector(SubmittedCode):
    """A submitted detector as the loop calls one."""

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Its verdict on the present frame."""
        said = self.asked(pilot.VERDICT, measured, command)
        named = (3, len(self.surfaces) + 1)  # the last place of an axis, and of a name
        if not all(number in range(last + 1) for number, last in zip(said[1:3], named, strict=True)):
            raise Barred("writes on the line to the grader")
        if said[3]:
            _finite(said[4:5], "its estimate")
        if said[6]:
            _finite(said[7:], "its effectiveness")
        return pilot.verdict_of(said, self.surfaces)


class SubmittedLaw(SubmittedCode):
    """A submitted law as the loop calls one."""

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Its command at the present frame."""
        known = verdict._replace(type=None, candidates=())
        return _finite(self.asked(pilot.COMMAND, measured, reference, known), "its command")
