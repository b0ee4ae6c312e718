"""Which sources of a package machine code follows from: those of its kernels, and all that these import.

What a kernel calls, and each constant in it, comes from a module that its own imports. Imports at the top of
a file count, at the left margin: what a function imports is no part of a kernel. Kernels of other packages
have no such list, so code is kept under what a kernel is made of, too: `digest_of`.
"""

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_COMPILER = "compiled"  # the module that kernels are made with
_MAKES = re.compile(rb"\b(kernel|apart)\b")
_CALLS = b"compile_into"  # in what makes kernels of others' functions, or fills what they read


def fingerprint(package: Path) -> str:
    """A name for these sources as they are now."""
    digest = hashlib.sha256()
    for name, text in sorted(sources_of_kernels(package).items()):
        digest.update(f"{name} {len(text)} ".encode() + text)
    return digest.hexdigest()[:16]


def sources_of_kernels(package: Path) -> dict[str, bytes]:
    """Their texts, by dotted name below the package."""
    texts = {}
    for path in package.rglob("*.py"):
        dotted = ".".join(path.relative_to(package).with_suffix("").parts)
        texts[dotted.removesuffix("__init__").removesuffix(".")] = path.read_bytes()
    pattern = rf"^(?:from {package.name}\.?([\w.]*) import (\([^)]*\)|.*)|import {package.name}\.([\w.]+))"
    statement = re.compile(pattern.encode(), re.MULTILINE)
    imports = {name: statement.findall(text) for name, text in texts.items()}
    ahead = [name for name, found in imports.items() if any(map(_makes_kernels, found))]
    found: dict[str, bytes] = {}
    while ahead:
        name = ahead.pop()
        if name not in found and name in texts:
            found[name] = texts[name]
            for each in imports[name]:
                ahead += _modules(*each)
    return found | {name: text for name, text in texts.items() if _CALLS in text}


def _makes_kernels(imported: tuple[bytes, bytes, bytes]) -> bool:
    module, names, _ = imported
    return module.decode() == _COMPILER and bool(_MAKES.search(names))


def _modules(module: bytes, names: bytes, plain: bytes) -> list[str]:
    """The modules that one statement imports; a name that is no module is found in none."""
    start = (module or plain).decode()
    return [start, *(f"{start}.{name}".removeprefix(".") for name in re.findall(r"\w+", names.decode()))]


def digest_of(function: FunctionType) -> str:
    """A name for what a kernel's machine code follows from beside its arguments' types: its instructions,
    the constants in it, and what its names stand for now, kernels it calls included."""
    digest = hashlib.sha256()
    for part in _parts(function, set()):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def _parts(function: FunctionType, seen: set[int]) -> Iterator[str]:
    if id(function) in seen:
        return
    seen.add(id(function))
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    known = {**function.__globals__, **{name: cell.cell_contents for name, cell in cells}}
    for code in _codes(function.__code__):
        yield code.co_code.hex()
        constants = code.co_consts[1:] if code.co_consts[:1] == (function.__doc__,) else code.co_consts
        yield from _value([each for each in constants if not isinstance(each, CodeType)], seen)
        for name in (*code.co_names, *code.co_freevars):
            yield name
            if name in known:
                yield from _value(known[name], seen)
                if isinstance(known[name], ModuleType) and not _is_numeric(known[name].__name__):
                    for below in code.co_names:  # a constant or a kernel may be one of its names
                        yield from _value(vars(known[name]).get(below), seen)


def _is_numeric(module: str) -> bool:
    """Whether what is in a module belongs to a version that code is kept under anyhow."""
    return module.partition(".")[0] in ("math", "numba", "numpy")


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _value(value: Any, seen: set[int]) -> Iterator[str]:
    plain = getattr(value, "py_func", value)
    if isinstance(value, np.ndarray):
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
