"""The fault types, a line each. A new one is a module beside this one and a line here."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import (
    bias,
    contract,
    floating,
    growing_bias,
    hardover_down,
    hardover_up,
    loss,
    oscillatory,
    rate_limit,
    stuck,
    varying_loss,
)

REGISTERED: tuple[ModuleType, ...] = (
    loss,
    stuck,
    floating,
    hardover_up,
    hardover_down,
    bias,
    varying_loss,
    oscillatory,
    rate_limit,
    growing_bias,
)

# Types of a constant parameter come first; a type's number is its place.
TYPES = tuple(sorted(REGISTERED, key=lambda module: not module.CONSTANT))
N_TYPES = len(TYPES)
N_CONSTANT = sum(module.CONSTANT for module in TYPES)
NAMES: tuple[str, ...] = tuple(module.NAME for module in TYPES)
FAMILY = tuple(NAMES.index(name) for name in NAMES)  # the first type of the same name
CONSTANT_LOSS, VARYING_LOSS = TYPES.index(loss), TYPES.index(varying_loss)
STUCK, FLOAT = TYPES.index(stuck), TYPES.index(floating)
UP, DOWN = TYPES.index(hardover_up), TYPES.index(hardover_down)
BIAS, GROWING_BIAS = TYPES.index(bias), TYPES.index(growing_bias)
OSCILLATORY, SLOW = TYPES.index(oscillatory), TYPES.index(rate_limit)


def part(module: ModuleType, name: str) -> Any:
    """A part of a type, or what the contract has in its place."""
    return getattr(module, name, getattr(contract, name, None))


def _written_out(name: str, arguments: str, lines: list[str]) -> Callable[..., Any]:
    """A kernel whose body is `lines`, in which `part_3` is that part of type 3.

    Compiled code calls only what it can name, so the calls are written out, one a type.
    """
    space = {f"part_{kind}": part(module, name) for kind, module in enumerate(TYPES)}
    space["__name__"] = __name__
    source = "\n    ".join([f"def {name}_each({arguments}):", *lines])
    exec(compile(source, __file__, "exec"), space)
    return kernel(space[f"{name}_each"])


def _all_of(name: str, arguments: str) -> Callable[..., Any]:
    """A kernel that calls this part of every type; `kind` among the arguments is each type's own."""
    taken = ", ".join(argument for argument in arguments.split(", ") if argument != "kind")
    calls = [
        f"part_{kind}({arguments})".replace("kind", str(kind))
        for kind, module in enumerate(TYPES)
        if hasattr(module, name)
    ]
    return _written_out(name, taken, calls)


def _one_of(name: str, arguments: str, passed: str) -> Callable[..., Any]:
    """A kernel that calls this part of the type `kind` and returns what that returns."""
    calls = [f"if kind == {kind}: return part_{kind}({passed})" for kind in range(N_TYPES)]
    return _written_out(name, arguments, [*calls, f"return part_0({passed})"])


begin_each = _all_of("begin", "surface, kind")
watch_each = _all_of("watch", "fdi, surface, kind")
pass_over_each = _all_of("pass_over", "fdi, surface, kind")
judge_each = _all_of("judge", "fdi, surface, kind, frame")
let_go_each = _all_of("let_go", "fdi, surface, kind")
bring_back_each = _all_of("bring_back", "fdi, surface, kind")
shown = _one_of("shown", "surface, kind", "surface")
deflection = _one_of("deflection", "fdi, surface, kind", "fdi, surface, kind")
