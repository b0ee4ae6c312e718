"""The wall of names by itself: what Python is about to do, handed to the hook as Python would."""

import ctypes
import os
import struct
import sys
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
    allowed = ["/python3.11/json", "/python3.11/os.py", "/teacher/mine", "beside"]
    confine._restrict_files(allowed)
    read = confine._READ_FILE | confine._READ_DIR
    assert given == [*((path, read) for path in allowed), ("/python3.11", confine._READ_DIR)]


def test_a_submission_has_a_gigabyte_a_minute_and_no_file_to_write(monkeypatch):
    resource, given = pytest.importorskip("resource"), {}
    monkeypatch.setattr(resource, "setrlimit", lambda what, most: given.update({what: most}))
    assert confine._limit()
    limits = {"AS": 2**30, "CPU": 60, "FSIZE": 0, "NPROC": 0, "CORE": 0, "NOFILE": 64}
    assert given == {getattr(resource, f"RLIMIT_{name}"): (most, most) for name, most in limits.items()}


# Of each version of Landlock: rights over files in bits, TCP to be ruled, scopes of signals and sockets, and
# how many bytes of these the kernel takes (its documentation; a right more came in 2, 3 and 5).
LANDLOCK = {
    1: (13, 0, 0, 8),
    2: (14, 0, 0, 8),
    3: (15, 0, 0, 8),
    4: (15, 3, 0, 16),
    5: (16, 3, 0, 16),
    6: (16, 3, 3, 24),
}


@pytest.mark.parametrize("version", [0, *LANDLOCK])
@pytest.mark.parametrize("refuses", [None, "create", "add", "restrict"])
def test_landlock_rules_what_its_version_knows(monkeypatch, tmp_path, version, refuses):
    """A folder is read and listed, a file only read, and nothing counts until the thread has restricted
    itself."""
    file = tmp_path / "code.py"
    file.touch()
    called, closed = [], []

    def syscall(number, *of):
        called.append((number, *of))
        if number == 444 and of[0] is None:
            return version
        said = {"create": 444, "add": 445, "restrict": 446}.get(refuses)
        return -1 if number == said else 77 if number == 444 else 0

    def prctl(*of):
        called.append(("prctl", *of))

    monkeypatch.setattr(confine, "_linux", lambda: SimpleNamespace(syscall=syscall, prctl=prctl))
    monkeypatch.setattr(confine.os, "open", lambda path, flags: str(path))
    monkeypatch.setattr(confine.os, "close", closed.append)
    monkeypatch.setattr(confine.struct, "pack", lambda form, *of: (form, *of))
    assert confine._restrict_files([str(tmp_path), str(file)]) == (version > 0 and refuses is None)
    monkeypatch.undo()
    asked, *rest = called
    assert asked == (444, None, 0, 1)
    if not version:
        assert (rest, closed) == ([], [])
        return
    bits, net, scoped, size = LANDLOCK[version]
    create, *rules = rest
    assert create == (444, ("QQQ", 2**bits - 1, net, scoped), size, 0)
    number = -1 if refuses == "create" else 77
    added = [
        (445, number, 1, ("=Qi", right, str(path)), 0)
        for path, right in ((tmp_path, 4 | 8), (file, 4))
    ]  # fmt: skip
    tried = {"create": 0, "add": 1}.get(refuses, 2)
    after = [("prctl", 38, 1, 0, 0, 0)]
    if refuses in (None, "restrict"):
        after.append((446, 77, 0))
    assert rules == [*added[:tried], *after]
    assert closed == [*(str(path) for path in (tmp_path, file)[:tried]), number]


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
    let_through = [number for number in range(500) if answered(code, own, number) == ALLOWED]
    rows = [row.split() for row in confine._CALLS.split(",")]
    column = 1 if machine == "x86_64" else 2
    assert let_through == sorted(int(row[column]) for row in rows if row[column] != "0" or row[0] == "read")


@pytest.mark.parametrize(("what", "call", "of"), [
    ("hide", "prctl", (4, 0, 0, 0, 0)), ("_leave_namespaces", "unshare", (0x58000000,)),
])  # fmt: skip
def test_the_system_is_asked_once_and_its_refusal_is_no_wall(monkeypatch, what, call, of):
    """Not to be read by others (dumpable: 0); namespaces of its own for users, network and shared memory."""
    for answer in (0, -1):
        asked = []
        system = SimpleNamespace(
            **{call: lambda *given, asked=asked, answer=answer: asked.append(given) or answer}
        )
        monkeypatch.setattr(confine, "_linux", lambda system=system: system)
        done = getattr(confine, what)()
        assert asked == [of]
        assert done in (None, answer == 0)
