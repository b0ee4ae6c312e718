"""Where JSBSim keeps what compiled code reads, writes and runs: addresses in this build of its binding.

Nothing here is compiled: what only trims an aircraft has no need of a compiler. See native.py.
"""

import ctypes
import os
import sys
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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


def pointer(node: "jsbsim.FGPropertyNode") -> int:
    """The address of a node."""
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


def available() -> bool:
    """Whether nodes can be read and written by address here: by compiled code, unless BEAVER_FTC_NATIVE=0."""
    wanted = os.environ.get("BEAVER_FTC_NATIVE", "1") != "0"
    compiled = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
    return wanted and compiled and _layout_is_known()


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
    same = pointer(first) == pointer(again) and first is not again
    return same and pointer(first) != pointer(second) and pointer(first) > 0 and pointer(first) % 8 == 0


def _values_agree() -> bool:
    """What is written by address reads back through Python to the bit, and the other way round."""
    get = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p)(getter_address())
    put = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)(setter_address())
    for node in _trial_nodes():
        read = get(pointer(node))
        if node.get_double_value() != read:
            return False
        put(pointer(node), -read)
        if node.get_double_value() != -read:
            return False
    return True
