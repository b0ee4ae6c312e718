"""What a detector is: the contract between the loop and a diagnosis scheme that is plugged in.

A detector is given what is measured, the command in effect, and what the design model makes of the two; of
the truth nothing.
"""

from math import nan
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from beaver_ftc.design.context import Context


class Measured(NamedTuple):
    """What is known at one frame. Arrays are copies: keep them if you like.

    t_s: time. x (3,) rad/s: p, q, r. y (4 + signals,): alpha rad, beta rad, airspeed m/s, dynamic
    pressure Pa, then the signals the aircraft declares (the Beaver: dpt).
    Of the frame that has just elapsed, as the design model sees it (zeros at the first frame):
    acceleration (3,) rad/s2 is its f + G u, so that x - x_before - dt acceleration is the innovation;
    contribution (3, surfaces) rad/s2 is what each commanded surface gives of it; eta_bar (3,) rad/s2 is the
    declared bound on the error.
    """

    t_s: float
    x: np.ndarray
    y: np.ndarray
    acceleration: np.ndarray
    contribution: np.ndarray
    eta_bar: np.ndarray


class Verdict(NamedTuple):
    """What a detector makes of the flight so far. The alarm is latched by the loop: the first one counts.

    axis: p, q or r, where it showed. isolated: aileron, elevator, rudder, flap, unanticipated, or None.
    type: of the isolated fault. estimate: its parameter, theta in [-1, 0] for a loss of effectiveness.
    effectiveness (4,): of every surface, 1 healthy, if the detector estimates it; the adaptive laws use it.
    statistic: alarm when it exceeds 1. `compare` tries other levels too and draws the whole trade-off, so it
    is to be computed in every frame, as if no alarm had been raised: one that stays as it was at the alarm is
    never above a higher level.
    """

    detected: bool = False
    axis: str | None = None
    isolated: str | None = None
    type: str | None = None
    estimate: float | None = None
    effectiveness: np.ndarray | None = None
    statistic: float = nan
    candidates: tuple[str, ...] = ()


@runtime_checkable
class Detector(Protocol):
    """A diagnosis scheme. Its class needs no arguments; its first docstring line is what `list` shows."""

    def reset(self, context: Context) -> None:
        """Called once before a flight."""

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Called every frame, with the command (4,) rad the surfaces follow as it is measured."""
