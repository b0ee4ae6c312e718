"""A second process that translates some kernels while this one translates others: two cores, half the time.

It is started afresh, not forked: whoever flies may have threads. If anything goes wrong with it, this process
translates all by itself.
"""

# mypy: disable-error-code="attr-defined"
import contextlib
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from itertools import count
from typing import Any

from llvmlite import binding
from numba.core import serialize
from numba.core.bytecode import FunctionIdentity
from numba.core.compiler import CompileResult

from beaver_ftc.translation import Inner, all_called, lighten, linkable, nesting

Part = tuple[Any, tuple[Any, ...]]  # a kernel, and the types of its arguments
PROGRAM = "from beaver_ftc.second_process import serve; serve()"
FIRST_NUMBER = 1_000_000  # functions are told apart by a number; those of the two processes must differ
PATIENCE_S = 600.0
_ONE_CORE = 1


class Helper:
    """The second process, from when it is started until its results have been taken."""

    def __init__(self, parts: list[Part]) -> None:
        self._files = contextlib.ExitStack()
        self._process: subprocess.Popen[bytes] | None = None
        if _cores() > _ONE_CORE and sys.executable and all(_is_known(kernel) for kernel, _ in parts):
            with contextlib.suppress(OSError):
                self._start(parts)

    def __enter__(self) -> "Helper":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._files.close()

    def _start(self, parts: list[Part]) -> None:
        asked = self._files.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        self._said = self._files.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        names = [(kernel.py_func.__module__, kernel.py_func.__qualname__, types) for kernel, types in parts]
        asked.write(serialize.dumps(names))
        asked.seek(0)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        self._process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            stdin=asked, stdout=self._said, stderr=subprocess.DEVNULL, env=environment,
        )  # fmt: skip

    def results(self, context: Any) -> Iterator[Any]:
        """What it has translated, one for each part, once it is ready; nothing if it has failed."""
        if self._process is None:
            return
        try:
            failed = self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            return
        if not failed:
            self._said.seek(0)
            for packed in pickle.load(self._said):
                yield _unpacked(context, *packed)


def _is_known(kernel: Any) -> bool:
    """Whether the other process finds this one by its name, and not another in its place."""
    function = kernel.py_func
    return getattr(sys.modules.get(function.__module__), function.__qualname__, None) is kernel


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def serve() -> None:
    """The second process: translate what standard input asks for, and say it on standard output."""
    asked, said = sys.stdin.buffer.read(), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is not a part of it
    FunctionIdentity._unique_ids = count(FIRST_NUMBER)
    lighten()
    nesting.append("the kernel that the other process compiles")
    said.write(serialize.dumps([_packed(*asked_for) for asked_for in pickle.loads(asked)]))
    said.close()
    os._exit(0)


def _packed(module: str, name: str, types: tuple[Any, ...]) -> tuple[Any, ...]:
    """A kernel with all that it calls, translated."""
    kernel = getattr(import_module(module), name)
    kernel.targetctx.refresh()
    kernel.compile(types)
    result = kernel.overloads[tuple(types)]
    library = result.library
    for called in all_called(library, {}).values():
        library._reload_init.update(called._reload_init)
        library._final_module.link_in(linkable(called), preserve=True)
    fndesc = result.fndesc
    fndesc.typemap = fndesc.calltypes = None  # as numba does: neither needed nor always possible to pickle
    code = library.name, library._final_module.as_bitcode(), library._reload_init
    return code, fndesc, result.environment, result.signature, tuple(result._find_referenced_environments())


def _unpacked(
    context: Any, code: Any, fndesc: Any, environment: Any, signature: Any, others: Any
) -> CompileResult:
    """The same in this process, to be a part of another kernel."""
    name, bitcode, reload_init = code
    library = context.codegen().create_library(name)
    library._final_module = binding.parse_bitcode(bitcode)
    library._reload_init.update(reload_init)
    library._translated_only = library._finalized = True
    fields = {
        "target_context": context, "typing_context": context.typing_context, "library": library,
        "environment": environment, "entry_point": Inner(), "fndesc": fndesc, "type_annotation": "",
        "signature": signature, "objectmode": False, "lifted": (), "typing_error": None, "call_helper": None,
        "metadata": None, "reload_init": [], "referenced_envs": others,
    }  # fmt: skip
    return CompileResult(**fields)
