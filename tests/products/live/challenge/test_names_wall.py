"""The wall of names by itself: what Python is about to do, handed to the hook as Python would."""

import ctypes
import os
import struct
import sys
from types import SimpleNamespace

import pytest

from beaver_ftc_live.challenge import confine

INSIDE, OWN = "/somewhere/package", "/somewhere/package/code.py"
DONE = {
    "open": ((OWN, "r", os.O_RDONLY), (INSIDE, "r", 0)),
    "os.listdir": (("/somewhere",), (INSIDE,)),
    "os.scandir": (("/somewhere",), (OWN,)),
    "os.chdir": ((INSIDE,),),
    "import": (("math", None), ("beaver_ftc.diagnosis", None), ("scipy.linalg", None)),
    "compile": ((None, "code.py"),),
}
TELLS = [
    ("open", ("/somewhere", None, 0), "opens /somewhere"),
    ("open", ("/elsewhere/code.py", "r", 0), "opens /elsewhere/code.py"),
    ("open", (b"/somewhere/packages", "r", 0), "opens /somewhere/packages"),
    ("open", (5, "r", 0), "opens the grader's own pipes"),
    *(
        ("open", (OWN, None, flag), f"writes {OWN}")
        for flag in (os.O_WRONLY, os.O_RDWR, os.O_CREAT, os.O_TRUNC, os.O_APPEND)
    ),
    ("os.listdir", ("/elsewhere",), "lists /elsewhere"),
    ("os.scandir", (4,), "lists the grader's own pipes"),
    ("os.chdir", ("/",), "goes to /"),
    *(
        ("import", (name, None), f"imports {name}")
        for name in (
            "jsbsim", "jsbsim.core", "numba", "beaver_ftc.plant.trim", "beaver_ftc.loop",
            "beaver_ftc.results.log", "beaver_ftc.studies", "beaver_ftc.cli.main",
        )
    ),
    *(
        (event, (), f"{what} ({event})")
        for what, events in {
            "opens a network connection": ("socket.__new__", "socket.connect"),
            "starts a process": (
                "subprocess.Popen", "os.system", "os.exec", "os.spawn", "os.posix_spawn", "os.startfile",
                "os.fork", "os.forkpty", "pty.spawn", "_winapi.CreateProcess",
            ),
            "starts a thread": ("_thread.start_new_thread",),
            "sends a signal": ("os.kill", "os.killpg", "signal.pthread_kill"),
            "reaches around Python": ("ctypes.dlopen",),
            "searches the memory for other objects": ("gc.get_objects", "gc.get_referrers"),
            "opens a file": ("sqlite3.connect",),
            "maps memory": ("mmap.__new__",),
            "changes its limits": ("resource.setrlimit", "fcntl.fcntl", "sys.addaudithook"),
            "changes files": (
                "os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate",
                "os.chmod", "os.chown", "os.utime", "os.setxattr", "os.removexattr", "shutil.rmtree",
            ),
        }.items()
        for event in events
    ),
]  # fmt: skip


@pytest.mark.parametrize(("event", "arguments", "what"), TELLS)
def test_what_is_refused_is_told_once(event, arguments, what):
    told = []
    hook = confine._hook(told.append, (INSIDE,))
    for _ in range(2):
        with pytest.raises(PermissionError) as refused:
            hook(event, arguments)
        assert str(refused.value) == what
    assert told == [what]


def test_what_computing_takes_is_let_through():
    told = []
    hook = confine._hook(told.append, (INSIDE,))
    for event, every in DONE.items():
        for arguments in every:
            hook(event, arguments)
    assert told == []


def answered(code, machine, number):
    """What a filter of the kernel answers to a call: an interpreter of its four instructions."""
    at = value = 0
    while True:
        instruction, yes, no, operand = code[at]
        at += 1
        if instruction == 0x20:  # load a word of what is asked: the number at 0, the machine at 4
            value = {0: number, 4: machine}[operand]
        elif instruction in (0x15, 0x35):
            at += yes if (value == operand if instruction == 0x15 else value >= operand) else no
        else:
            assert instruction == 0x06
            return operand


ALLOWED, FORBIDDEN, KILLED = 0x7FFF0000, 0x00050001, 0x80000000
# From the kernel's tables: read, write, openat, newfstatat, mmap, exit_group, rseq, faccessat2; and socket,
# connect, kill, execve, clone, unlinkat, ptrace, prctl, setpriority, prlimit64.
MACHINES = {
    "x86_64": (0xC000003E, (0, 1, 257, 262, 9, 231, 334, 439), (41, 42, 62, 59, 56, 263, 101, 157, 141, 302)),
    "aarch64": (
        0xC00000B7,
        (63, 64, 56, 79, 222, 94, 293, 439),
        (198, 203, 129, 221, 220, 35, 117, 167, 140, 261),
    ),
}


@pytest.mark.skipif(sys.platform != "linux", reason="seccomp is Linux's")
@pytest.mark.parametrize("machine", MACHINES)
def test_the_kernel_lets_through_the_calls_of_computing_alone(monkeypatch, machine):
    codes, asked = [], []

    def prctl(option, what, given, *rest):
        asked.append((option, what, *rest))
        if option == 22:
            length, where = struct.unpack("HxxxxxxP", given)
            text = ctypes.string_at(where, 8 * length)
            codes.append([struct.unpack_from("HBBI", text, 8 * row) for row in range(length)])
        return 0

    monkeypatch.setattr(confine, "_linux", lambda: SimpleNamespace(prctl=prctl))
    monkeypatch.setattr(confine.platform, "machine", lambda: machine)
    assert confine._restrict_calls()
    assert asked == [(38, 1, 0, 0), (22, 2, 0, 0)]
    (code,), (own, allowed, forbidden) = codes, MACHINES[machine]
    assert {answered(code, own, number) for number in allowed} == {ALLOWED}
    assert {answered(code, own, number) for number in forbidden} == {FORBIDDEN}
    assert answered(code, own, 0x40000000 + allowed[0]) == FORBIDDEN  # the same by another way of calling
    assert {answered(code, other, number) for other in (0, own + 1) for number in allowed} == {KILLED}
