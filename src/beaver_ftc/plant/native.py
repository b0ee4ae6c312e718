"""Many properties in one compiled call, and JSBSim's own frame from compiled code.

A property read through JSBSim's Python binding costs about 0.1 us; a frame reads and writes some forty. The
binding exports the C++ accessors of a property node, so a compiled kernel can call them on the node's own
address: 0.01 us each. That rests on how one build of the binding is laid out, so addresses.py has it proved
in a child process before it is used. The environment variable BEAVER_FTC_NATIVE=0 turns it off; the caller
reads and writes through Python then.

Likewise the executive's `Run`, which `advance` calls: a flight then leaves compiled code only when something
changes. An error that JSBSim raises could not be caught there. Its models of an aircraft without engines
raise none once that is loaded and trimmed; aircraft with engines are run through Python.

    bank = NodeBank([plant.node(name) for name in names])
    read_nodes(address(GETTER), bank.pointers, out)       # also from inside another compiled kernel
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from beaver_ftc.compiled import kernel, record
from beaver_ftc.plant.addresses import available, pointer

if TYPE_CHECKING:  # a diagnosis alone uses compiled code of this module, without JSBSim
    import jsbsim

# What `advance` needs: code and executive; whether turbulence is to be turned, and the nodes for that.
RUNNING = record(
    run=int, executive=int, turbulent=int, getter=int, setter=int, heading_pointer=int, axes_pointer=int,
)  # fmt: skip


_ADDRESS, _NUMBER, _TRUTH = ir.IntType(64), ir.DoubleType(), ir.IntType(1)


def _calling(returned, *given):
    """What makes the code that calls the function at the first argument with the others."""

    def codegen(context, builder, signature, args):
        function = builder.inttoptr(args[0], ir.FunctionType(returned, given).as_pointer())
        return builder.call(function, args[1:])

    return codegen


@intrinsic
def _call_getter(typingctx, function, node):
    return types.float64(types.int64, types.int64), _calling(_NUMBER, _ADDRESS)


@intrinsic
def _call_setter(typingctx, function, node, value):
    return types.boolean(types.int64, types.int64, types.float64), _calling(_TRUTH, _ADDRESS, _NUMBER)


@intrinsic
def _call_run(typingctx, function, executive):
    return types.boolean(types.int64, types.int64), _calling(_TRUTH, _ADDRESS)


@kernel
def advance(simulator):
    """One JSBSim frame; simulator: of dtype RUNNING. Turbulence is first turned along the heading, see
    `cockpit.Cockpit.turn_air`."""
    if simulator.turbulent:
        heading: float = _call_getter(simulator.getter, simulator.heading_pointer)  # type: ignore
        _call_setter(simulator.setter, simulator.axes_pointer, -heading)
    _call_run(simulator.run, simulator.executive)  # type: ignore


@kernel
def read_nodes(getter, pointers, out):
    """Read nodes into out. getter: address(GETTER). pointers, out: (n,) int64, float64."""
    for i in range(pointers.size):
        out[i] = _call_getter(getter, pointers[i])  # type: ignore[call-arg]


@kernel
def write_nodes(setter, pointers, values):
    """Write values to nodes. setter: address(SETTER). pointers, values: (n,) int64, float64."""
    for i in range(pointers.size):
        _call_setter(setter, pointers[i], values[i])  # type: ignore[call-arg]


class NodeBank:
    """Property nodes with their C++ addresses.

    pointers: (n,) int64, valid as long as the bank lives: it keeps the nodes, and whatever `owner` it is
    given (the Plant, whose executive the tied properties read from).
    """

    def __init__(self, nodes: "Sequence[jsbsim.FGPropertyNode]", owner: object = None) -> None:
        self.nodes = tuple(nodes)
        self.owner = owner
        native = available()
        self.pointers = np.array([pointer(node) if native else 0 for node in self.nodes], dtype=np.int64)

    def read(self, out: np.ndarray) -> None:
        """Read every node into out (n,), through Python."""
        for i, node in enumerate(self.nodes):
            out[i] = node.get_double_value()

    def write(self, values: np.ndarray) -> None:
        """Write values (n,) to the nodes, through Python."""
        for node, value in zip(self.nodes, values, strict=True):
            node.set_double_value(float(value))
