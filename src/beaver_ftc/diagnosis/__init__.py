"""Whether there is a fault, which it is, and how large: detection, isolation, fault types, monitors.

This file has the contract between the loop and a diagnosis scheme that is plugged in (`Detector`). A detector
is given the measurements, the command in effect, and the accelerations that the design model computes from
the two. It is given nothing of the truth.
"""

from math import nan
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.design.context import Context

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2
    from beaver_ftc.diagnosis.isolation import estimator_names
    from beaver_ftc.diagnosis.readout import (
        RECORDED_BLOCK_FIELDS,
        Actuator,
        DiagnosisReadout,
        FaultTypesConfig,
        SensorMonitor,
    )
    from beaver_ftc.diagnosis.readout import FilterBlock as StatisticalBlock
    from beaver_ftc.diagnosis.readout import Hypothesis as StatisticalHypothesis
    from beaver_ftc.diagnosis.state import LOSS, UNANTICIPATED, scheme_number
    from beaver_ftc.diagnosis.types import DeflectionRelation
    from beaver_ftc.diagnosis.types.registry import TYPE_DESCRIPTIONS, TYPE_NAMES, type_index_of
    from beaver_ftc.diagnosis.types.registry import TYPES as TYPE_ROWS
else:
    __getattr__, __dir__ = lazily(__name__)


class Measured(NamedTuple):
    """The measurements of one frame. The arrays are copies, so you can keep them.

    t_s: time. x (3,) rad/s: p, q, r. y (4 + signals,): alpha rad, beta rad, airspeed m/s, dynamic pressure
    Pa, then the signals that the aircraft declares (the Beaver: dpt).

    The other fields are means over the frame that has just elapsed, and zero in the first frame.
    acceleration (3,) rad/s2: f + G u of the design model; x - x_before - dt acceleration is therefore the
    innovation times dt. contribution (3, surfaces) rad/s2: part of this acceleration that each commanded
    surface causes. eta_bar (3,) rad/s2: declared bound on the error of this acceleration.
    """

    t_s: float
    x: np.ndarray
    y: np.ndarray
    acceleration: np.ndarray
    contribution: np.ndarray
    eta_bar: np.ndarray


class Verdict(NamedTuple):
    """The result of a detector so far. The first alarm stays on.

    axis: axis of the alarm: p, q or r. isolated: name of a surface, unanticipated, or None.
    type: type of the isolated fault. estimate: its parameter, theta in [-1, 0] for a loss of effectiveness.
    effectiveness (surfaces,): of every surface, 1 if healthy, if the detector estimates it; the adaptive laws
    use it. statistic: above 1 there is an alarm. Compute it in every frame, also after the alarm, because
    `compare` tries other alarm levels.
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

    def reset(self, context: "Context") -> None:
        """Called once before a flight."""

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Called every frame, with the command (surfaces,) rad that the surfaces follow at this instant."""
