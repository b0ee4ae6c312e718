"""Where JSBSim keeps what compiled code reads, writes and runs: addresses in this build of its binding.

A wrong guess of a build's layout would end the process. So the layout is proved once a build, in a child that
may crash (documents/trials.py); where it is another, properties are read and written through the binding.

Nothing here is compiled: what only trims an aircraft has no need of a compiler. See channels.py.
"""

import ctypes
import os
import sys
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import digest_of_files
from beaver_ftc.documents.trials import passes

if TYPE_CHECKING:
    import jsbsim

GETTER = "_ZNK14SGPropertyNode14getDoubleValueEv"  # double SGPropertyNode::getDoubleValue() const
SETTER = "_ZN14SGPropertyNode14setDoubleValueEd"  # bool SGPropertyNode::setDoubleValue(double)
RUN = "_ZN6JSBSim9FGFDMExec3RunEv"  # bool JSBSim::FGFDMExec::Run()

UNKNOWN = "JSBSim {} has a layout that is not known: properties go through Python, a flight takes longer"


class Layout(NamedTuple):
    """The binding's objects, in bytes.

    The Python node: reference count, type, C++ method table, then the counted pointer to the C++ node. The
    Python executive: reference count, type, the C++ executive twice (as its base, as itself), a dictionary.
    """

    node_size: int = 32
    node_pointer: int = 24
    executive_size: int = 40
    executive_base: int = 16
    executive_pointer: int = 24


LAYOUT = Layout()


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(_library_file())


def _library_file() -> str:
    return str(import_module("jsbsim._jsbsim").__file__)


def address(symbol: str) -> int:
    """Address of GETTER, SETTER (the compiled read and write of one node) or RUN (the executive's); 0 if this
    build does not export it."""
    try:
        return ctypes.cast(getattr(_library(), symbol), ctypes.c_void_p).value or 0
    except (AttributeError, OSError):
        return 0


def pointer(node: "jsbsim.FGPropertyNode") -> int:
    """The address of a node."""
    return _word(node, LAYOUT.node_pointer)


def _word(thing: object, offset: int) -> int:
    """A word of a Python object's own memory: not beyond its size, see `_sizes_fit`."""
    return ctypes.c_int64.from_address(id(thing) + offset).value


def executive_address(fdm: "jsbsim.FGFDMExec") -> int:
    """The C++ executive for `advance`, 0 if it is not where it is expected. The aircraft flies one frame."""
    if not available():
        return 0
    executive = _word(fdm, LAYOUT.executive_pointer)
    return executive if _is_executive(fdm, executive) and _flies(fdm, executive) else 0


def _is_executive(fdm: "jsbsim.FGFDMExec", executive: int) -> bool:
    return executive == _word(fdm, LAYOUT.executive_base) and executive > 0 and executive % 8 == 0


def _flies(fdm: "jsbsim.FGFDMExec", executive: int) -> bool:
    """Whether a frame run by address is one more frame of this very executive."""
    before_s = fdm.get_sim_time()
    ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.c_void_p)(address(RUN))(executive)
    return bool(fdm.get_sim_time() == before_s + fdm.get_delta_t())


def available() -> bool:
    """Whether nodes can be read and written by address here: by compiled code, unless BEAVER_FTC_NATIVE=0."""
    wanted = os.environ.get("BEAVER_FTC_NATIVE", "1") != "0"
    compiled = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
    return wanted and compiled and is_proved(LAYOUT)


@lru_cache
def is_proved(layout: Layout) -> bool:
    """Whether this build of the binding has this layout; a line is said where it has another."""
    proved = _sizes_fit(layout) and _is_proved_in_a_child(layout)
    if not proved:
        say_once(UNKNOWN.format(import_module("jsbsim").__version__))
    return proved


def _sizes_fit(layout: Layout) -> bool:
    """What can be seen without following an address: objects are as large, and functions have their names."""
    import jsbsim

    words = sys.implementation.name == "cpython" and ctypes.sizeof(ctypes.c_void_p) == 8
    sizes = jsbsim.FGPropertyNode.__basicsize__, jsbsim.FGFDMExec.__basicsize__
    within = (
        layout.node_pointer <= sizes[0] - 8
        and max(layout.executive_base, layout.executive_pointer) <= sizes[1] - 8
    )
    return (
        words
        and sizes == (layout.node_size, layout.executive_size)
        and within
        and all(map(address, (GETTER, SETTER, RUN)))
    )


def _is_proved_in_a_child(layout: Layout) -> bool:
    library = Path(_library_file())
    status = library.stat()
    here = digest_of_files(Path(__file__))
    build = f"{sys.implementation.cache_tag} {library} {status.st_size} {status.st_mtime_ns} {here}"
    code = (
        "from beaver_ftc.aircraft import load; from beaver_ftc.plant import addresses, adapter; "
        f"addresses.LAYOUT = addresses.{layout}; "
        "raise SystemExit(0 if addresses.holds(adapter.bare(load().jsbsim)) else 3)"
    )
    return passes("jsbsim", build, code, {"BEAVER_FTC_NATIVE": "0"})


def holds(fdm: "jsbsim.FGFDMExec") -> bool:
    """Whether nodes and the executive of a loaded aircraft are where LAYOUT has them.

    A wrong layout may end the process.
    """
    return _pointers_are_nodes() and _values_agree() and _executive_runs(fdm)


def _executive_runs(fdm: "jsbsim.FGFDMExec") -> bool:
    """Whether the aircraft is run by its executive's address."""
    executive = _word(fdm, LAYOUT.executive_pointer)
    return _is_executive(fdm, executive) and _flies(fdm, executive)


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
