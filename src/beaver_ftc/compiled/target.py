"""Our kernels' own target of Numba's compiler, so that a first flight compiles in seconds, not in minutes.

Numba knows its targets by registries [numba.core.target_extension]: a class of target, the dispatcher of
its functions, and the contexts in which they are typed and translated. Ours inherit from those of Numba's
CPU target. Nothing of Numba is replaced: a function that somebody else compiles never comes here.

Of a version of Numba in `KNOWN` more is borrowed: records have a size (sized_types.py), and what only some
flights want is called by its address. With any other version each aircraft has code of its
own, all of it, which takes longer. library.py serves other versions too, if it passes a trial in a process
of its own.

Kernels that are called by their address, each compiled by itself when a flight first calls it.

The caller holds the address, zero at first; then Python finds or compiles the code. So a flight compiles
what it uses, and kernels that call the same one share its code.
"""

import functools
import hashlib
import os
import pickle
import zlib
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, serialize, sigutils, types, typing
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.core.runtime import rtsys
from numba.core.target_extension import (
    CPU,
    dispatcher_registry,
    jit_registry,
    target_override,
    target_registry,
)
from numba.core.types import unliteral
from numba.core.utils import threadsafe_cached_property
from numba.extending import intrinsic, overload

from beaver_ftc.compiled import cache
from beaver_ftc.compiled import library as trial
from beaver_ftc.compiled.cache import CodeCache, announced, locked
from beaver_ftc.compiled.library import Codegen, Inner, compiling
from beaver_ftc.compiled.sized_types import kind_of, type_of
from beaver_ftc.documents.errors import say_once

__all__ = ["stub"]

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
    with cache.held():
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


# mypy: disable-error-code="attr-defined,misc"


NAME = "beaver_ftc"  # of the target
KNOWN = ("0.68",)  # versions of Numba whose inside is as we have found it
VARIABLE = "BEAVER_FTC_COMPILER"  # `numba`: as with a version that is not known; `trial`: without a trial
SLOWER = "numba {} is not known from inside: code is compiled in a minute, not in 20 s; known: numba {}"
SLOWEST = "numba {} has other parts than are known: code is compiled in minutes, not in 20 s; known: numba {}"


class Target(CPU):
    """Numba's token of the target: what is meant for any target or for CPUs is meant for it too."""


@functools.cache
def borrows() -> bool:
    """Whether this version of Numba is known from inside."""
    known = numba.__version__.startswith(tuple(f"{version}." for version in KNOWN))
    return known and not os.environ.get(VARIABLE)


@functools.cache
def optimises_once() -> bool:
    """Whether library.py makes the machine code: where this version is known, or has passed a trial."""
    return borrows() or os.environ.get(VARIABLE) == "trial" or trial.passes()


class _Context(CPUContext):
    """How functions are translated: as by Numba, under names of ours."""

    def init(self) -> None:
        super().init()
        if optimises_once():
            self._internal_codegen = Codegen(NAME)

    def load_additional_registries(self) -> None:
        rtsys.initialize(cpu_target.target_context)  # what all targets share, as if ours were not there
        super().load_additional_registries()
        _shorten_messages()

    def mangler(self, name: str, types: Any, *, abi_tags: Any = (), uid: Any = None) -> str:
        """The name of a compiled function: after what its types contain.

        Numba names a record's type after how many types there were before in this process. Code that two
        processes have kept would then have the same names for records of two aircraft, and a third process
        that loads both would run the one for the other.
        """
        return super().mangler(name, (_digest_of(tuple(types)),), abi_tags=abi_tags, uid=uid)

    def get_executable(self, library: Any, fndesc: Any, env: Any) -> Any:
        """What Python calls; of an inner function what stands for it."""
        library._ensure_finalized()
        is_inner = len(compiling) > 1 and optimises_once()
        return Inner() if is_inner else super().get_executable(library, fndesc, env)


@functools.cache
def _digest_of(types: tuple[Any, ...]) -> str:
    return hashlib.sha256(repr(types).encode()).hexdigest()[:16]


class _TypingContext(typing.Context):
    """How functions are typed: as by Numba, each operator and function of NumPy once for the same types."""

    def init(self) -> None:
        super().init()
        self._resolved: dict[Any, Any] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of a function for these types. Numba tries all its definitions at each call."""
        of_types = not kws and all(isinstance(each, types.Type) for each in args)
        if not of_types or (isinstance(func, types.Type) and not isinstance(func, types.Function)):
            return super().resolve_function_type(func, args, kws)
        key = func, tuple(args)
        if key not in self._resolved:
            self._resolved[key] = super().resolve_function_type(func, args, kws)
        return self._resolved[key]


class _TargetOfKernels(CPUTarget):
    @threadsafe_cached_property
    def _toplevel_target_context(self) -> _Context:
        return _Context(self.typing_context, self._target_name)

    @threadsafe_cached_property
    def _toplevel_typing_context(self) -> _TypingContext:
        return _TypingContext()


target_registry[NAME] = Target
_target = _TargetOfKernels(NAME)


class Dispatcher(CPUDispatcher):
    """A function compiled for our target: ours, or one of those by which Numba implements NumPy."""

    targetdescr = _target

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled; what only stands for machine code cannot be called from Python."""
        if isinstance(cres.entry_point, Inner):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)


class Kernel(Dispatcher):
    """A kernel: kept by itself if Python calls it, and a part of the kernels that call it."""

    def __init__(self, folder: Path | None, function: Callable[..., Any]) -> None:
        super().__init__(function, targetoptions={"nopython": True, "error_model": "numpy"})
        self.folder, self._cached = folder, folder and CodeCache(folder, function)
        self._inner: set[tuple[Any, ...]] = set()  # arguments for which it is only a part of others so far

    def compile(self, sig: Any) -> Any:
        """Machine code for arguments of these types; inside another kernel only what stands for it."""
        args, _ = sigutils.normalize_signature(sig)
        args = tuple(map(unliteral, args))  # a number in the text makes no other function of it
        with global_compiler_lock, self._compiling_counter:
            there = self.overloads.get(args)
            if there is not None and (compiling or args not in self._inner):
                return there.entry_point
            if compiling:
                return self._compiled_as_part(args)
            return self._loaded(args) or self._compiled(args)

    def typeof_pyval(self, val: Any) -> Any:
        """The type of an argument; in place of Numba's for records that have a size."""
        return (borrows() and type_of(val)) or super().typeof_pyval(val)

    def stored(self, args: Any) -> Any:
        """The code an earlier process has kept, or None; found without making ready to compile."""
        rtsys.initialize(cpu_target.target_context)
        return self._cached and self._cached.load(tuple(args), self.targetctx)

    def result(self, args: Any) -> Any:
        """The code with what is known of it."""
        found = self.stored(args)
        if found is None:
            self.compile(args)
            found = self.overloads[args]
        return found

    def _loaded(self, args: tuple[Any, ...]) -> Any:
        self.targetctx.refresh()
        found = self.stored(args)
        if found is None:
            return None
        self._cache_hits[args] += 1
        self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
        return self._offered(args, found)

    def _compiled(self, args: tuple[Any, ...]) -> Any:
        """Compile, one process at a time, and keep the code."""
        with locked(self.folder), announced(self.folder):
            if entry_point := self._loaded(args):
                return entry_point  # another process came first
            _say_slower()
            result = self._translated(args, {"no_cfunc_wrapper": True})
            if self._cached:
                self._cached.save(args, result)
        return self._offered(args, result)

    def _compiled_as_part(self, args: tuple[Any, ...]) -> Any:
        result = self._translated(args, {"no_cfunc_wrapper": True, "no_cpython_wrapper": True})
        self._inner.add(args)
        self.overloads[args] = result
        return result.entry_point

    def _translated(self, args: tuple[Any, ...], wrappers: dict[str, bool]) -> Any:
        compiling.append(self)
        self._compiler.targetoptions = self.targetoptions | wrappers
        try:
            with target_override(NAME):
                return self._compiler.compile(args, None)
        finally:
            compiling.pop()

    def _offered(self, args: tuple[Any, ...], result: Any) -> Any:
        """The code, where Python and functions that Numba compiles by its own means find it."""
        cpu_target.target_context.insert_user_function(result.entry_point, result.fndesc, [result.library])
        self._inner.discard(args)
        self.add_overload(result)
        return result.entry_point


def _say_slower() -> None:
    if os.environ.get(VARIABLE) != "trial" and not borrows():
        says = SLOWER if optimises_once() else SLOWEST
        say_once(says.format(numba.__version__, ", ".join(f"{version}.*" for version in KNOWN)))


def _jit(**options: Any) -> Callable[..., Dispatcher]:
    """The decorator of what Numba itself has compiled for our target."""
    return functools.partial(Dispatcher, targetoptions=options)


dispatcher_registry[Target] = Kernel
jit_registry[Target] = _jit


@functools.cache
def _shorten_messages() -> None:
    """Numba puts two arrays' shapes into the message that one cannot be assigned to the other: to compile its
    strings for that takes two seconds."""
    from numba.np.arrayobj import raise_with_shape_context

    @overload(raise_with_shape_context, target=NAME)
    def _raise(src_shapes, index_shape):
        def refuse(src_shapes, index_shape):
            raise ValueError("an array cannot be assigned to one of another shape")

        return refuse


def array_type(dtype: Any, dimensions: int) -> Any:
    """The type of a C-ordered array; of records that have a size, theirs."""
    sized = borrows() and kind_of(dtype, dimensions)
    return sized or types.Array(numba.from_dtype(dtype), dimensions, "C")


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
