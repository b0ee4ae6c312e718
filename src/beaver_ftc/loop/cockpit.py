"""What joins one plant and one frame record."""

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant import native
from beaver_ftc.plant.adapter import Plant


class Cockpit:
    """The wires between one plant and one frame record: which nodes are read and written, natively or
    through Python."""

    def __init__(self, plant: Plant, frames: np.ndarray) -> None:
        self._frames = frames
        self._read = native.NodeBank(
            [plant.node(name) for _, name, _ in _channels(plant.aircraft, frames["truth"][0])], owner=plant
        )
        self._write = native.NodeBank(
            [plant.node(name) for name in ch.command_properties(plant.aircraft)], owner=plant
        )
        self._engine = native.NodeBank([plant.node(plant.aircraft.trim.throttle)], owner=plant)
        self.native = native.available()
        truth = frames["truth"][0]
        truth["native"] = self.native
        truth["getter"], truth["setter"] = native.getter_address(), native.setter_address()
        truth["read_pointers"][: truth["n"]] = self._read.pointers
        truth["write_pointers"] = self._write.pointers
        truth["engine_pointer"] = self._engine.pointers

    def read(self) -> None:
        """Bring the truth into the frame record, through Python."""
        truth = self._frames["truth"][0]
        self._read.read(truth["value"][: truth["n"]])

    def write(self) -> None:
        """Hand the command over, through Python."""
        self._write.write(self._frames["belief"]["commanded"][0])
        power = self._frames["control"]["power"]
        if power["in_use"][0]:
            self._engine.write(power["command"][0])


def _channels(aircraft: Aircraft, truth: np.void) -> tuple[ch.Channel, ...]:
    """What is read of the truth: as many as its record has."""
    return (*ch.truth_channels(aircraft), *ch.further_channels(aircraft))[: int(truth["n"])]
