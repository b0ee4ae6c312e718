"""One of several kernels by its number: how compiled code calls a row of a table.

Compiled code calls only kernels that it can name. `one_of` names each row's kernel in turn, so the caller's
code does not depend on how many rows there are. Give it lazy kernels (compiled.py): a flight then compiles
the rows that it uses.
"""

from collections.abc import Callable, Sequence
from typing import Any

from beaver_ftc.compiled import kernel

Kernel = Callable[..., None]


def one_of(kernels: Sequence[Kernel]) -> Kernel:
    """A kernel (place, *arguments) that calls the kernel at that place with these arguments.

    place: 0 for the first kernel; a place beyond the last calls the last. The kernels return nothing.
    """
    first, others = kernels[0], kernels[1:]

    if not others:

        @kernel
        def last(place: int, *arguments: Any) -> None:
            first(*arguments)

        return last

    rest = one_of(others)

    @kernel
    def either(place: int, *arguments: Any) -> None:
        if place == 0:
            first(*arguments)
        else:
            rest(place - 1, *arguments)

    return either
