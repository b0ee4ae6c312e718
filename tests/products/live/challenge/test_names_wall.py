"""The wall of names by itself: what Python is about to do, handed to the hook as Python would."""

import os
from functools import partial
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


@pytest.mark.parametrize("fails", ["_limit", "_leave_namespaces", "_restrict_files", "_restrict_calls", None])
def test_the_walls_that_stand_are_named_in_their_order(monkeypatch, fails):
    """One that cannot be put up, or says that it does not stand, is left out; that of names always stands."""
    walls = {
        "_limit": "limits", "_leave_namespaces": "namespaces", "_restrict_files": "files",
        "_restrict_calls": "calls",
    }  # fmt: skip
    hooks, given = [], []

    def put_up(name, *files):
        given.extend(files)
        if name == fails and name != "_restrict_files":
            raise OSError
        return name != fails

    for name in walls:
        monkeypatch.setattr(confine, name, partial(put_up, name))
    monkeypatch.setattr(confine.sys, "addaudithook", hooks.append)
    standing = confine.confine(given.append)
    assert standing == [wall for name, wall in walls.items() if name != fails] + ["names"]
    assert len(hooks) == 1
    assert given == [confine.readable()]
    with pytest.raises(PermissionError):
        hooks[0]("os.fork", ())
    assert given[1:] == ["starts a process (os.fork)"]


def test_a_submission_may_read_python_and_packages_but_those_that_are_hidden(monkeypatch, tmp_path):
    """By the beginning of a name, in any letters; a link by what it leads to; nothing that is not there."""
    hidden = confine.HIDDEN[0]
    names = {
        "site": ("numpy", f"{hidden}-1.0.dist-info", f"{hidden.upper()}.py", f"my_{hidden}.py"),
        "own": ("scipy",), "lib": ("json", "site-packages", "os.py"), "core": (),
    }  # fmt: skip
    for folder, entries in names.items():
        (tmp_path / folder).mkdir()
        for entry in entries:
            (tmp_path / folder / entry).touch()
    (tmp_path / "lib" / "linked").symlink_to(tmp_path / "own")
    places = {"purelib": "site", "platlib": "own", "stdlib": "lib", "data": "site"}
    paths = {kind: str(tmp_path / folder) for kind, folder in places.items()}
    monkeypatch.setattr(confine.sysconfig, "get_paths", lambda: paths)
    monkeypatch.setattr(confine, "LIBRARIES", (str(tmp_path / "none"),))
    monkeypatch.setattr(confine, "_sources", lambda: [str(tmp_path / "core")])
    shown = [f"site/my_{hidden}.py", "site/numpy", "own/scipy", "lib/json", "own", "lib/os.py", "core"]
    assert confine.readable() == [str((tmp_path / place).resolve()) for place in shown]


def test_of_the_folders_beside_only_pythons_own_are_listed(monkeypatch):
    """What is allowed is read; a folder that it lies in is listed where an import looks through it."""
    given = []
    system = SimpleNamespace(syscall=lambda *of: 6, prctl=lambda *of: 0)
    monkeypatch.setattr(confine, "_linux", lambda: system)
    monkeypatch.setattr(confine.os, "close", lambda rules: None)
    monkeypatch.setattr(
        confine, "_allow", lambda system, rules, path, right: given.append((path, right)) or True
    )
    allowed = ["/opt/python3.11/json", "/opt/python3.11/os.py", "/home/teacher/mine", "beside"]
    confine._restrict_files(allowed)
    read = confine._READ_FILE | confine._READ_DIR
    assert given == [*((path, read) for path in allowed), ("/opt/python3.11", confine._READ_DIR)]
