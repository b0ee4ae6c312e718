"""Faults of instruments: when what a sensor says goes wrong. The aircraft itself is left alone.

Times as in faults.py. Several faults of one sensor add up: offsets add, relative errors multiply, noise adds
by its squares; one that is frozen or lost says nothing else.
"""

from collections.abc import Sequence
from math import hypot, radians
from typing import Any

import numpy as np

from beaver_ftc.plant.faults import NEVER, frame_of
from beaver_ftc.plant.instruments import SENSORS
from beaver_ftc.scenario.sensor_faults import UNITS, SensorFault
from beaver_ftc.scenario.sensors import ENGINE

OF_THE_SLIPSTREAM = ("V", "qdyn", *ENGINE)  # what dpt is worked out from
_SI = {"deg/s": radians(1.0), "deg": radians(1.0)}


def si(sensor: str) -> float:
    """What a fault's magnitude is multiplied by to be in SI, or in the engine's own units."""
    return _SI.get(UNITS[sensor][0], 1.0)


class SensorFaultSchedule:
    """Breaks and mends the instruments (dtype INSTRUMENTS), frame by frame.

    faults: the scenario's; those of surfaces are passed over. rate_hz: frame rate of the loop. has_engine:
    the aircraft has instruments from which dpt follows.
    """

    def __init__(
        self, faults: Sequence[Any], instruments: np.void, rate_hz: float, has_engine: bool = False
    ) -> None:
        self._instruments, self._rate_hz, self._has_engine = instruments, rate_hz, has_engine
        self.declare(faults)

    def declare(self, faults: Sequence[Any]) -> None:
        """Take these faults for those declared so far."""
        self._faults = [fault for fault in faults if isinstance(fault, SensorFault)]
        self._spans = [(frame_of(f.at_s, self._rate_hz), self._last(f)) for f in self._faults]

    def _last(self, fault: SensorFault) -> int:
        return NEVER if fault.end_s is None else frame_of(fault.end_s, self._rate_hz)

    @property
    def any(self) -> bool:
        """Whether an instrument breaks in this flight."""
        return bool(self._faults)

    def begun(self, k: int) -> bool:
        """Whether some instrument has broken by frame k, mended or not."""
        return any(first <= k for first, _ in self._spans)

    def next_change(self, k: int) -> int:
        """The first frame after k in which an instrument breaks or is mended; NEVER if none."""
        return min((at for span in self._spans for at in span if at > k), default=NEVER)

    def apply(self, k: int) -> None:
        """Bring the instruments to frame k; again is harmless. From the first fault of theirs on, dpt is what
        engine and air data say."""
        if not self._faults:
            return
        record = self._instruments["fault"]
        record["bias"] = record["scale"] = record["noise"] = 0.0
        record["frozen"] = record["lost"] = 0
        for fault, (first, last) in zip(self._faults, self._spans, strict=True):
            if first <= k and self._has_engine and fault.sensor in OF_THE_SLIPSTREAM:
                self._instruments["engine"] = 1
            if first <= k < last:
                _take(record[SENSORS.index(fault.sensor)], fault)
        self._instruments["broken"] = 1  # from now on: a mended one must let go of what it holds


def _take(record: np.void, fault: Any) -> None:
    """Add one fault to what an instrument's record says."""
    unit = si(fault.sensor)
    if fault.type == "bias":
        record["bias"] += unit * fault.magnitude
    elif fault.type == "noise":
        record["noise"] = hypot(record["noise"], unit * fault.magnitude)
    elif fault.type == "scale":
        record["scale"] = (1.0 + record["scale"]) * (1.0 + fault.magnitude) - 1.0
    elif fault.type == "freeze":
        record["frozen"] = 1
    else:
        record["lost"] = 1
