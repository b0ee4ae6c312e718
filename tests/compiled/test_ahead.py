"""Kernels that a flight will call are compiled together, by two processes into one folder."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from beaver_ftc import compiled
from beaver_ftc.compiled import ahead
from beaver_ftc.compiled.ahead import Wanted
from beaver_ftc.compiled.sized_types import array_type

KINDS = (array_type(np.dtype(float), 1),)
BODIES = ("return 2.0 * x[0]", "return x[0] - 1.0", "return x[0] * x[0]", "return x[0] + x[1]")


def kernels(folder):
    """Four kernels that are kept in this folder, and their plain forms."""
    found = []
    for i, body in enumerate(BODIES):
        space = {"__name__": __name__}
        exec(f"def kernel_{i}(x):\n    {body}\n", space)
        found.append(compiled.compile_into(folder, space[f"kernel_{i}"]))
    return found


def wanted_of(folder):
    return [Wanted.of(kernel, KINDS) for kernel in kernels(folder)]


def agree(folder):
    x = np.array([3.0, 0.25])
    return all(kernel(x) == kernel.py_func(x) for kernel in kernels(folder))


def kept(folder):
    return sorted(path.name.partition("-")[0] for path in folder.glob("kernel_*"))


ALL = [f"kernel_{i}" for i in range(len(BODIES))]


@pytest.fixture(params=["two processes", "a second that fails", "a second that is refused", "one process"])
def how(request, monkeypatch):
    """How the kernels are compiled."""

    def refused():
        raise OSError("no more processes")

    monkeypatch.setattr(ahead, "can_fork", lambda: request.param != "one process")
    if request.param == "a second that is refused":
        monkeypatch.setattr(os, "fork", refused)
    if request.param == "a second that fails":
        monkeypatch.setattr(ahead, "_help", lambda *_: os._exit(3))
    return request.param


def test_all_are_compiled_and_kept_however_the_second_process_fares(tmp_path, monkeypatch, how):
    fork, second = os.fork, []
    monkeypatch.setattr(os, "fork", lambda: second.append(fork()) or second[-1])
    assert ahead.compile_missing(wanted_of(tmp_path)) == len(BODIES)
    assert kept(tmp_path) == ALL
    assert ahead.compile_missing(wanted_of(tmp_path)) == 0
    assert agree(tmp_path)
    for each in second:
        with pytest.raises(ChildProcessError):  # no zombie
            os.waitpid(each, os.WNOHANG)


def test_the_first_missing_kernel_compiles_all_that_are_expected(tmp_path, monkeypatch):
    monkeypatch.setattr(ahead, "can_fork", lambda: False)
    wanted = wanted_of(tmp_path)
    ahead.expect(lambda: wanted[1:])
    assert wanted[0].kernel(np.array([3.0])) == 6.0
    assert kept(tmp_path) == ALL


INTERRUPTED = """
import os, signal, sys, time
from beaver_ftc.compiled import ahead
class Slow:
    folder, size = "somewhere", 1
    def is_kept(self, kinds): return False
    def compile_unless_taken(self, kinds):
        os.write(1, f"{os.getpid()}\\n".encode())
        time.sleep(60)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
ahead.can_fork = lambda: True
ahead.os.dup2 = lambda *_: None
ahead.compile_missing([ahead.Wanted(Slow(), ()), ahead.Wanted(Slow(), ())])
"""


def test_an_interrupt_of_the_first_process_ends_both():
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    numbers = {int(process.stdout.readline()) for _ in range(2)}
    assert process.pid in numbers
    process.send_signal(signal.SIGINT)
    process.wait(10.0)
    (second,) = numbers - {process.pid}
    with pytest.raises(ProcessLookupError):
        os.kill(second, 0)
