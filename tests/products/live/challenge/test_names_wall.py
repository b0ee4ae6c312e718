"""The wall of names by itself: what Python is about to do, handed to the hook as Python would."""

import os
import re
from pathlib import Path

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


@pytest.mark.parametrize(
    ("place", "header"),
    [(0, "/usr/include/x86_64-linux-gnu/asm/unistd_64.h"), (1, "/usr/include/asm-generic/unistd.h")],
)
def test_calls_have_the_numbers_of_the_system(place, header):
    if not Path(header).exists():
        pytest.skip(f"{header} is not there")
    defined = dict(re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", Path(header).read_text()))
    defined.setdefault("newfstatat", defined.get("fstatat"))
    numbers = {name: numbers[place] for name, *numbers in map(str.split, confine._CALLS.split(","))}
    assert numbers == {name: defined.get(name, "0") for name in numbers}
