"""How Numba compiles this package: each kernel is translated once, and optimised as a part of the outermost.

Numba itself optimises again at each level of calls. A few of its functions are replaced here.

A kernel that only some flights want is compiled by itself, when a flight first calls it (`stub`). What calls
it holds its address, nothing at first, and then asks Python, which finds or compiles the code: so a flight
compiles what it uses, and kernels that call the same one share its code.
"""

# mypy: disable-error-code="attr-defined"
import functools
import hashlib
import pickle
import zlib
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, errors, serialize, types
from numba.core.codegen import CPUCodeLibrary
from numba.core.cpu import CPUContext
from numba.core.dispatcher import Dispatcher
from numba.core.targetconfig import TargetConfig
from numba.core.typing import npydecl
from numba.extending import intrinsic, overload
from numba.np.numpy_support import ufunc_find_matching_loop


class Inner:
    """Stands for the machine code of a function that is part of others only."""


nesting: list[object] = []  # the kernels being compiled, each called by the one before


def _finalize(library) -> None:
    """In place of numba's: optimise a library with all that it calls; leave one that is part of another."""
    library._raise_if_finalized()
    library._translated_only = library._finalized = len(nesting) > 1
    if library._translated_only:
        return
    library._codegen._check_llvm_bugs()
    own = {function.name for function in _defined(library._final_module)}
    for called in all_called(library, {}).values():
        library._reload_init.update(called._reload_init)
        library._final_module.link_in(linkable(called), preserve=True)
    for function in _defined(library._final_module):
        if function.name not in own:
            function.linkage = "internal"  # what is called in one place is then put there, however long
    library._optimize_final_module()
    library._final_module.verify()
    library._finalize_final_module()


def _defined(module):
    return [function for function in module.functions if not function.is_declaration]


def all_called(library, found: dict) -> dict:
    """The libraries that one needs, those that were only translated with all that they need."""
    for called in library._linking_libraries:
        if id(called) not in found:
            found[id(called)] = called
            if getattr(called, "_translated_only", False):
                all_called(called, found)
    return found


def linkable(library):
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
    inner = len(nesting) > 1
    return Inner() if inner else _numbas_executable(context, library, function, environment)


def _add_overload(dispatcher, result) -> None:
    """In place of numba's: what only stands for machine code cannot be called from Python."""
    if isinstance(result.entry_point, Inner):
        dispatcher.overloads[tuple(result.signature.args)] = result
    else:
        _numbas_add_overload(dispatcher, result)


@functools.cache
def _digest_of(record) -> str:
    return hashlib.sha256(repr(record).encode()).hexdigest()[:16]


def _by_contents(record):
    """In place of numba's: what a record's type is called in the names of compiled functions.

    Numba counts a process's types. Code that two processes have kept would then have the same names for
    records of two aircraft, and a third process that loads both would run the one for the other.
    """
    return type(record).__name__, (_digest_of(record),)


_numbas_executable, _numbas_add_overload = CPUContext.get_executable, Dispatcher.add_overload
Dispatcher.add_overload = _add_overload  # type: ignore
CPUContext.get_executable = _executable  # type: ignore[method-assign]
CPUCodeLibrary.finalize = _finalize  # type: ignore[method-assign]
numba.types.Record.mangling_args = property(_by_contents)  # type: ignore


def _other_shape(shape, wanted):
    """In place of numba's: what fails if an array is assigned to one of another shape."""
    raise ValueError("an array cannot be assigned to one of another shape")


@functools.cache
def lighten() -> None:
    """Numba puts both shapes into that message, for which it compiles its strings: two seconds. It writes out
    a record's type, all fields of it, for each pass over each function: written once, it is kept. It compares
    the options of compilers name by name, colours messages that nobody reads, and looks for the loop of an
    operator each time it meets one: another three seconds.
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
    npydecl.ufunc_find_matching_loop = _loop_found
    TargetConfig.__eq__ = _same_options  # type: ignore[method-assign]
    TargetConfig.__hash__ = lambda options: hash(type(options))  # type: ignore[method-assign]
    if hasattr(errors, "HighlightColorScheme"):
        errors.HighlightColorScheme._markup = lambda scheme, message, *_, **__: message


def _loop_found(ufunc, types):
    """In place of numba's: as before for the same types."""
    return _loop_of(ufunc, tuple(types))


@functools.cache
def _loop_of(ufunc, types):
    return ufunc_find_matching_loop(ufunc, types)


_numbas_same_options = TargetConfig.__eq__


def _same_options(one, other) -> bool:
    """In place of numba's, which looks at every option there is. What is hashed there is their names."""
    if type(one) is type(other) and one._values == other._values:
        return True
    return bool(_numbas_same_options(one, other))


Address = ir.IntType(64)

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


def address(name: tuple[str, ...], packed: bytes) -> int:
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
            code = _address_held(context, builder, functools.partial(address, name, _packed(kinds)))
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
    place = cgutils.add_global_variable(builder.module, Address, "address")
    place.linkage, place.initializer = "internal", Address(0)
    with cgutils.if_unlikely(builder, builder.icmp_unsigned("==", builder.load(place), Address(0))):
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
