"""What a kernel's machine code follows from, beside the types of its arguments, and a name for it.

It follows from the kernel's instructions, its constants, and all that its names stand for, kernels it calls
included. Comments, docstrings and line numbers change no code. What is compiled by means of its own, an
intrinsic, is as its whole file.
"""

import hashlib
import sys
from collections.abc import Iterator
from enum import EnumMeta
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from beaver_ftc.documents.files import digest_of_files

BY_ADDRESS = "called_by_address"  # an attribute of a kernel that its callers look up by name when they run


def digest_of(function: FunctionType) -> str:
    """A name for what a kernel's machine code follows from beside its arguments' types: its instructions,
    the constants in it, and what its names stand for now, kernels it calls included."""
    return hashlib.sha256(what_follows(function)).hexdigest()


def what_follows(function: FunctionType) -> bytes:
    """All that the digest is of. Its length says roughly how long it takes to compile."""
    return b"".join(part.encode() + b"\0" for part in _parts(function, {}))


def _parts(function: FunctionType, seen: dict[int, int]) -> Iterator[str]:
    if id(function) in seen:
        yield f"as before, {seen[id(function)]}"
        return
    seen[id(function)] = len(seen)
    yield str(function.__module__)  # which the kept code imports
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    known = {**function.__globals__, **{name: cell.cell_contents for name, cell in cells}}
    yield from _value(function.__defaults__ or (), seen)
    for code in _codes(function.__code__):
        yield code.co_code.hex()
        constants = code.co_consts[1:] if code.co_consts[:1] == (function.__doc__,) else code.co_consts
        yield from _value([each for each in constants if not isinstance(each, CodeType)], seen)
        for name in (*code.co_names, *code.co_freevars):
            yield name
            if name in known:
                yield from _named(known[name], code.co_names, seen, set())


def _named(value: Any, names: tuple[str, ...], seen: dict[int, int], passed: set[int]) -> Iterator[str]:
    """A value, and of a module whatever these names may stand for in it: a constant, a kernel, a module."""
    yield from _value(value, seen)
    if isinstance(value, ModuleType) and not _is_numeric(value.__name__) and id(value) not in passed:
        for below in names:
            yield from _named(vars(value).get(below), names, seen, passed | {id(value)})


def _is_numeric(module: str) -> bool:
    """Whether what is in a module belongs to a version that code is kept under anyhow."""
    return module.partition(".")[0] in ("math", "numba", "numpy")


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _value(value: Any, seen: dict[int, int]) -> Iterator[str]:
    plain = getattr(value, "py_func", value)
    defined_by = getattr(value, "_defn", None)  # of an intrinsic: what gives its instructions
    if hasattr(value, BY_ADDRESS):
        yield getattr(value, BY_ADDRESS)
    elif isinstance(value, EnumMeta):
        yield repr([*value])
    elif isinstance(defined_by, FunctionType):
        yield digest_of_files(Path(sys.modules[defined_by.__module__].__file__ or ""))
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    elif isinstance(value, tuple | list):
        yield f"{len(value)}"
        for each in value:
            yield from _value(each, seen)
    elif isinstance(value, frozenset):
        yield repr(sorted(map(repr, value)))
    elif isinstance(value, bool | int | float | complex | str | bytes | np.generic | np.dtype | None):
        yield repr(value)
    elif isinstance(plain, FunctionType) and not _is_numeric(plain.__module__):
        yield from _parts(plain, seen)
    else:
        yield f"{type(value).__qualname__} {getattr(value, '__name__', '')}"
