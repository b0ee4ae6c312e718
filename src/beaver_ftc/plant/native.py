"""Many properties in one compiled call, and JSBSim's own frame from compiled code.

A property read through JSBSim's Python binding costs about 0.1 us; a frame reads and writes some forty. The
binding exports the C++ accessors of a property node, so a compiled kernel can call them on the node's own
address: 0.01 us each. That rests on how one build of the binding is laid out, so `available` checks it
before it is used, and the environment variable BEAVER_FTC_NATIVE=0 turns it off; the caller then reads and
writes through Python.

Likewise the executive's `Run`, which `advance` calls: a flight then leaves compiled code only when something
changes. An error that JSBSim raises could not be caught there. Its models of an aircraft without engines
raise none once that is loaded and trimmed; aircraft with engines are run through Python.

    bank = NodeBank([plant.node(name) for name in names])
    read_nodes(getter_address(), bank.pointers, out)       # also from inside another compiled kernel
"""

import ctypes
import os
import sys
from collections.abc import Sequence
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.extending import intrinsic

from beaver_ftc.compiled import kernel

if TYPE_CHECKING:  # whoever only diagnoses has compiled code of this module, and no JSBSim
    import jsbsim

_GETTER = "_ZNK14SGPropertyNode14getDoubleValueEv"  # double SGPropertyNode::getDoubleValue() const
_SETTER = "_ZN14SGPropertyNode14setDoubleValueEd"  # bool SGPropertyNode::setDoubleValue(double)

# The Python node: reference count, type, C++ method table, then the counted pointer to the C++ node.
_NODE_SIZE = 32
_POINTER_OFFSET = 24

_RUN = "_ZN6JSBSim9FGFDMExec3RunEv"  # bool JSBSim::FGFDMExec::Run()

# The Python executive: reference count, type, the C++ executive twice (as its base, as itself), a dictionary.
_EXECUTIVE_SIZE = 40
_BASE_OFFSET, _EXECUTIVE_OFFSET = 16, 24

# What `advance` needs: code and executive; whether turbulence is to be turned, and the nodes for that.
RUNNING = np.dtype(
    [
        ("run", "i8"), ("executive", "i8"), ("turbulent", "i8"),
        ("getter", "i8"), ("setter", "i8"), ("heading_pointer", "i8"), ("axes_pointer", "i8"),
    ],
    align=True,
)  # fmt: skip


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(import_module("jsbsim._jsbsim").__file__)


def _address(symbol: str) -> int:
    try:
        return ctypes.cast(getattr(_library(), symbol), ctypes.c_void_p).value or 0
    except (AttributeError, OSError):
        return 0


def getter_address() -> int:
    """Address of the compiled read of one node; 0 if this build does not export it."""
    return _address(_GETTER)


def setter_address() -> int:
    """Address of the compiled write of one node; 0 if this build does not export it."""
    return _address(_SETTER)


@intrinsic
def _call_getter(typingctx, function, node):
    def codegen(context, builder, signature, args):
        prototype = ir.FunctionType(ir.DoubleType(), [ir.IntType(64)])
        return builder.call(builder.inttoptr(args[0], prototype.as_pointer()), [args[1]])

    return types.float64(types.int64, types.int64), codegen


@intrinsic
def _call_setter(typingctx, function, node, value):
    def codegen(context, builder, signature, args):
        prototype = ir.FunctionType(ir.IntType(1), [ir.IntType(64), ir.DoubleType()])
        return builder.call(builder.inttoptr(args[0], prototype.as_pointer()), [args[1], args[2]])

    return types.boolean(types.int64, types.int64, types.float64), codegen


@intrinsic
def _call_run(typingctx, function, executive):
    def codegen(context, builder, signature, args):
        prototype = ir.FunctionType(ir.IntType(1), [ir.IntType(64)])
        return builder.call(builder.inttoptr(args[0], prototype.as_pointer()), [args[1]])

    return types.boolean(types.int64, types.int64), codegen


@kernel
def advance(running):
    """One JSBSim frame; turbulence is first turned along the heading, see gust.MovingAir."""
    if running.turbulent:
        heading: float = _call_getter(running.getter, running.heading_pointer)  # type: ignore
        _call_setter(running.setter, running.axes_pointer, -heading)
    _call_run(running.run, running.executive)  # type: ignore


@kernel
def read_nodes(getter, pointers, out):
    """Read nodes into out. getter: getter_address(). pointers, out: (n,) int64, float64."""
    for i in range(pointers.size):
        out[i] = _call_getter(getter, pointers[i])  # type: ignore[call-arg]


@kernel
def write_nodes(setter, pointers, values):
    """Write values to nodes. setter: setter_address(). pointers, values: (n,) int64, float64."""
    for i in range(pointers.size):
        _call_setter(setter, pointers[i], values[i])  # type: ignore[call-arg]


def _pointer(node: "jsbsim.FGPropertyNode") -> int:
    return ctypes.c_int64.from_address(id(node) + _POINTER_OFFSET).value


def executive_address(fdm: "jsbsim.FGFDMExec") -> int:
    """The C++ executive for `advance`, 0 if it is not where it is expected. The aircraft flies one frame."""
    if not (available() and _runs_by_address()):
        return 0
    base, executive = (
        ctypes.c_int64.from_address(id(fdm) + at).value for at in (_BASE_OFFSET, _EXECUTIVE_OFFSET)
    )
    return executive if base == executive > 0 and executive % 8 == 0 and _flies(fdm, executive) else 0


def run_address() -> int:
    """Address of the executive's `Run`; 0 if this build does not export it."""
    return _address(_RUN)


def _runs_by_address() -> bool:
    import jsbsim

    return jsbsim.FGFDMExec.__basicsize__ == _EXECUTIVE_SIZE and run_address() > 0


def _flies(fdm: "jsbsim.FGFDMExec", executive: int) -> bool:
    """Whether a frame run by address is one more frame of this very executive."""
    before_s = fdm.get_sim_time()
    ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.c_void_p)(run_address())(executive)
    return bool(fdm.get_sim_time() == before_s + fdm.get_delta_t())


class NodeBank:
    """Property nodes with their C++ addresses.

    pointers: (n,) int64, valid as long as the bank lives: it keeps the nodes, and whatever `owner` it is
    given (the Plant, whose executive the tied properties read from).
    """

    def __init__(self, nodes: "Sequence[jsbsim.FGPropertyNode]", owner: object = None) -> None:
        self.nodes = tuple(nodes)
        self.owner = owner
        native = available()
        self.pointers = np.array([_pointer(node) if native else 0 for node in self.nodes], dtype=np.int64)

    def read(self, out: np.ndarray) -> None:
        """Read every node into out (n,), through Python."""
        for i, node in enumerate(self.nodes):
            out[i] = node.get_double_value()

    def write(self, values: np.ndarray) -> None:
        """Write values (n,) to the nodes, through Python."""
        for node, value in zip(self.nodes, values, strict=True):
            node.set_double_value(float(value))


def available() -> bool:
    """Whether nodes can be read and written by address here: by compiled code, unless BEAVER_FTC_NATIVE=0."""
    wanted = os.environ.get("BEAVER_FTC_NATIVE", "1") != "0"
    return wanted and not config.DISABLE_JIT and _layout_is_known()  # type: ignore[attr-defined]


@lru_cache(maxsize=1)
def _layout_is_known() -> bool:
    """Check this build of the binding, safest evidence first: nothing unknown is dereferenced."""
    import jsbsim

    cpython = sys.implementation.name == "cpython" and ctypes.sizeof(ctypes.c_void_p) == 8
    if not (cpython and jsbsim.FGPropertyNode.__basicsize__ == _NODE_SIZE):
        return False
    return bool(getter_address() and setter_address()) and _pointers_are_nodes() and _values_agree()


def _made(manager: "jsbsim.FGPropertyManager", name: str) -> "jsbsim.FGPropertyNode":
    node = manager.get_node(name, True)
    assert node is not None
    return node


def _trial_nodes() -> "list[jsbsim.FGPropertyNode]":
    """Nodes in a property tree of their own, with no aircraft behind them."""
    import jsbsim

    manager = jsbsim.FGPropertyManager()
    nodes = [_made(manager, f"trial/value-{i}") for i in range(3)]
    for i, node in enumerate(nodes):
        node.set_double_value(1.0 / (i + 3))
    return nodes


def _pointers_are_nodes() -> bool:
    """Two wrappers of one node hold the same aligned address, wrappers of different nodes different ones."""
    import jsbsim

    manager = jsbsim.FGPropertyManager()
    first, second, again = (_made(manager, f"trial/{name}") for name in "aba")
    same = _pointer(first) == _pointer(again) and first is not again
    return same and _pointer(first) != _pointer(second) and _pointer(first) > 0 and _pointer(first) % 8 == 0


def _values_agree() -> bool:
    """What is written by address reads back through Python to the bit, and the other way round."""
    get = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p)(getter_address())
    put = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)(setter_address())
    for node in _trial_nodes():
        read = get(_pointer(node))
        if node.get_double_value() != read:
            return False
        put(_pointer(node), -read)
        if node.get_double_value() != -read:
            return False
    return True
