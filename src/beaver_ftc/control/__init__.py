"""What commands the surfaces: laws, allocation, accommodation of a fault, the supervisor, rivals.

This file has the contract of a law that is plugged in (`Law`), that of a law that is compiled
(`CompiledLaw`), and the rows of the compiled laws: what plugins.yaml says of each by its name.
"""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.plugins import LAWS, compiled_rows

if TYPE_CHECKING:
    from beaver_ftc.design.context import Context

_ROWS = compiled_rows(LAWS)
# The modules of kernels. The place of a law is that of its module in this order.
MODULES = tuple(dict.fromkeys(row["kernels"] for row in _ROWS.values()))
# Defaults of the keys that plugins.yaml may omit for a law
_GIVEN = {"uses_verdict": False, "reallocates": False, "informed": False, "pitch_by_power": True}


class Row(NamedTuple):
    """A law by name. place: of its module in MODULES; file: name of its file, without `.py`.
    uses_verdict, reallocates, informed, pitch_by_power: what the law receives and may do (plugins.yaml)."""

    name: str
    place: int
    file: str
    uses_verdict: bool
    reallocates: bool
    informed: bool
    pitch_by_power: bool


def file_of(module: str) -> str:
    """The name of a module's file, without `.py`."""
    return module.rpartition(".")[2]


@cache
def row_of(name: str) -> Row:
    """The row of a compiled law; for a plug-in, the values of the first row, whose law does not use the
    verdict."""
    row = _ROWS.get(name) or next(iter(_ROWS.values()))
    flags = {key: bool(row.get(key, default)) for key, default in _GIVEN.items()}
    return Row(name, MODULES.index(row["kernels"]), file_of(row["kernels"]), **flags)


def has_kernels(name: str) -> bool:
    """Whether a law, perhaps a plug-in of ours, has a compiled form."""
    return name in _ROWS


def flown_by(file: str) -> list[str]:
    """Names of the laws whose kernels are in this file."""
    return [name for name in _ROWS if row_of(name).file == file]


class Reference(NamedTuple):
    """The reference of one frame, for p, q and r.

    - `commanded` (3,) rad/s: body rates that the scenario commands.
    - `rate` (3,) rad/s, `acceleration` (3,) rad/s²: response of the reference model. A tracking error is the
      difference from `rate`.
    """

    commanded: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray


@runtime_checkable
class Law(Protocol):
    """A control law. Write a class with the methods `reset` and `step`.

    The class takes no arguments. `beaver-ftc list` prints the first line of its docstring as a description.

    With the class attribute `fault_tolerant = True` the law declares that it uses the verdict. After an alarm
    the supervisor then reports the mode `adaptive` or `unanticipated`. Without the attribute the mode stays
    `nominal`.
    """

    def reset(self, context: "Context") -> None:
        """Prepare the law for a flight. The loop calls this method once before the flight."""

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Return the command (surfaces,) rad. The loop calls this method once for each frame. It limits the
        command to the travel of the surfaces.
        """


class CompiledLaw(NamedTuple):
    """A law that flies compiled. Its file ends with `LAW`, one of these; a row of plugins.yaml names the
    file.

    records: function of the number of surfaces n that returns the type of the law's own record,
    `control.NAME` for a file NAME.py. The law's kernels alone write that record.

    Lazy kernels (compiled/), called once a frame with `control` (control/state.py), `assessment` (what the
    diagnosis says of each surface) and the records `prediction` and `measured`; without `accommodate`, a law
    has that of accommodation.py:

        accommodate(control, assessment, faults, prediction, measured)   effectiveness of each surface
        command(control, assessment, faults, prediction, measured, mode, t)   deflection of each surface

    `command` leaves the deflections (n,) rad in control.allocation.output.command.

    faults: the true faults, for laws whose row says `informed`. mode: the supervisor's; t s.

    configure(law, control, prediction, declared, y): fill the law's configuration at the trim; y: the signals
    measured there.
    unexplained(control): acceleration (3,) rad/s2 that the law in charge attributes to no model.
    begin(control, before, unexplained, learnt): take over in flight from the law whose records are `before`,
    without a bump; learnt (3,) rad/s2: what the diagnosis' network explains of `unexplained`.
    """

    records: Callable[[int], np.dtype]
    command: Callable[..., None]
    accommodate: Callable[..., None] | None = None
    configure: Callable[..., None] | None = None
    unexplained: Callable[[Any], np.ndarray] | None = None
    begin: Callable[..., None] | None = None
