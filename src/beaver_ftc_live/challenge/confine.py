"""Walls around third-party code: what is put around this very process before the code is loaded.

    limits      memory, processor time, files written, processes       POSIX
    namespaces  network devices, an administrator's rights             Linux, where users may have them
    files       all files but Python's and the package's [Landlock]    Linux 5.13 or newer
    calls       system calls but the few that computing takes          Linux on x86-64 and ARM
    names       what Python is about to do, and what that is called    everywhere

The system keeps the first four up: nothing in this process takes them down. The last one stops only what goes
through Python. Standard library alone; the caller has one thread.
"""

import ctypes
import os
import platform
import struct
import sys
import sysconfig
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

MEMORY_BYTES, CPU_S, FILES = 1 << 30, 60, 64
HIDDEN = ("jsbsim",)  # packages that fly the truth: nobody's to read
NOT_IMPORTED = (
    *HIDDEN,
    "numba",
    *(f"beaver_ftc.{room}" for room in ("plant", "loop", "results", "studies", "cli")),
)
LIBRARIES = ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/etc/ld.so.cache", "/usr/share/zoneinfo")

# What computing takes: name, number on x86-64, number on ARM (asm-generic); 0 where there is none such.
_CALLS = """
read 0 63, write 1 64, close 3 57, stat 4 0, fstat 5 80, lstat 6 0, poll 7 0, lseek 8 62, mmap 9 222,
mprotect 10 226, munmap 11 215, brk 12 214, rt_sigaction 13 134, rt_sigprocmask 14 135, rt_sigreturn 15
139, ioctl 16 29, pread64 17 67, readv 19 65, access 21 0, sched_yield 24 124, mremap 25 216, madvise 28
233, dup 32 23, nanosleep 35 101, getpid 39 172, exit 60 93, uname 63 160, fcntl 72 25, getcwd 79 17,
readlink 89 0, gettimeofday 96 169, getrusage 98 165, sysinfo 99 179, times 100 153, getuid 102 174,
getgid 104 176, geteuid 107 175, getegid 108 177, getppid 110 173, sigaltstack 131 132, gettid 186 178,
time 201 0, futex 202 98, sched_getaffinity 204 123, getdents64 217 61, restart_syscall 219 128,
clock_gettime 228 113, clock_getres 229 114, clock_nanosleep 230 115, exit_group 231 94, open 2 0, openat
257 56, newfstatat 262 79, readlinkat 267 78, faccessat 269 48, pselect6 270 72, ppoll 271 73,
set_robust_list 273 99, getrandom 318 278, membarrier 324 283, statx 332 291, rseq 334 293, faccessat2
439 439
"""
_OF_CLOCKS = {"clock_gettime", "clock_getres", "clock_nanosleep"}
_CLOCKS = 16  # of the system; beyond it begin the clocks of what other processes have computed
_MACHINES = {
    "x86_64": (0xC000003E, 1),
    "aarch64": (0xC00000B7, 2),
}  # as the kernel's audit calls them; column

# prctl(2), seccomp(2), landlock(7), and the instructions of a filter
_NO_NEW_PRIVS, _SET_SECCOMP, _SET_DUMPABLE, _FILTER = 38, 22, 4, 2
_KILL, _EPERM, _ALLOW, _X32 = 0x80000000, 0x00050001, 0x7FFF0000, 0x40000000
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF, _BENEATH = 444, 445, 446, 1
_READ_FILE, _READ_DIR = 4, 8
_RIGHTS = {1: 13, 2: 14, 3: 15, 4: 15}  # of files, in bits, by version; newer ones 16
_NEW_USER_NET_IPC = 0x10000000 | 0x40000000 | 0x08000000


def readable() -> list[str]:
    """Files and folders that third-party code may read: Python, its packages but the hidden, this one."""
    paths = sysconfig.get_paths()
    packages = dict.fromkeys(paths[kind] for kind in ("purelib", "platlib"))
    entries = [os.path.join(folder, name) for folder in packages for name in _names_in(folder)]
    shown = [entry for entry in entries if not os.path.basename(entry).lower().startswith(HIDDEN)]
    standard = [os.path.join(paths["stdlib"], name) for name in _names_in(paths["stdlib"])]
    shown += [entry for entry in standard if os.path.basename(entry) != "site-packages"]
    return [os.path.realpath(path) for path in (*shown, *LIBRARIES, *_sources()) if os.path.exists(path)]


def _sources() -> list[str]:
    """The folders of the core and of this package."""
    here = Path(__file__).resolve().parents[1]
    return [str(here.with_name("beaver_ftc")), str(here)]


def _names_in(folder: str) -> list[str]:
    return sorted(os.listdir(folder)) if os.path.isdir(folder) else []


def confine(tell: Callable[[str], None]) -> list[str]:
    """Put up what there is of the walls; returns their names. tell: is told the first act that is refused."""
    allowed = readable()
    walls = {
        "limits": _limit,
        "namespaces": _leave_namespaces,
        "files": lambda: _restrict_files(allowed),
        "calls": _restrict_calls,
    }
    standing = [name for name, put_up in walls.items() if _stands(put_up)]
    sys.addaudithook(_hook(tell, tuple(allowed)))
    return [*standing, "names"]


def hide() -> None:
    """Keep other processes of this user from reading the memory of this one, where the system can."""
    _stands(lambda: _linux().prctl(_SET_DUMPABLE, 0, 0, 0, 0) == 0)


def _stands(put_up: Callable[[], bool]) -> bool:
    try:
        return put_up()
    except (OSError, AttributeError, ImportError, ValueError, KeyError):
        return False


def _linux() -> Any:
    if sys.platform != "linux":
        raise OSError
    return ctypes.CDLL(None, use_errno=True)


def _limit() -> bool:
    import resource  # POSIX alone

    limits = {"AS": MEMORY_BYTES, "CPU": CPU_S, "FSIZE": 0, "NPROC": 0, "CORE": 0, "NOFILE": FILES}
    for name, most in limits.items():
        resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (most, most))
    return True


def _leave_namespaces() -> bool:
    """No network device, no shared memory of others, no rights of an administrator's."""
    return _linux().unshare(_NEW_USER_NET_IPC) == 0


def _restrict_files(allowed: Iterable[str]) -> bool:
    """Landlock: files that are read, and nothing else; no TCP; no signal to anybody outside."""
    system = _linux()
    version = system.syscall(_CREATE_RULESET, None, 0, 1)
    if version < 1:
        return False
    rights = (1 << _RIGHTS.get(version, 16)) - 1
    wanted = struct.pack("QQQ", rights, 3 if version >= 4 else 0, 3 if version >= 6 else 0)
    size = 24 if version >= 6 else 16 if version >= 4 else 8
    rules = system.syscall(_CREATE_RULESET, wanted, size, 0)
    listed = dict.fromkeys(os.path.realpath(os.path.dirname(path)) for path in allowed if os.path.isabs(path))
    names = [(path, _READ_FILE | _READ_DIR) for path in allowed]
    names += [(folder, _READ_DIR) for folder in listed if "python" in folder]  # what an import looks through
    done = rules >= 0 and all(_allow(system, rules, path, right) for path, right in names)
    system.prctl(_NO_NEW_PRIVS, 1, 0, 0, 0)
    done = done and system.syscall(_RESTRICT_SELF, rules, 0) == 0
    os.close(rules)
    return done


def _allow(system: Any, rules: int, path: str, right: int) -> bool:
    there = os.open(path, os.O_PATH | os.O_CLOEXEC)
    right = right if os.path.isdir(path) else right & _READ_FILE
    added = system.syscall(_ADD_RULE, rules, _BENEATH, struct.pack("=Qi", right, there), 0) == 0
    os.close(there)
    return added


def _restrict_calls() -> bool:
    """Seccomp: what is not in the table is answered as forbidden, and so is a clock of another process;
    another machine's calls end the process."""
    system, (machine, column) = _linux(), _MACHINES[platform.machine()]
    rows = [row.split() for row in _CALLS.split(",")]
    calls = [(int(row[column]), row[0] in _OF_CLOCKS) for row in rows if row[column] != "0" or column == 1]
    code = [(_LOAD, 0, 0, 4), (_EQUAL, 1, 0, machine), (_RETURN, 0, 0, _KILL), (_LOAD, 0, 0, 0)]
    code += [(_AT_LEAST, len(calls), 0, _X32)]
    code += [(_EQUAL, len(calls) - i + of_clock, 0, number) for i, (number, of_clock) in enumerate(calls)]
    code += [(_RETURN, 0, 0, _EPERM), (_RETURN, 0, 0, _ALLOW)]
    code += [(_LOAD, 0, 0, 16), (_AT_LEAST, 1, 0, _CLOCKS), (_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _EPERM)]
    packed = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *line) for line in code))
    program = struct.pack("HxxxxxxP", len(code), ctypes.addressof(packed))
    system.prctl(_NO_NEW_PRIVS, 1, 0, 0, 0)
    return system.prctl(_SET_SECCOMP, _FILTER, program, 0, 0) == 0


# What Python is about to do (sys.audit) and third-party code must not do: the beginning of the
# event's name, and what it is called.
_CHANGES = (
    "os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod",
    "os.chown", "os.utime", "os.setxattr", "os.removexattr", "os.chflags", "shutil.",
)  # fmt: skip
_REFUSED = {
    "socket.": "opens a network connection",
    "subprocess.": "starts a process",
    "os.system": "starts a process",
    "os.exec": "starts a process",
    "os.spawn": "starts a process",
    "os.posix_spawn": "starts a process",
    "os.startfile": "starts a process",
    "os.fork": "starts a process",
    "pty.": "starts a process",
    "_winapi.": "starts a process",
    "_thread.start": "starts a thread",
    "os.kill": "sends a signal",
    "signal.pthread_kill": "sends a signal",
    "ctypes.": "reaches around Python",
    "gc.get_": "searches the memory for other objects",
    "sqlite3.": "opens a file",
    "mmap.": "maps memory",
    "resource.": "changes its limits",
    "fcntl.": "changes its limits",
    "sys.addaudithook": "changes its limits",
    **dict.fromkeys(_CHANGES, "changes files"),
}
_OPENS = {"open": "opens", "os.listdir": "lists", "os.scandir": "lists", "os.chdir": "goes to"}


def _hook(tell: Callable[[str], None], allowed: tuple[str, ...]) -> Callable[[str, tuple[Any, ...]], None]:
    """The hook, with everything it needs in itself."""
    refused, opens, hidden, closing = dict(_REFUSED), dict(_OPENS), NOT_IMPORTED, {"told": False}
    starts, real, decode, within = str.startswith, os.path.realpath, os.fsdecode, os.path.join
    listed = {os.path.dirname(path) for path in allowed}
    writing = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND

    def refuse(what: str) -> None:
        if not closing["told"]:
            closing["told"] = True
            tell(what)
        raise PermissionError(what)

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event in opens:
            look_at_path(event, *arguments[:3])
        elif event == "import" and starts(str(arguments[0]), hidden):
            refuse(f"imports {arguments[0]}")
        else:
            for beginning, what in refused.items():
                if starts(event, beginning):
                    refuse(f"{what} ({event})")

    def look_at_path(event: str, path: Any = ".", mode: Any = None, flags: Any = 0) -> None:
        if isinstance(path, int):
            refuse(f"{opens[event]} the grader's own pipes")
        found = real(decode(path))
        writes = event == "open" and isinstance(flags, int) and flags & writing
        beneath = any(found == folder or starts(found, within(folder, "")) for folder in allowed)
        if writes or not (beneath or (event != "open" and found in listed)):
            refuse(f"{'writes' if writes else opens[event]} {decode(path)}")

    return hook
