"""Print what runs in one frame of a flight: kernels in the order of their calls, and what each of them wrote.

python -m tools.frame SCENARIO [--after-alarm FRAMES]

Kernels fly as plain Python, some 10 ms a frame. A field that is written with the value it had is not seen.
"""

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np

import beaver_ftc
from beaver_ftc import Simulation

ROOT = Path(beaver_ftc.__file__).parent
PARTS = (
    "control", "design", "diagnosis", "loop/accounts", "loop/frame", "loop/guarantee", "loop/inconclusive",
    "loop/log_row", "loop/stepping",
)  # fmt: skip
KERNELS = tuple(str(ROOT / part) for part in PARTS)
PLAIN = "NUMBA_DISABLE_JIT"
MOST_FIELDS = 6  # of a kernel, printed


class Call(NamedTuple):
    """A kernel that ran: how deep below the frame, its name, and the fields of the record that it wrote."""

    depth: int
    name: str
    wrote: tuple[str, ...]


def leaves(dtype: np.dtype, start: int = 0, path: str = "") -> Iterator[tuple[int, str]]:
    """Where each field of a record begins, byte, and its path; elements of an array of records are one."""
    if dtype.subdtype:
        base, shape = dtype.subdtype
        for k in range(int(np.prod(shape)) if base.names else 1):
            yield from leaves(base, start + k * base.itemsize, path)
    elif dtype.names:
        for name in dtype.names:
            of, offset = dtype.fields[name][:2]
            yield from leaves(of, start + offset, f"{path}.{name}" if path else name)
    else:
        yield start, path


class Trace:
    """What the kernels of one frame do to the record of a flight."""

    def __init__(self, record: np.ndarray) -> None:
        self.bytes = record.view(np.uint8).reshape(-1)
        starts, self.paths = zip(*leaves(record.dtype), strict=True)
        self.starts = np.array(starts)
        self.calls: list[Call] = []
        self.open: list[tuple[int, np.ndarray, set[str]]] = []

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if not code.co_filename.startswith(KERNELS):
            return
        if event == "call":
            self.open.append((len(self.calls), self.bytes.copy(), set()))
            self.calls.append(Call(len(self.open), f"{Path(code.co_filename).stem}.{code.co_name}", ()))
        elif event == "return" and self.open:
            at, before, by_others = self.open.pop()
            changed = np.unique(
                np.searchsorted(self.starts, np.flatnonzero(self.bytes != before), "right") - 1
            )
            wrote = {self.paths[k] for k in changed}
            self.calls[at] = self.calls[at]._replace(wrote=tuple(sorted(wrote - by_others)))
            if self.open:
                self.open[-1][2].update(wrote)


def trace(scenario: str, after_alarm: int) -> tuple[float, list[Call]]:
    """Time of the frame, s, and its calls; frames are counted from the alarm on."""
    flight = Simulation(scenario)
    record = flight._loop.frames  # that every kernel works on
    while not flight.verdict.detected:
        flight.step()
    for _ in range(after_alarm - 1):
        flight.step()
    seen = Trace(record)
    sys.setprofile(seen)
    try:
        flight.step()
    finally:
        sys.setprofile(None)
    return flight.t_s, seen.calls


def writers(calls: list[Call]) -> list[Call]:
    """Those that wrote, or called one that did."""
    found, needed = [], 0  # the depth of the caller of the call after
    for call in reversed(calls):
        if call.wrote or call.depth == needed:
            found.append(call)
            needed = call.depth - 1
    return found[::-1]


def lines(calls: list[Call]) -> Iterator[str]:
    """The calls as a list, repeated ones once."""
    for (at, name), same in groupby(calls, lambda call: (call.depth, call.name)):
        several = list(same)
        wrote = Counter(path for call in several for path in call.wrote)
        fields, more = ", ".join([*wrote][:MOST_FIELDS]), len(wrote) - MOST_FIELDS
        times = f" x {len(several)}" if len(several) > 1 else ""
        said = (f"  -> {fields}" if wrote else "") + (f" and {more} more" if more > 0 else "")
        yield f"{'  ' * at}{name}{times}{said}"


def main() -> None:
    """Fly, and print the frame."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenario")
    parser.add_argument("--after-alarm", type=int, default=1, metavar="FRAMES", help="frames after the alarm")
    given = parser.parse_args()
    if os.environ.get(PLAIN, "0") in ("", "0"):
        os.execve(
            sys.executable, [sys.executable, "-m", "tools.frame", *sys.argv[1:]], os.environ | {PLAIN: "1"}
        )
    at_s, calls = trace(given.scenario, given.after_alarm)
    print(f"{given.scenario}: {len(calls)} calls in the frame at {at_s:g} s")
    print(*lines(writers(calls)), sep="\n")


if __name__ == "__main__":
    main()
