"""Compiled code that asks Python for a number, and keeps it for as long as the process.

Borrowed from inside Numba, like target.py, and used with the same versions.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils

WORD = ir.IntType(64)


def number_from_python(builder: Any, python: Any, asked: Any, *arguments: Any) -> tuple[Any, Any]:
    """Code that asks a function of Python for a whole number: that number, or 0, and whether it failed."""
    found = cgutils.alloca_once_value(builder, WORD(0))
    answer = python.call_function_objargs(asked, arguments)
    failed = cgutils.is_null(builder, answer)
    with cgutils.if_likely(builder, builder.not_(failed)):
        builder.store(python.long_as_longlong(answer), found)
        python.decref(answer)
    return builder.load(found), failed


def held_value(builder: Any, kind: Any, make: Callable[[], Any]) -> Any:
    """Code that loads a value, zero at first; make: code that gives it the first time."""
    place = cgutils.add_global_variable(builder.module, kind, "held")
    place.linkage, place.initializer = "internal", ir.Constant(kind, None)
    with cgutils.if_unlikely(builder, cgutils.is_null(builder, builder.load(place))):
        builder.store(make(), place)
    return builder.load(place)
