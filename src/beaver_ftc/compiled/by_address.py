"""Kernels that are called by their address, each compiled by itself when a flight first calls it.

The caller holds the address, zero at first; then Python finds or compiles the code. So a flight compiles what
it uses, and kernels that call the same one share its code.

Borrowed from inside Numba, like target.py, and used with the same versions.
"""

import functools
import pickle
import zlib
from collections.abc import Callable
from importlib import import_module
from typing import Any

from numba.core import cgutils, serialize, types
from numba.extending import intrinsic

from beaver_ftc.compiled.asking import WORD, held_value, number_from_python
from beaver_ftc.compiled.cache import held

_known: dict[tuple[str, ...], Any] = {}


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
    result = _known[name].result(kinds)
    if result.signature.return_type != types.none:
        raise TypeError(f"{'.'.join(name)} returns something")
    with held():
        where: int = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
    return where


def _call(name: tuple[str, ...]) -> Any:
    """What stands for the call in compiled code, to be given the arguments as a tuple."""

    @intrinsic
    def call(typingctx: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds = tuple(arguments.types)
            ask = functools.partial(_address, name, zlib.compress(serialize.dumps(kinds)))
            code = held_value(builder, WORD, lambda: _asked(context, builder, ask))
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


def _asked(context: Any, builder: Any, ask: Callable[[], int]) -> Any:
    """Code that asks Python for an address. An exception ends the call."""
    python = context.get_python_api(builder)
    lock = python.gil_ensure()
    asked = python.unserialize(python.serialize_object(ask))
    address, failed = number_from_python(builder, python, asked)
    python.decref(asked)
    python.gil_release(lock)
    with cgutils.if_unlikely(builder, failed):
        context.call_conv.return_exc(builder)
    return address
