"""What a law is: the contract between the loop and a control law that is plugged in."""

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict


class Reference(NamedTuple):
    """What is to be followed at one frame; per axis (p, q, r).

    commanded (3,) rad/s: the scenario's. rate (3,) rad/s and acceleration (3,) rad/s2: the reference model's
    answer to it, which is what tracking is measured against.
    """

    commanded: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray


@runtime_checkable
class Law(Protocol):
    """A control law. Its class needs no arguments; its first docstring line is what `list` shows.

    A class attribute `fault_tolerant = True` says that it uses the verdict: the supervisor then reports
    `adaptive` or `unanticipated` after an alarm, and `nominal` throughout without it.
    """

    def reset(self, context: Context) -> None:
        """Called once before a flight."""

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Called every frame: the command (4,) rad for aileron, elevator, rudder, flap. The loop limits
        it."""
