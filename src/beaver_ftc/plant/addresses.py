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

GETTER = "_ZNK14SGPropertyNode14getDoubleValueEv"  # double SGPropertyNode::getDoubleValue() const
SETTER = "_ZN14SGPropertyNode14setDoubleValueEd"  # bool SGPropertyNode::setDoubleValue(double)

# The Python node: reference count, type, C++ method table, then the counted pointer to the C++ node.
_NODE_SIZE = 32
_POINTER_OFFSET = 24

RUN = "_ZN6JSBSim9FGFDMExec3RunEv"  # bool JSBSim::FGFDMExec::Run()

# The Python executive: reference count, type, the C++ executive twice (as its base, as itself), a dictionary.
_EXECUTIVE_SIZE = 40
_BASE_OFFSET, _EXECUTIVE_OFFSET = 16, 24


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(import_module("jsbsim._jsbsim").__file__)


def address(symbol: str) -> int:
    """Address of GETTER, SETTER (the compiled read and write of one node) or RUN (the executive's); 0 if this
    build does not export it."""
    try:
        return ctypes.cast(getattr(_library(), symbol), ctypes.c_void_p).value or 0
    except (AttributeError, OSError):
        return 0


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


def _runs_by_address() -> bool:
    import jsbsim

    return jsbsim.FGFDMExec.__basicsize__ == _EXECUTIVE_SIZE and address(RUN) > 0


def _flies(fdm: "jsbsim.FGFDMExec", executive: int) -> bool:
    """Whether a frame run by address is one more frame of this very executive."""
    before_s = fdm.get_sim_time()
    ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.c_void_p)(address(RUN))(executive)
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
    return bool(address(GETTER) and address(SETTER)) and _pointers_are_nodes() and _values_agree()


def _trial_nodes(names: str) -> "list[jsbsim.FGPropertyNode]":
    """Nodes of these names, a letter each, in a property tree of their own, with no aircraft behind them."""
    import jsbsim

    manager = jsbsim.FGPropertyManager()
    nodes = (manager.get_node(f"trial/{name}", True) for name in names)
    return [node for node in nodes if node is not None]


def _pointers_are_nodes() -> bool:
    """Two wrappers of one node hold the same aligned address, wrappers of different nodes different ones."""
    first, second, again = _trial_nodes("aba")
    same = pointer(first) == pointer(again) and first is not again
    return same and pointer(first) != pointer(second) and pointer(first) > 0 and pointer(first) % 8 == 0


def _values_agree() -> bool:
    """What is written by address reads back through Python to the bit, and the other way round."""
    get = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p)(address(GETTER))
    put = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)(address(SETTER))
    for i, node in enumerate(_trial_nodes("abc")):
        node.set_double_value(1.0 / (i + 3))
        read = get(pointer(node))
        if node.get_double_value() != read:
            return False
        put(pointer(node), -read)
        if node.get_double_value() != -read:
            return False
    return True
