"""Kernels that are called by their address, each compiled by itself when a flight first calls it.

The caller holds the address, zero at first; then Python finds or compiles the code. So a flight
compiles what it uses, and kernels that call the same one share its code.
"""

import functools
import pickle
import zlib
from collections.abc import Callable
from importlib import import_module
from typing import Any

from llvmlite import ir
from numba.core import cgutils, serialize, types
from numba.extending import intrinsic

from beaver_ftc.compiled import interrupts

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
    with interrupts.held():
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
