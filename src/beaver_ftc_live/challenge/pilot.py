"""The submission's end of the line: `python pilot.py`, a process for one flight.

It is told a class's source and what a plug-in may know before a flight, puts up the walls, loads the class,
and answers each frame, of which it is given what a plug-in's `step` is. What it sends is a kind, the frame's
number and plain numbers (`line.py` reads them).
"""

import os
import pickle
import struct
import sys
from collections.abc import Callable
from inspect import isclass, signature
from math import nan
from types import ModuleType
from typing import Any

if __name__ == "__main__":
    del sys.path[0]  # this folder
    sys.path.insert(0, sys.argv.pop())

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc_live.challenge.confine import confine

HEAD = struct.Struct("<cII")  # kind, frame, length of what follows
WALLS, READY, BEGUN, VERDICT, COMMAND, ASKS, ERROR, REFUSED = (
    b"W", b"R", b"B", b"V", b"C", b"Q", b"E", b"N",
)  # fmt: skip
AXES = ("p", "q", "r")
KINDS = {3: "detector", 4: "law"}  # arguments of `step`, with self
TOLERANT = "fault-tolerant law"
MODULE = "submission"


class Line:
    """Messages in and out, over two pipes."""

    def __init__(self, inward: int, outward: int) -> None:
        self._inward, self._outward, self.frame = inward, outward, 0

    def take(self) -> bytes:
        """The next message; ends the process when there is none."""
        (length,) = struct.unpack("<I", self._read(4))
        return self._read(length)

    def _read(self, length: int) -> bytes:
        found = b""
        while len(found) < length:
            part = os.read(self._inward, length - len(found))
            if not part:
                os._exit(0)
            found += part
        return found

    def send(self, kind: bytes, content: bytes = b"") -> None:
        """Send a message about the present frame."""
        os.write(self._outward, HEAD.pack(kind, self.frame, len(content)) + content)


class AskedModel:
    """The design model, which the grader evaluates: f(x, y) and G(y), as `Context.model` has them."""

    def __init__(self, line: Line, surfaces: int) -> None:
        self._line, self._surfaces = line, surfaces

    def f(self, x: Any, y: Any) -> np.ndarray:
        """Angular acceleration (3,) rad/s2 at neutral surfaces; x (3,) rad/s, y. Of x (n, 3), (n, 3)."""
        return self._asked(x, y)[: np.size(x)].reshape(np.shape(x))

    def G(self, y: Any) -> np.ndarray:
        """Angular acceleration of each surface, (3, surfaces) rad/s2 per rad."""
        return self._asked(np.zeros(3), y)[3:].reshape(3, self._surfaces)

    def _asked(self, x: Any, y: Any) -> np.ndarray:
        x, y = np.asarray(x, float).ravel(), np.asarray(y, float).ravel()
        self._line.send(ASKS, struct.pack("<I", x.size) + x.tobytes() + y.tobytes())
        return np.frombuffer(self._line.take()).copy()


def class_of(source: str, name: str) -> tuple[type, str]:
    """The one class with reset and step that a source defines, and of which kind it is."""
    module = ModuleType(MODULE)
    sys.modules[MODULE] = module
    exec(compile(source, name, "exec"), module.__dict__)
    found = [each for each in vars(module).values() if isclass(each) and each.__module__ == MODULE]
    found = [each for each in found if all(callable(getattr(each, m, None)) for m in ("reset", "step"))]
    if len(found) != 1:
        named = ", ".join(each.__name__ for each in found) or "none"
        raise TypeError(f"classes with reset and step: {named}; allowed: one")
    step = signature(found[0].step)  # type: ignore[attr-defined]
    if len(step.parameters) not in KINDS:
        raise TypeError(f"step{step}, allowed: step(measured, command) or step(measured, reference, verdict)")
    kind = KINDS[len(step.parameters)]
    return found[0], TOLERANT if kind == "law" and getattr(found[0], "fault_tolerant", False) else kind


def verdict_numbers(verdict: Any, surfaces: tuple[str, ...]) -> np.ndarray:
    """detected, axis, isolated, whether there is an estimate and which, statistic, whether there are
    effectivenesses and which."""
    if not isinstance(verdict, Verdict):
        raise TypeError(f"step returned {type(verdict).__name__}, allowed: a Verdict")
    named = (None, *surfaces, "unanticipated")
    if verdict.axis not in (None, *AXES) or verdict.isolated not in named:
        raise ValueError(f"axis {verdict.axis!r:.40}, isolated {verdict.isolated!r:.40}, allowed: {named}")
    shares, n = verdict.effectiveness, len(surfaces)
    return np.array([
        bool(verdict.detected), (None, *AXES).index(verdict.axis), named.index(verdict.isolated),
        verdict.estimate is not None, 0.0 if verdict.estimate is None else float(verdict.estimate),
        float(verdict.statistic), shares is not None,
        *(_so_many(shares, n, "effectiveness") if shares is not None else [nan] * n),
    ])  # fmt: skip


def _so_many(values: Any, n: int, what: str) -> np.ndarray:
    array = np.asarray(values, float)
    if array.shape != (n,):
        raise ValueError(f"{what} has shape {array.shape}, allowed: ({n},)")
    return array


def verdict_of(said: np.ndarray, surfaces: tuple[str, ...]) -> Verdict:
    """A verdict from its numbers."""
    detected, axis, isolated, has_estimate, estimate, statistic, has_shares = said[:7].tolist()
    named = (None, *surfaces, "unanticipated")
    return Verdict(
        detected=bool(detected),
        axis=(None, *AXES)[int(axis)],
        isolated=named[int(isolated)],
        estimate=estimate if has_estimate else None,
        effectiveness=said[7:].copy() if has_shares else None,
        statistic=statistic,
    )


def fly(line: Line, told: dict[str, Any]) -> None:
    """Load the class, and answer frames until there are no more."""
    found, kind = class_of(told["source"], told["name"])
    line.send(READY, f"{kind}:{found.__name__}".encode())
    context = told["context"]
    if context is None:
        return
    plug_in: Any = found()
    plug_in.reset(context)
    line.send(BEGUN)
    surfaces = context.surfaces
    while True:
        given = pickle.loads(line.take())
        line.frame += 1
        answer = plug_in.step(*given)
        if kind == "detector":
            line.send(VERDICT, verdict_numbers(answer, surfaces).tobytes())
        else:
            line.send(COMMAND, _so_many(answer, len(surfaces), "the command").tobytes())


def _own_streams() -> Line:
    """The pipes under numbers of their own; what is printed goes nowhere."""
    line, nowhere = Line(os.dup(0), os.dup(1)), os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    return line


def main() -> None:
    """Whatever goes wrong is said in a line; then the process ends."""
    line = _own_streams()
    told = pickle.loads(line.take())  # the grader's own, as is all that comes
    if told["context"] is not None:
        object.__setattr__(told["context"], "model", AskedModel(line, len(told["context"].surfaces)))
    tell: Callable[[str], None] = lambda what: line.send(REFUSED, what.encode()[:500])  # noqa: E731
    line.send(WALLS, " ".join(confine(tell)).encode())
    try:
        fly(line, told)
    except BaseException as error:  # SystemExit, too
        said = " ".join(f"{type(error).__name__}: {error}".split())
        line.send(ERROR, said.encode(errors="replace")[:500])
    os._exit(0)


if __name__ == "__main__":
    main()
