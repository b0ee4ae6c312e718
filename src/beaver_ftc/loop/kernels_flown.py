"""Which kernels a flight will call: those that are not kept are compiled together (compiled/ahead.py).

Kernels with long code stand first. One that is missing in the list is compiled when it is first called; one
that the flight does not call, because no alarm is raised, is ready for the next flight.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numba import types

from beaver_ftc.compiled import borrows
from beaver_ftc.compiled.ahead import Wanted
from beaver_ftc.control import CompiledLaw, accommodation, laws
from beaver_ftc.control.general_allocation import allocate_generally
from beaver_ftc.control.state import in_charge
from beaver_ftc.diagnosis.schemes import kernels_of_scheme
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.stepping import diagnose_one, fly_on, fly_one

_ROW = types.Array(types.float64, 1, "C")


_NUMBERS = {
    "k": types.int64, "j": types.int64, "mode": types.int64, "before": types.int64,
    "by_observer": types.boolean,
    "t": types.float64, "share": types.float64, "probe": types.float64,
    "commanded": _ROW, "row": _ROW, "effectiveness": _ROW,
}  # fmt: skip


def kernels_flown(frames: np.ndarray, arrays: tuple[np.ndarray, ...]) -> Iterator[Wanted]:
    """What a flight calls that flies these frames by `fly_on` with these further arrays."""
    if not borrows():  # then they are all parts of one
        return
    from beaver_ftc.compiled.sized_types import array_type  # there is none in every version of Numba

    frame = frames[0]
    yield Wanted.of(fly_on, tuple(array_type(each.dtype, each.ndim) for each in (frames, *arrays)))
    stages = (fly_one, whole.sense, whole.evaluate_elapsed, diagnose_one, whole.finish)
    wanted = (*stages, *_of_the_diagnosis(frame), *_of_the_law(frame))
    for each in sorted(wanted, key=lambda wanted: -wanted.called.size):
        yield Wanted.of(each, _kinds(each, frame))


def _of_the_diagnosis(frame: np.void) -> Iterator[Any]:
    fdi = frame["fdi"]
    yield from kernels_of_scheme(fdi)
    if fdi["sensor_monitor"]["config"]["enabled"]:
        yield whole.monitor_sensors


def _of_the_law(frame: np.void) -> Iterator[Any]:
    control = frame["control"]
    law: CompiledLaw = in_charge(control)
    yield from (law.accommodate or accommodation.accommodate, law.command)
    yield from (laws.prepare, laws.command_surfaces, laws.complete)
    if control["layout"]["general"]:
        yield allocate_generally
    if frame["autopilot"]["enabled"]:
        yield whole.fly_profile


def _kinds(wanted: Callable[..., Any], frame: np.void) -> tuple[Any, ...]:
    """The types of its arguments, by their names: numbers, or parts of the frame or of its control."""
    function = wanted.py_func  # type: ignore[attr-defined]
    return tuple(
        _kind(name, frame.dtype) for name in function.__code__.co_varnames[: function.__code__.co_argcount]
    )


def _kind(name: str, frame: np.dtype) -> Any:
    if name in _NUMBERS:
        return _NUMBERS[name]
    from beaver_ftc.compiled.sized_types import kind_of

    kind = kind_of(frame, 0)
    return kind if name == "frame" else kind.typeof(name) or kind.typeof("control").typeof(name)
