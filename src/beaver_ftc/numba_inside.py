"""What is borrowed from inside Numba, so that a first flight compiles in seconds and not in minutes.

`compiled.compile_into` makes kernels of this kind for the versions of Numba it knows, and of Numba's own kind
for others. `tests/test_numba_inside.py` looks at each name that is borrowed.

A kernel that another one calls is only translated: to optimise is done once, for the outermost one and all it
calls; Numba itself optimises again at each level of calls. A few of its functions are replaced for that.

A kernel that only some flights want is compiled by itself, when a flight first calls it (`stub`). What calls
it holds its address, nothing at first, and then asks Python, which finds or compiles the code: so a flight
compiles what it uses, and kernels that call the same one share its code.

What was compiled is kept on the disk, and loaded without making Numba's compiler ready, which takes 0.25 s.
"""

# mypy: disable-error-code="attr-defined"
import atexit
import contextlib
import functools
import gc
import hashlib
import os
import pickle
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, serialize, sigutils, types
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.types import unliteral
from numba.core.typing import npydecl
from numba.extending import intrinsic, overload
from numba.np.numpy_support import ufunc_find_matching_loop

from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.sources import digest_of
from beaver_ftc.numba_sized import kind_of, type_of

__all__ = ["Kernel", "borrowed_row", "kind_of", "stub"]

COMPILING = "compiling the flight code, once on this machine: some 20 s on an idle one"
MORE = "compiling what this flight is the first to use, once on this machine: 10 s to a minute on an idle one"
PATIENCE_S = 1.0  # what takes less needs no word

MOST_BYTES = 500_000_000  # of code kept in a folder: some hundred versions of the flight code

_DIGEST_BYTES = 32
_LOCK = "lock"


class Kernel(CPUDispatcher):
    """A compiled function: kept by itself if Python calls it, and a part of the kernels that call it."""

    def __init__(self, folder: Path | None, function) -> None:
        super().__init__(function, targetoptions={"nopython": True, "error_model": "numpy"})
        self.folder, self._store = folder, folder and _Store(folder, function)

    def compile(self, sig):
        """Machine code for arguments of these types; inside another kernel only what stands for it."""
        types, _ = sigutils.normalize_signature(sig)
        types = tuple(map(unliteral, types))  # a number in the text makes no other function of it
        with global_compiler_lock, self._compiling_counter:
            there = self.overloads.get(tuple(types))
            if there is not None and (_nesting or not isinstance(there.entry_point, _Inner)):
                return there.entry_point
            if _nesting:
                return self._translated(types, inner=True)
            return self._loaded(types) or self._compiled(types)

    def typeof_pyval(self, val):
        """The type of an argument; in place of numba's for records that have a size."""
        return type_of(val) or super().typeof_pyval(val)

    def stored(self, types):
        """The code an earlier process has kept, or None; found without making ready to compile."""
        rtsys.initialize(self.targetctx)
        return self._store and self._store.load(tuple(types), self.targetctx)

    def result(self, types):
        """The code with what is known of it."""
        found = self.stored(types)
        if found is None:
            self.compile(types)
            found = self.overloads[types]
        return found

    def _loaded(self, types):
        self.targetctx.refresh()
        found = self.stored(types)
        if found is None:
            return None
        self._cache_hits[types] += 1
        self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
        self.add_overload(found)
        return found.entry_point

    def _compiled(self, types):
        """Compile, one process at a time, and keep the code."""
        _lighten()
        with _alone(self.folder), _announced(self.folder):
            if entry_point := self._loaded(types):
                return entry_point  # another process came first
            self.overloads.pop(tuple(types), None)
            entry_point = self._translated(types, inner=False)
            if self._store:
                self._store.save(tuple(types), self.overloads[tuple(types)])
        return entry_point

    def _translated(self, types, inner: bool):
        wrappers = {"no_cpython_wrapper": inner, "no_cfunc_wrapper": True}
        _nesting.append(self)
        try:
            self._compiler.targetoptions = self.targetoptions | wrappers
            result = self._compiler.compile(types, None)
        finally:
            _nesting.pop()
        self.add_overload(result)
        return result.entry_point


@contextlib.contextmanager
def _alone(folder: Path | None) -> Iterator[None]:
    """Wait until no other process compiles into this folder: it may be the very same."""
    with contextlib.ExitStack() as held:
        if folder is not None:
            with contextlib.suppress(OSError, ImportError):  # no lock: then several may compile
                import fcntl

                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                fcntl.flock(held.enter_context((folder / _LOCK).open("w")), fcntl.LOCK_EX)
        yield


@functools.cache
def _say_compiling(folder: Path | None) -> None:
    """A word a process: of all the flight code, or of the part that earlier flights have had no use for."""
    kept = folder is not None and any(path.name != _LOCK for path in folder.glob("*"))
    say_once(MORE if kept else COMPILING)


@contextlib.contextmanager
def _announced(folder: Path | None) -> Iterator[None]:
    """Say what takes so long, if it does. Garbage is not looked for meanwhile, nor soon in what the compiler
    leaves: there is little, and looking costs a quarter of its time."""
    saying = threading.Timer(PATIENCE_S, _say_compiling, [folder])
    saying.start()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.unfreeze()  # into the oldest generation
        gc.enable()
        saying.cancel()
        atexit.register(gc.freeze)  # nor when the process ends


class _Store:
    """The machine code of one kernel on the disk: a file a set of argument types, behind its digest."""

    def __init__(self, folder: Path, function) -> None:
        self._folder, self._function = folder, function
        self._name = f"{function.__module__}.{function.__qualname__}"

    @functools.cached_property
    def _of(self):
        """Found when code is first asked for: what is named in a kernel may be defined after it."""
        return self._name, digest_of(self._function), sys.version_info, numba.__version__

    def _path(self, types, codegen) -> Path:
        key = repr((*self._of, types, codegen.magic_tuple()))
        return self._folder / f"{self._name.rpartition('.')[2]}-{hashlib.sha256(key.encode()).hexdigest()}"

    def load(self, types, context):
        """What was kept, ready to run; None if there is nothing, or it is not as it was written."""
        try:
            content = self._path(types, context.codegen()).read_bytes()
        except OSError:
            return None
        digest, content = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if hashlib.sha256(content).digest() != digest:  # damaged machine code must not run
            say_once(f"compiled code in {self._folder} is damaged; it is compiled anew")
            return None
        return CompileResult._rebuild(context, *pickle.loads(content))

    def save(self, types, result) -> None:
        """Keep it; where that is impossible (a full disk), say so and fly without."""
        content = serialize.dumps(result._reduce())
        try:
            self._write(self._path(types, result.codegen), hashlib.sha256(content).digest() + content)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            say_once(f"compiled code cannot be kept in {self._folder}: {reason}; each start compiles anew")

    def _write(self, path: Path, content: bytes) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        partial = path.with_name(f"{path.name}.{os.getpid()}")
        try:
            partial.write_bytes(content)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
        discard_unused(self._folder)


def discard_unused(folder: Path) -> None:
    """Remove what was not used for longest, as far as a folder keeps more than `MOST_BYTES`."""
    files = [(max(at.st_atime, at.st_mtime), at.st_size, path) for path, at in _statuses(folder)]
    total = 0
    for _, size, path in sorted(files, reverse=True):
        total += size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


def _statuses(folder: Path) -> Iterator[tuple[Path, os.stat_result]]:
    for path in folder.glob("*-*"):
        with contextlib.suppress(FileNotFoundError):  # another process has removed it
            if path.is_file():
                yield path, path.stat()


class _Inner:
    """Stands for the machine code of a function that is part of others only."""


_nesting: list[object] = []  # the kernels being compiled, each called by the one before


def _finalize(library) -> None:
    """In place of numba's: optimise a library with all that it calls; leave one that is part of another."""
    library._raise_if_finalized()
    library._translated_only = library._finalized = len(_nesting) > 1
    if library._translated_only:
        return
    library._codegen._check_llvm_bugs()
    own = {function.name for function in _defined(library._final_module)}
    for called in _all_called(library, {}).values():
        library._reload_init.update(called._reload_init)
        library._final_module.link_in(_linkable(called), preserve=True)
    for function in _defined(library._final_module):
        if function.name not in own:
            function.linkage = "internal"  # what is called in one place is then put there, however long
    library._optimize_final_module()
    library._final_module.verify()
    library._finalize_final_module()


def _defined(module):
    return [function for function in module.functions if not function.is_declaration]


def _all_called(library, found: dict) -> dict:
    """The libraries that one needs, those that were only translated with all that they need."""
    for called in library._linking_libraries:
        if id(called) not in found:
            found[id(called)] = called
            if getattr(called, "_translated_only", False):
                _all_called(called, found)
    return found


def _linkable(library):
    """Its module; every function of one that was only translated, wanted so far or not."""
    if not getattr(library, "_translated_only", False):
        return library._get_module_for_linking()
    module = library._final_module.clone()
    for function in _defined(module):
        function.linkage = "weak_odr"
    return module


def _executable(context, library, function, environment):
    """In place of numba's: what Python calls, or what stands for it."""
    library._ensure_finalized()
    inner = len(_nesting) > 1
    return _Inner() if inner else _numbas_executable(context, library, function, environment)


def _add_overload(dispatcher, result) -> None:
    """In place of numba's: what only stands for machine code cannot be called from Python."""
    if isinstance(result.entry_point, _Inner):
        dispatcher.overloads[tuple(result.signature.args)] = result
    else:
        _numbas_add_overload(dispatcher, result)


_numbas_executable, _numbas_add_overload = CPUContext.get_executable, Dispatcher.add_overload
Dispatcher.add_overload = _add_overload  # type: ignore
CPUContext.get_executable = _executable  # type: ignore[method-assign]
CPUCodeLibrary.finalize = _finalize  # type: ignore[method-assign]


def _other_shape(shape, wanted):
    """In place of numba's: what fails if an array is assigned to one of another shape."""
    raise ValueError("an array cannot be assigned to one of another shape")


@functools.cache
def _lighten() -> None:
    """Numba puts both shapes into that message, for which it compiles its strings: two seconds. It writes out
    a record's type, all fields of it, for each pass over each function: written once, it is kept. It looks
    for the loop of an operator each time it meets one.
    """
    from numba.np import arrayobj  # where nothing is compiled it is not needed

    arrayobj.raise_with_shape_context = _other_shape
    overload(_other_shape)(lambda shape, wanted: _other_shape)
    written: dict[int, tuple] = {}
    write = numba.types.Record.__repr__

    def text(record) -> str:
        if id(record) not in written:
            written[id(record)] = (write(record), record)  # kept alive, its id stays its own
        return written[id(record)][0]

    numba.types.Record.__repr__ = text  # type: ignore[method-assign]
    loop_of = functools.cache(ufunc_find_matching_loop)
    npydecl.ufunc_find_matching_loop = lambda ufunc, arg_types: loop_of(ufunc, tuple(arg_types))


_ADDRESS = ir.IntType(64)

_known: dict[tuple[str, ...], Any] = {}
_found: dict[tuple[Any, ...], Any] = {}  # compiled code, kept as long as the process


def stub(name: tuple[str, ...], kernel: Any) -> Callable[..., None]:
    """A function for Numba to compile, which calls this kernel by its address.

    name: module, function, and what else tells the kernel from others. Its arguments are records, arrays and
    numbers; it returns nothing.
    """
    _known[name] = kernel
    function = kernel.py_func
    arguments = ", ".join(f"argument_{i}" for i in range(function.__code__.co_argcount))
    space = {"call": _call(name), "__name__": function.__module__}
    exec(f"def {function.__name__}({arguments}): call(({arguments},))", space)
    made: Callable[..., None] = space[function.__name__]
    return made


def _address(name: tuple[str, ...], packed: bytes) -> int:
    """Where the code of this kernel lies, for arguments of the types packed."""
    import_module(name[0])
    kinds = pickle.loads(zlib.decompress(packed))
    result = _found.get((name, kinds))
    if result is None:
        result = _found[name, kinds] = _known[name].result(kinds)
    if result.signature.return_type != types.none:
        raise TypeError(f"{'.'.join(name)} returns something")
    where: int = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
    return where


def _call(name: tuple[str, ...]) -> Any:
    """What stands for the call in compiled code, to be given the arguments as a tuple."""

    @intrinsic
    def call(typingctx: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds = tuple(arguments.types)
            code = _address_held(context, builder, functools.partial(_address, name, _packed(kinds)))
            convention = context.call_conv
            prototype = convention.get_function_type(types.none, kinds)
            status, _ = convention.call_function(
                builder,
                builder.inttoptr(code, prototype.as_pointer()),
                types.none,
                kinds,
                cgutils.unpack_tuple(builder, values[0], len(kinds)),
            )
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.none(arguments), codegen

    return call


def _packed(kinds: tuple[Any, ...]) -> bytes:
    return zlib.compress(serialize.dumps(kinds))


def _address_held(context: Any, builder: Any, ask: Callable[[], int]) -> Any:
    """Code that loads the address, and asks for it the first time. An exception ends the call."""
    place = cgutils.add_global_variable(builder.module, _ADDRESS, "address")
    place.linkage, place.initializer = "internal", _ADDRESS(0)
    with cgutils.if_unlikely(builder, builder.icmp_unsigned("==", builder.load(place), _ADDRESS(0))):
        python = context.get_python_api(builder)
        lock = python.gil_ensure()
        asked = python.unserialize(python.serialize_object(ask))
        answer = python.call_function_objargs(asked, ())
        python.decref(asked)
        failed = cgutils.is_null(builder, answer)
        with cgutils.if_unlikely(builder, failed):
            python.gil_release(lock)
            context.call_conv.return_exc(builder)
        builder.store(python.long_as_longlong(answer), place)
        python.decref(answer)
        python.gil_release(lock)
    return builder.load(place)


@intrinsic
def borrowed_row(typingctx, array, i):
    """Row i of an array (m, n) that nobody counts the users of: it must stay where it is meanwhile."""
    from numba.np.arrayobj import make_array, populate_array

    row_type = types.Array(array.dtype, 1, "C")

    def codegen(context, builder, signature, args):
        whole = make_array(signature.args[0])(context, builder, args[0])
        _, columns = cgutils.unpack_tuple(builder, whole.shape, 2)
        first = builder.gep(whole.data, [builder.mul(args[1], columns)])
        row = make_array(row_type)(context, builder)
        populate_array(row, first, [columns], [whole.itemsize], whole.itemsize, meminfo=None)
        return row._getvalue()

    return row_type(array, types.intp), codegen
