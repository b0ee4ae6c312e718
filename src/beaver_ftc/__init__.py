"""Actuator fault diagnosis and fault-tolerant control of the DHC-2 Beaver, flown by JSBSim.

    import beaver_ftc as bf

    flight = bf.fly("elevator-partial-loss")
    flight.log, flight.detection, flight.plot("tracking")

What is heavy is imported when it is first used.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plugins import watch_imports

if TYPE_CHECKING:
    from collections.abc import Callable

    from beaver_ftc.aircraft.aircraft import Aircraft
    from beaver_ftc.control import Law, Reference
    from beaver_ftc.design.context import Context
    from beaver_ftc.diagnosis import Detector, Measured, Verdict
    from beaver_ftc.loop.stream import Diagnosis
    from beaver_ftc.plant.conditions import linearise, trim
    from beaver_ftc.results.flight import Flight, fly, open_run
    from beaver_ftc.results.simulation import Simulation
    from beaver_ftc.scenario.airframe import find_aircraft as aircraft
    from beaver_ftc.scenario.builtin import builtin_names as scenarios
    from beaver_ftc.scenario.schema import Scenario, load
    from beaver_ftc.studies.sweep.table_of_flights import sweep

__version__ = "1.1.0"

# Public name -> module, or module:name there, by which it is found at first use.
_WHERE = {
    **dict.fromkeys(("Detector", "Measured", "Verdict"), "beaver_ftc.diagnosis"),
    **dict.fromkeys(("Flight", "fly", "open_run"), "beaver_ftc.results.flight"),
    **dict.fromkeys(("Law", "Reference"), "beaver_ftc.control"),
    **dict.fromkeys(("linearise", "trim"), "beaver_ftc.plant.conditions"),
    "Context": "beaver_ftc.design.context",
    "Diagnosis": "beaver_ftc.loop.stream",
    "Scenario": "beaver_ftc.scenario.schema",
    "Simulation": "beaver_ftc.results.simulation",
    "load": "beaver_ftc.scenario.schema",
    "scenarios": "beaver_ftc.scenario.builtin:builtin_names",
    "sweep": "beaver_ftc.studies.sweep.table_of_flights",
}
__all__ = [
    "BadInput", "Context", "Detector", "Diagnosis", "Flight", "Law", "Measured", "Reference", "Scenario",
    "Simulation", "SimulationFailed", "Verdict", "__version__", "aircraft", "fly", "linearise", "load",
    "open_run", "scenarios", "sweep", "trim",
]  # fmt: skip


class _Public(ModuleType):
    """This module: `aircraft` is the function, though a folder is called so, too."""

    @property
    def aircraft(self) -> "Callable[..., Aircraft]":
        """The aircraft of a name, `jsbsim:NAME` or `./FOLDER`; see `scenario.airframe`."""
        from beaver_ftc.scenario.airframe import find_aircraft

        return find_aircraft

    @aircraft.setter
    def aircraft(self, folder: ModuleType) -> None:
        """Importing the folder would put it in the function's place."""


sys.modules[__name__].__class__ = _Public


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _WHERE[name].partition(":")
    found = globals()[name] = getattr(import_module(module), attribute or name)
    return found


watch_imports()


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
