"""Whether there is a fault, which it is, and how large: detection, isolation, fault types, monitors.

This file has the contract between the loop and a diagnosis scheme that is plugged in (`Detector`). A detector
is given the measurements, the deflections of healthy surfaces, and the accelerations that the design model
computes from the two. It is given nothing of the truth.
"""

from math import nan
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np

from beaver_ftc.public import lazily

if TYPE_CHECKING:  # for annotations
    from beaver_ftc.design.context import Context

if TYPE_CHECKING:  # what the folder publishes: public.py
    from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2
    from beaver_ftc.diagnosis.conclusion import UNANTICIPATED
    from beaver_ftc.diagnosis.config import scheme_number
    from beaver_ftc.diagnosis.detection.blocks import LOSS
    from beaver_ftc.diagnosis.isolation import estimator_names
    from beaver_ftc.diagnosis.readout import (
        RECORDED_BLOCK_FIELDS,
        Actuator,
        DiagnosisReadout,
        FaultTypesConfig,
        SensorMonitor,
        StatisticalBlock,
        StatisticalHypothesis,
    )
    from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER, TYPE_NAMES
    from beaver_ftc.diagnosis.types.registry import TYPES as TYPE_ROWS
else:
    __getattr__, __dir__ = lazily(__name__)


_UNREAD = np.full(3, nan)
_UNREAD.flags.writeable = False


class Measured(NamedTuple):
    """The measurements of one frame. Each array is a copy, so you can keep it.

    - `t_s`: time of the frame, s.
    - `x` (3,) rad/s: measured p, q and r.
    - `y` (4 + signals,): angle of attack rad, sideslip rad, airspeed m/s, dynamic pressure Pa, and the
      signals that the aircraft declares. The Beaver declares one, `dpt`.

    The next three fields are means over the frame that ends at `t_s`. In the first frame, `acceleration` and
    `contribution` are zero, and `eta_bar` is the bound at this instant.

    - `acceleration` (3,) rad/s²: angular acceleration f + G u of the design model. With x_before, the `x` of
      the previous frame, the innovation is (x - x_before) / dt - acceleration.
    - `contribution` (3, surfaces) rad/s²: the part G_s u_s of each surface, at the deflection of a healthy
      one.
    - `eta_bar` (3,) rad/s²: declared bound on the error of `acceleration`.

    The last three fields are readings at `t_s`. They are NaN if no such instrument is read, as in some
    recorded flights.

    - `attitude` (3,) rad: roll, pitch and yaw angle.
    - `force` (3,) m/s²: accelerometers, in body axes: all forces but gravity, over the mass.
    - `altitude_m`: altitude above sea level, m.
    """

    t_s: float
    x: np.ndarray
    y: np.ndarray
    acceleration: np.ndarray
    contribution: np.ndarray
    eta_bar: np.ndarray
    attitude: np.ndarray = _UNREAD
    force: np.ndarray = _UNREAD
    altitude_m: float = nan


class Verdict(NamedTuple):
    """The result of a detector up to the present frame. The loop keeps the first alarm.

    - `detected`: True if the detector raises the alarm.
    - `axis`: axis of the alarm: `p`, `q` or `r`; None counts as `p`. The first verdict with `detected`
      decides.
    - `isolated`: name of the faulty surface, or `unanticipated`; None if no fault is isolated.
    - `type`: fault type of the isolated fault.
    - `estimate`: estimated size of the fault. The size of a loss of effectiveness is theta, from -1 to 0. The
      size of any other fault is an angle, rad, which the laws do not use.
    - `effectiveness` (surfaces,): estimated effectiveness of every surface, 1 if it is healthy. The adaptive
      laws use it. None if the detector does not estimate it.
    - `statistic`: number that exceeds 1 when the alarm is raised. Compute this number in every frame, also
      after the alarm. `compare` needs it to try other alarm levels.
    - `candidates`: names that are not excluded.
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
    """A diagnosis scheme. Write a class with the methods `reset` and `step`.

    Its constructor takes no arguments. `beaver-ftc list` prints the first line of its docstring as a
    description.
    """

    def reset(self, context: "Context") -> None:
        """Prepare the detector for a flight. The loop calls this method once before the flight."""

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Return the verdict up to this frame. The loop calls this method once for each frame.

        - `measured`: the measurements of the frame.
        - `command` (surfaces,) rad: deflections of healthy surfaces now, by the actuators as known.
        """
