"""A `Cockpit` joins one plant and one frame record; and what of the truth is known before the flight."""

from weakref import WeakKeyDictionary

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.addresses import GETTER, RUN, SETTER, address
from beaver_ftc.plant.channels import NodeBank
from beaver_ftc.scenario.faults import HOLDING

UNANTICIPATED = "failures/unanticipated/Cm-alpha3"
LEAST_HEIGHT_M = 500.0  # above the ground at the start; the ground is at sea level, or lower if need be
# Of aircraft that are flown again.
_banks_of: "WeakKeyDictionary[Plant, tuple[NodeBank, ...]]" = WeakKeyDictionary()


class Cockpit:
    """The wires between one plant and one frame record: which nodes are read and written, natively or
    through Python."""

    def __init__(self, plant: Plant, frames: np.ndarray) -> None:
        self._frames, self._plant = frames, plant  # whose executive tied properties read from
        truth, running = frames["truth"][0], frames["running"][0]
        if plant not in _banks_of:
            _banks_of[plant] = _banks(plant)
        self._read, self._write, self._engine, self._air = _banks_of[plant]
        self.native = plant.native
        truth["native"] = self.native
        truth["getter"], truth["setter"] = address(GETTER), address(SETTER)
        truth["read_pointers"][: truth["n"]] = self._read.pointers
        truth["write_pointers"] = self._write.pointers
        truth["levers"] = len(self._engine.nodes)
        truth["lever_pointers"][: truth["levers"]] = self._engine.pointers
        running["run"], running["executive"] = address(RUN), plant.executive
        running["getter"], running["setter"] = truth["getter"], truth["setter"]
        running["heading_pointer"], running["axes_pointer"] = self._air.pointers

    def read(self) -> None:
        """Bring the truth into the frame record, through Python."""
        truth = self._frames["truth"][0]
        self._read.read(truth["value"][: truth["n"]])

    def write(self) -> None:
        """Hand the command over, through Python."""
        self._write.write(self._frames["prediction"]["commanded"][0])
        power = self._frames["control"]["power"]["output"]
        if power["in_use"][0]:
            self._engine.write(power["command"][0, : len(self._engine.nodes)])

    def turn_air(self) -> None:
        """Turn the turbulence with the aircraft's heading, as its spectra are meant [MIL-F-8785C, 3.7.1].

        JSBSim keeps it in axes along the wind, and without one along whatever direction it met first: a
        rolling gust would pitch an aircraft that flies across. `psiw` turns them the other way round.
        """
        heading, axes = self._air.nodes
        axes.set_double_value(-heading.get_double_value())


def _banks(plant: Plant) -> tuple[NodeBank, ...]:
    """What is read of the truth; where the command goes, and the engines'; heading and axes of
    the turbulence."""
    aircraft = plant.aircraft
    differences = [effector.throttle for effector in aircraft.effectors.values()]
    return (
        NodeBank([plant.node(name) for _, name, _ in ch.truth_channels(aircraft)]),
        NodeBank([plant.input(name) for name in ch.command_properties(aircraft)]),
        NodeBank([plant.input(name) for name in (aircraft.trim.throttle, *differences)]),
        NodeBank([plant.node("attitude/psi-rad"), plant.input("atmosphere/psiw-rad")]),
    )


def set_origin(truth: np.void, plant: Plant, altitude_m: float) -> None:
    """Where the flight starts, and where the ground is."""
    truth["latitude_0"] = plant.read(ch.FIXED[ch.LATITUDE][1])
    truth["longitude_0"] = plant.read(ch.FIXED[ch.LONGITUDE][1])
    has_gear = plant.has("gear/unit[0]/WOW") and plant.aircraft.file.ground is None
    wheels_m = plant.aircraft.geometry.span_m if has_gear else 0.0  # height at which it is down
    truth["ground_m"] = min(wheels_m, altitude_m - LEAST_HEIGHT_M)
    truth["radius_m"] = EARTH_RADIUS_M + altitude_m
    truth["parallel_radius_m"] = truth["radius_m"] * np.cos(truth["latitude_0"])


def note_failures(truth: np.void, plant: Plant) -> None:
    """Which surfaces cannot move now, and the unanticipated fault, for the oracle and the accounts."""
    truth["immovable"] = [
        any(plant.read(f"failures/{s}/{how}") for how in HOLDING) for s in plant.aircraft.surfaces
    ]
    truth["Cm_alpha3"] = plant.read(UNANTICIPATED)
